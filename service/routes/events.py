"""/v1/jobs/{job_id}/events."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated, Final

from anyio import to_thread
from fastapi import APIRouter, Header, Request, Response

from service import documentation as doc
from service.context import Context
from service.events import EventStream, Teller, last_event_id, was_last
from service.identifiers import JobId
from service.queries import KNOWN_QUERY

router = APIRouter(tags=["Jobs"], dependencies=[KNOWN_QUERY])
KIND: Final = "text/event-stream"
EXAMPLE: Final = """retry: 1000

event: status
data: {"id":"job_01K5Z9Q8M4T6V2X0Y7R3N1W5BC","status":"running","done":false,"rev":3,…}
id: 3.-1

event: snapshot
data: {"job_id":"job_01K5Z9Q8M4T6V2X0Y7R3N1W5BC","iteration":0,"metrics":{…},"links":{…},…}
id: 3.0

event: progress
data: {"rev":5,"status":"running","progress":{"percent":4.0,"iteration":40,…},"metrics":{"sphericity":0.91,…},…}
id: 5.0

: still here

event: done
data: {"id":"job_01K5Z9Q8M4T6V2X0Y7R3N1W5BC","status":"successful","done":true,"rev":88,…}
id: 88.1000.done
"""


@router.get(
    "/v1/jobs/{job_id}/events",
    operation_id="followJob",
    summary="Follow a job as it runs",
    response_class=Response,
    responses={
        HTTPStatus.OK: {
            "description": "`status` (the whole job), `snapshot`, `progress` (twice a second at most), and as the last "
            "`done` (the whole job), or `gone` (a problem) if the job is deleted meanwhile. A comment every 15 s while "
            "there is nothing to tell.",
            "content": {KIND: {"schema": {"type": "string"}, "example": EXAMPLE}},
        },
        HTTPStatus.NO_CONTENT: {
            "description": "`done` was told already: an EventSource then stops coming back."
        },
        **doc.problems("not-found", "gone", "invalid-parameters", *doc.STORES),
    },
)
async def follow_job(
    request: Request,
    context: Context,
    job_id: JobId,
    _: Annotated[
        str | None,
        Header(
            alias="Last-Event-ID", description="The last id that was seen; browsers send it by themselves."
        ),
    ] = None,
) -> Response:
    """Return the job's life as server-sent events: `curl -N …/events`, or an `EventSource`.

    Every event has an id. Whoever comes back with `Last-Event-ID` is told the present status, then every snapshot
    since. The stream goes on while the job store is restarted, and ends when the service is; come back to go on.
    """
    since = last_event_id(request)
    job = await to_thread.run_sync(context.stores.jobs.get, job_id)
    if job.status.done and was_last(since):
        return Response(status_code=HTTPStatus.NO_CONTENT)
    if request.scope.get("head"):  # no body is sent: there is no end to wait for
        return Response(media_type=KIND, headers={"Cache-Control": "no-store"})
    teller = Teller(request.url.path, request.state.request_id, since)
    return EventStream(context.watch, job, teller)
