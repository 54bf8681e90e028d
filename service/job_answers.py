"""A job as an answer."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from functools import partial
from http import HTTPStatus
from typing import Final

from starlette.requests import Request
from starlette.responses import Response

from service.delivery import json_answer, json_text
from service.schemas import job_out
from service.snapshots import retry_after_s
from spherify.jobs.model import Job

MOST_BYTES: Final = 3 * 1024 * 1024  # of documents, and of the jobs they are of: some 200 of eight snapshots
_SNAPSHOT_BYTES: Final = 2048  # one takes in memory, about


class JobDocuments:
    """The jobs that were asked for last and their documents, which are made again only when the job is another.

    A poll of what has not changed then costs one question to the store, and no reading and writing of JSON.
    Belongs to one thread.

    Args:
        most_bytes: of memory, about.

    """

    def __init__(self, most_bytes: int = MOST_BYTES) -> None:
        self._most_bytes = most_bytes
        self._bytes = 0
        self._documents: OrderedDict[str, tuple[Job, bytes]] = OrderedDict()  # used last, thrown away last

    def job(self, job_id: str) -> Job | None:
        """Return a job as it was when it was last asked for."""
        found = self._documents.get(job_id)
        return None if found is None else found[0]

    def keep(self, job: Job) -> None:
        """Remember a job as it was just read, perhaps for somebody who has its document."""
        if self.job(job.id) is not job:
            self._put(job, b"")

    def document(self, job: Job) -> bytes:
        """Return the JSON of a job."""
        found = self._documents.get(job.id)
        if found is not None and found[0] is job and found[1]:
            self._documents.move_to_end(job.id)
            return found[1]
        text = json_text(job_out(job))
        self._put(job, text)
        return text

    def _put(self, job: Job, text: bytes) -> None:
        if job.id in self._documents:
            self._forget(job.id)
        self._documents[job.id] = job, text
        self._bytes += _size(job, text)
        while self._bytes > self._most_bytes:
            self._forget(next(iter(self._documents)))

    def _forget(self, job_id: str) -> None:
        self._bytes -= _size(*self._documents.pop(job_id))


def _size(job: Job, text: bytes) -> int:
    return len(text) + _SNAPSHOT_BYTES * (1 + len(job.snapshots))


def job_etag(job: Job) -> str:
    """Return the entity tag of a job: its revision, and its place in the queue, which moves without one.

    A strong one, which `If-Match` takes: what a document says changes with them alone.
    """
    position = "" if job.queue_position is None else f".{job.queue_position}"
    return f'"{job.rev}{position}"'


def job_answer(
    request: Request,
    job: Job,
    status: HTTPStatus = HTTPStatus.OK,
    headers: dict[str, str] | None = None,
    *,
    document: Callable[[Job], bytes] = lambda job: json_text(job_out(job)),
) -> Response:
    """Return a job, with where it is if it is new, and when to ask again while it is not done."""
    told = {} if job.status.done else {"Retry-After": str(retry_after_s(job))}
    if status == HTTPStatus.CREATED:
        told["Location"] = f"/v1/jobs/{job.id}"
    return json_answer(
        request,
        partial(document, job),
        status=status,
        etag=job_etag(job),
        headers=told | (headers or {}),
    )
