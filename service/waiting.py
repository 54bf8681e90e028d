"""Long answers: `?wait=` on a job, and `Prefer: wait=` (RFC 7240) on what makes one."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable
from http import HTTPStatus
from typing import TYPE_CHECKING, Annotated, Final

from anyio import to_thread
from fastapi import Depends, Header, Query
from starlette.requests import Request
from starlette.responses import Response

from service.job_answers import job_answer
from service.repeats import REPLAYED
from spherify.jobs.errors import JobGoneError, JobsError

if TYPE_CHECKING:
    from service.context import Services
    from service.watch import Watch
    from spherify.jobs.model import Job

MAX_WAIT_S: Final = 60
_WAIT: Final = re.compile(r"(?:^|[,;\s])wait\s*=\s*(\d{1,6})\s*(?:$|[,;])")

Wait = Annotated[
    float,
    Query(
        ge=0,
        le=MAX_WAIT_S,
        description="Seconds to wait for the end of the job, or for a change since the ETag.",
    ),
]


async def _prefer(
    _: Annotated[
        str | None,
        Header(
            alias="Prefer",
            description=f"`wait=20`: answer once the job is done, or after so many seconds, {MAX_WAIT_S} at most.",
        ),
    ] = None,
) -> None:
    """Describe the header; `after_waiting` reads it, and what it does not know it ignores as RFC 7240 wants."""


PREFER: Final = Depends(_prefer)


async def awaited(watch: Watch, job: Job, wait_s: float, enough: Callable[[Job], bool]) -> Job:
    """Return a job as soon as it is as wanted, or as it is when the time is up or the service stops.

    Raises:
        JobGoneError: it was deleted meanwhile.

    """
    clock = asyncio.get_running_loop().time
    until = clock() + wait_s
    with watch.following(job) as following:
        while not enough(following.sight.job) and not following.over and clock() < until:
            await following.other_than(following.sight, until - clock())
            if following.sight.gone:
                raise JobGoneError(f"{job.id} was deleted")
        return following.sight.job


async def after_waiting(request: Request, services: Services, answer: Response) -> Response:
    """Return the answer that made a job, or one with the job as it is later, if the client prefers to wait."""
    asked = _WAIT.search(", ".join(request.headers.getlist("prefer")))
    if asked is None or answer.status_code != HTTPStatus.CREATED:
        return answer
    wait_s = min(int(asked[1]), MAX_WAIT_S)
    try:
        job = await to_thread.run_sync(
            services.stores.jobs.get, answer.headers["Location"].rpartition("/")[2]
        )
        job = await awaited(services.watch, job, wait_s, lambda seen: seen.status.done)
    except JobsError:  # it was made, and that is what is answered
        return answer
    headers = {"Preference-Applied": f"wait={wait_s}"}
    if REPLAYED in answer.headers:
        headers[REPLAYED] = answer.headers[REPLAYED]
    return job_answer(request, job, HTTPStatus.CREATED, headers)
