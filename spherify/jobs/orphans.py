"""Find waiting jobs whose message is lost: the queue is only a hint, and a broker may drop what it holds.

A message may be gone from the queue because a worker died with it before it could claim its job, or because the
broker lost it. What has been delivered does not count as there: a worker that lives claims within a moment, and then
the job waits no longer.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final

from spherify.jobs.ports import JobQueue, JobStore

SLICE: Final = 1000  # messages read in one look, however long the queue is
MOST: Final = 1000  # jobs judged in one round, the oldest


class Orphans:
    """Reads the queue slice by slice; a round is over when it has seen the oldest message.

    Slices go from the newest message to the oldest: what is sent meanwhile moves the others away from the place
    reached, so that none is passed over. What a whole round did not see twice in a row is lost.
    """

    def __init__(
        self,
        jobs: JobStore,
        queue: JobQueue,
        *,
        orphan_s: float,
        slice_: int = SLICE,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._jobs = jobs
        self._queue = queue
        self._orphan_s = orphan_s
        self._slice = slice_
        self._clock = clock
        self._missing: frozenset[str] = frozenset()
        self._begin()

    def look(self) -> tuple[str, ...]:
        """Read the next slice; returns the jobs that a round's end shows to be lost, to be sent again."""
        read = self._queue.pending(self._place, self._slice)
        self._seen.update(read)
        self._place += len(read)
        if len(read) == self._slice:
            return ()
        # After the queue, so that a job taken in between is in neither list rather than in the wrong one.
        waiting = self._jobs.waiting(self._orphan_s + self._clock() - self._began, MOST)
        missing = frozenset(waiting) - self._seen
        orphans = missing & self._missing
        self._missing = missing - orphans
        self._begin()
        return tuple(sorted(orphans))

    def _begin(self) -> None:
        self._began = self._clock()
        self._place = 0
        self._seen: set[str] = set()
