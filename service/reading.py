"""Reading jobs for all who ask at the same moment: whoever comes while the store is read waits for the next time.

The next reading begins after they have asked: nobody is shown a job older than what was answered to anybody before.
The store is asked once at a time, in one thread, for at most `MOST` jobs, so that what is held does not grow with the
number of different jobs that are asked for.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import dataclass, field
from functools import partial
from typing import Final

from service.job_answers import JobDocuments
from spherify.jobs.errors import JobsError
from spherify.jobs.model import Job
from spherify.jobs.ports import JobStore

MOST: Final = 200
"""Jobs in one reading."""

_Done = asyncio.Future[dict[str, Job | JobsError]]


@dataclass(eq=False, slots=True)
class _Reading:
    """Jobs that are read together, and what was found of each."""

    known: dict[str, Job | None] = field(default_factory=dict)
    found: Mapping[str, Job | BaseException] = field(default_factory=dict)
    over: asyncio.Event = field(default_factory=asyncio.Event)


class JobReader:
    """Reads jobs; lives in one event loop.

    Args:
        jobs: where they are.
        documents: which of them are known, and are not read again unless they have changed.

    """

    def __init__(self, jobs: JobStore, documents: JobDocuments) -> None:
        self._jobs = jobs
        self._documents = documents
        self._coming = deque([_Reading()])  # the last one takes in who asks
        self._busy = False
        # Of its own: whatever else is slow does not hold this up; and a hop to it costs half of one to those of anyio.
        self._thread = ThreadPoolExecutor(1, "jobs")

    async def get(self, job_id: str) -> Job:
        """Return a job as it is after this was asked; raises as `JobStore.get` does."""
        if len(self._coming[-1].known) >= MOST:
            self._coming.append(_Reading())
        reading = self._coming[-1]
        reading.known.setdefault(job_id, self._documents.job(job_id))
        if not self._busy:
            self._begin()
        await reading.over.wait()
        found = reading.found[job_id]
        if isinstance(found, BaseException):
            raise copy(found) from found  # it is told to many, and gathers a traceback each time
        return found

    def _begin(self) -> None:
        reading = self._coming.popleft()
        if not self._coming:
            self._coming.append(_Reading())
        self._busy = True
        run = asyncio.get_running_loop().run_in_executor
        run(self._thread, self._jobs.get_all, reading.known).add_done_callback(partial(self._end, reading))

    def _end(self, reading: _Reading, done: _Done) -> None:
        error = done.exception()
        reading.found = done.result() if error is None else dict.fromkeys(reading.known, error)
        reading.over.set()
        self._busy = False
        if self._coming[0].known:
            self._begin()
        for job in reading.found.values():
            if isinstance(job, Job):
                self._documents.keep(job)
