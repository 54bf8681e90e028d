"""/v1/jobs/{job_id}/extend and /v1/jobs/{job_id}/retry."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from http import HTTPStatus
from typing import Any, Final

from anyio import to_thread
from fastapi import APIRouter, Request, Response

from service import documentation as doc
from service.context import Context, Services
from service.extending import parse_extension
from service.forms import media_type
from service.identifiers import JobId
from service.job_answers import job_answer
from service.problems import ProblemError, invalid
from service.queries import KNOWN_QUERY
from service.repeats import IDEMPOTENT, Identity, once
from service.schemas import JobOut
from service.uploads import KIB, small_body
from service.waiting import PREFER, after_waiting
from spherify.geometry.errors import InvalidConfigError
from spherify.jobs.continuation import extension, last_iteration, repetition, submit_continuation
from spherify.jobs.errors import BlobNotFoundError, DamagedBlobError
from spherify.jobs.model import Job, JobSpec
from spherify.parameters import MAX_ITERATIONS

router = APIRouter(prefix="/v1/jobs/{job_id}", tags=["Jobs"], dependencies=[KNOWN_QUERY, IDEMPOTENT, PREFER])
log = logging.getLogger(__name__)
MAX_JSON_BYTES: Final = 64 * KIB
CREATED: Final = "The new job, with `parent_id`; it begins with the parent's states and figures."


def _responses(*slugs: str) -> doc.Responses:
    return {
        HTTPStatus.CREATED: {"description": CREATED, "headers": doc.LOCATION | doc.RETRY_AFTER},
        **doc.problems(
            *slugs,
            "not-found",
            "gone",
            "job-not-finished",
            "job-cannot-go-on",
            "invalid-parameters",
            "storage-full",
            *doc.FILES,
            *doc.REPEATS,
            *doc.STORES,
        ),
    }


_EXTEND: Final[dict[str, Any]] = {
    "requestBody": {
        "required": True,
        "content": {"application/json": {"schema": {"$ref": "#/components/schemas/ExtendRequest"}}},
    }
}


@router.post(
    "/extend",
    operation_id="extendJob",
    summary="Go on where a job ended",
    status_code=HTTPStatus.CREATED,
    response_model=JobOut,
    responses=_responses("malformed-json", "unsupported-media-type", "upload-too-large", "request-timeout"),
    openapi_extra=_EXTEND,
)
async def extend_job(request: Request, context: Context, job_id: JobId) -> Response:
    """Make a job that goes on from the last state of a finished one, for more iterations.

    `curl --json '{"iterations": 1000}' …/extend`. What comes out is, bit for bit, what one longer run would have
    given. A job that ended by itself (converged, stalled, collapsed) cannot be extended: it would end there again.
    Where another version of the mathematics is installed by now, the new job is computed from its beginning: no run is
    of two versions.
    """
    if media_type(request) != "application/json":
        raise ProblemError("unsupported-media-type", f"send application/json, not {media_type(request)!r}")
    text = await small_body(request, MAX_JSON_BYTES, context.settings.upload_timeout_s)
    asked = parse_extension(text)

    def plan(parent: Job, identity: str) -> JobSpec:
        total = last_iteration(parent) + asked.iterations
        most = min(context.settings.max_iterations, MAX_ITERATIONS)
        if total > most:
            raise invalid("#/iterations", "too-many", f"at most {most} altogether, not {total}")
        try:
            return extension(parent, identity, asked.iterations, asked.snapshots)
        except InvalidConfigError as e:
            raise invalid("#/snapshots", "plan", str(e)) from e

    return await _continue(request, context, job_id, asked.model_dump(), plan)


@router.post(
    "/retry",
    operation_id="retryJob",
    summary="Try a failed or cancelled job again",
    status_code=HTTPStatus.CREATED,
    response_model=JobOut,
    responses=_responses(),
)
async def retry_job(request: Request, context: Context, job_id: JobId) -> Response:
    """Make a job with the same parameters that goes on from the last state of a failed or cancelled one.

    From its beginning where another version of the mathematics is installed by now.
    """
    return await _continue(request, context, job_id, None, repetition)


async def _continue(
    request: Request,
    services: Services,
    job_id: str,
    content: Any,  # noqa: ANN401 (whatever JSON holds)
    plan: Callable[[Job, str], JobSpec],
) -> Response:
    stores = services.stores

    def submit(identity: Identity) -> Job:
        parent = stores.jobs.get(job_id)
        spec = replace(plan(parent, identity.job_id), request=identity.request)
        try:
            job = submit_continuation(stores.jobs, stores.blobs, stores.queue, parent, spec)
        except BlobNotFoundError as e:
            stores.jobs.get(job_id)  # it may have been deleted meanwhile
            raise DamagedBlobError(f"a state of {job_id} is missing: delete the job and send it again") from e
        log.info("goes on from %s", job_id, extra={"action": "submit", "job_id": job.id})
        return job

    async def act(identity: Identity) -> Response:
        return job_answer(request, await to_thread.run_sync(submit, identity), HTTPStatus.CREATED)

    answer = await once(request, stores.repeats, content, act, jobs=stores.jobs)
    return await after_waiting(request, services, answer)
