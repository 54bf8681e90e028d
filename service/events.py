"""A job's life as server-sent events, so that a page need not ask.

    status     the whole job: first of all, and whenever its status or attempt changes
    snapshot   a state is kept: its figures and links; every one once, also those kept before
    progress   revision, status, progress, place in the queue and figures, twice a second at most
    done       the whole job, ended: the last event
    gone       a problem document: the job was deleted; the last event

An event's id is ``{revision}.{greatest iteration told}``, with ``.done`` at the end. Within an attempt snapshots are
kept in ascending order, the best one found in hindsight excepted: whoever comes back with an id is told everything
above that iteration, and the exception once more.
"""

from __future__ import annotations

import json
import re
import time
from collections.abc import AsyncIterator, Callable
from typing import Final

from fastapi.sse import EventSourceResponse, format_sse_event
from starlette.requests import Request
from starlette.types import Receive, Scope, Send

from service.problems import ProblemError
from service.schemas import Answer, FiguresOut, ProgressOut, QueueOut, job_out, snapshot_out
from service.watch import Following, Sight, Watch
from spherify.jobs.model import Job, JobStatus, Snapshot

RETRY_MS: Final = 1000
HEARTBEAT_S: Final = 15.0
PROGRESS_S: Final = 0.5
_ID: Final = re.compile(r"\d{1,16}\.(-1|\d{1,9})(\.done)?")
_DONE: Final = ".done"


class ProgressEvent(Answer):
    """What changes while a job runs."""

    rev: int
    status: JobStatus
    progress: ProgressOut
    queue: QueueOut
    metrics: FiguresOut | None


class EventStream(EventSourceResponse):
    """The answer: a stream of events over the job's life, or over what is left of it for whoever comes back."""

    def __init__(self, watch: Watch, job: Job, teller: Teller) -> None:
        # FastAPI's own generator routes answer 200 before they look; here 204, 404 and 410 come first.
        super().__init__((), headers={"Cache-Control": "no-store", "X-Accel-Buffering": "no"})
        self._watch = watch
        self._job = job
        self._teller = teller

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Tell until the end, the client's leaving included."""
        with self._watch.following(self._job) as following:
            self.body_iterator = stream(following, self._teller)
            await super().__call__(scope, receive, send)


def last_event_id(request: Request) -> str | None:
    """Return the id a client comes back with, None if it has none of ours."""
    given = request.headers.get("last-event-id", "")
    return given if _ID.fullmatch(given) else None


def was_last(event_id: str | None) -> bool:
    """Whether an id is that of `done`: there is nothing more to tell."""
    return event_id is not None and event_id.endswith(_DONE)


class Teller:
    """Tells one client what it has not been told yet.

    Args:
        instance: path of the request, for problem documents.
        request_id: of the request.
        since: the last event's id that the client has had.

    """

    def __init__(self, instance: str, request_id: str, since: str | None) -> None:
        self._instance = instance
        self._request_id = request_id
        self._upto = -1 if since is None else int(since.split(".")[1])
        self._resumed = self._upto
        self._told: set[int] = set()
        self._state: tuple[JobStatus, int] | None = None
        self._rev = 0
        self._progress: str | None = None
        self._progress_at = float("-inf")
        self.due = float("inf")  # when there will be something to tell even if nothing more happens

    def news(self, sight: Sight, now: float) -> tuple[list[bytes], bool]:
        """Return the events of what is new at a time, in seconds, and whether they are the last."""
        job = sight.job
        self._rev = job.rev
        events = []
        if (job.status, job.attempt) != self._state:
            self._state = (job.status, job.attempt)
            events.append(self._event("status", sight.once("job", _whole)))
            self._progress, self._progress_at = sight.once("progress", _progress), now
        for snapshot in job.snapshots:
            if self._untold(job, snapshot.iteration):
                self._told.add(snapshot.iteration)
                self._upto = max(self._upto, snapshot.iteration)
                make = _snapshot_of(snapshot)
                events.append(self._event("snapshot", sight.once(f"snapshot {snapshot.iteration}", make)))
        if job.status.done:
            events.append(self._event("done", sight.once("job", _whole), _DONE))
        elif sight.gone:
            events.append(self._event("gone", self._gone(job), _DONE))
        else:
            events += self._tell_progress(sight, now)
        return events, job.status.done or sight.gone

    def _tell_progress(self, sight: Sight, now: float) -> list[bytes]:
        progress = sight.once("progress", _progress)
        self.due = float("inf")
        if progress == self._progress:
            return []
        if now - self._progress_at < PROGRESS_S:
            self.due = self._progress_at + PROGRESS_S
            return []
        self._progress, self._progress_at = progress, now
        return [self._event("progress", progress)]

    def _untold(self, job: Job, iteration: int) -> bool:
        if iteration in self._told:
            return False
        return iteration > self._resumed or iteration not in job.spec.snapshots_requested

    def _event(self, name: str, data: str, end: str = "") -> bytes:
        return format_sse_event(event=name, data_str=data, id=f"{self._rev}.{self._upto}{end}")

    def _gone(self, job: Job) -> str:
        problem = ProblemError("gone", f"{job.id} was deleted")
        return json.dumps(problem.document(self._instance, self._request_id))


async def stream(
    following: Following, teller: Teller, clock: Callable[[], float] = time.monotonic
) -> AsyncIterator[bytes]:
    """Yield events until the last one, or until the service stops: the client then comes back by itself."""
    yield format_sse_event(retry=RETRY_MS)
    spoke_at = clock()
    while True:
        sight, now = following.sight, clock()
        events, ended = teller.news(sight, now)
        if events:
            yield b"".join(events)
            spoke_at = now
        if ended or following.over:
            return
        if now - spoke_at >= HEARTBEAT_S:
            yield format_sse_event(comment="still here")
            spoke_at = now
        await following.other_than(sight, min(spoke_at + HEARTBEAT_S, teller.due) - now)


def _whole(job: Job) -> str:
    return job_out(job).model_dump_json(by_alias=True)


def _progress(job: Job) -> str:
    whole = job_out(job)
    return ProgressEvent(
        rev=job.rev, status=job.status, progress=whole.progress, queue=whole.queue, metrics=whole.metrics
    ).model_dump_json()


def _snapshot_of(snapshot: Snapshot) -> Callable[[Job], str]:
    return lambda job: snapshot_out(job.id, snapshot).model_dump_json()
