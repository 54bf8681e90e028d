"""A job as an answer."""

from __future__ import annotations

from http import HTTPStatus

from starlette.requests import Request
from starlette.responses import Response

from service.delivery import json_answer
from service.schemas import job_out
from service.snapshots import retry_after_s
from spherify.jobs.model import Job


def job_etag(job: Job) -> str:
    """Return the entity tag of a job: its revision, and its place in the queue, which moves without one."""
    position = "" if job.queue_position is None else f".{job.queue_position}"
    return f'W/"{job.rev}{position}"'


def job_answer(
    request: Request, job: Job, status: HTTPStatus = HTTPStatus.OK, headers: dict[str, str] | None = None
) -> Response:
    """Return a job, with where it is if it is new, and when to ask again while it is not done."""
    told = {} if job.status.done else {"Retry-After": str(retry_after_s(job))}
    if status == HTTPStatus.CREATED:
        told["Location"] = f"/v1/jobs/{job.id}"
    return json_answer(
        request, job_out(job), status=status, etag=job_etag(job), headers=told | (headers or {})
    )
