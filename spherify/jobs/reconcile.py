"""Find again what was lost: dead leases, messages that vanished, files nobody finished.

Runs in every worker, of which one at a time leads. It needs the records and the queue only, not
a working consumer.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from spherify.jobs.errors import JobNotFoundError, StorageFullError
from spherify.jobs.ports import BlobStore, JobQueue, JobStore
from spherify.jobs.settle import settle

SCRATCH_S: Final = 24 * 3600.0  # longer than any upload
_SWEEP_S: Final = 600.0
log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Scan:
    """What one scan did.

    Attributes:
        lost: sent again because their lease ran out.
        orphans: sent again because no queue held them.
        settled: ended or deleted by somebody who did not bring their files to their last state.
        swept: how many unfinished files were removed.

    """

    lost: tuple[str, ...]
    orphans: tuple[str, ...]
    settled: tuple[str, ...]
    swept: int


class Reconciler:
    """Scans, remembering from one to the next which waiting jobs were missing in the queue."""

    def __init__(self, jobs: JobStore, queue: JobQueue, blobs: BlobStore, *, orphan_s: float) -> None:
        self._jobs = jobs
        self._queue = queue
        self._blobs = blobs
        self._orphan_s = orphan_s
        self._missing: frozenset[str] = frozenset()
        self._swept_at = float("-inf")

    def scan(self) -> Scan:
        """Look once; raises `StoreUnavailableError`, after which the next scan makes up for it."""
        lost = self._jobs.lost()
        for job_id in lost:
            log.warning("its lease ran out: sent again", extra={"job_id": job_id, "action": "reconcile-lost"})
            self._queue.send(job_id)
        # In this order, so that a job taken in between is in neither list rather than in the wrong one.
        pending = self._queue.pending()
        waiting = frozenset(self._jobs.waiting(self._orphan_s))
        missing = waiting - pending - frozenset(lost)
        orphans = tuple(sorted(missing & self._missing))
        for job_id in orphans:
            log.warning(
                "waiting, and in no queue: sent again", extra={"job_id": job_id, "action": "reconcile-orphan"}
            )
            self._queue.send(job_id)
        self._missing = missing - frozenset(orphans)
        return Scan(tuple(lost), orphans, self._settle(), self._sweep())

    def _settle(self) -> tuple[str, ...]:
        settled = []
        for job_id in self._jobs.unsettled():
            extra = {"job_id": job_id, "action": "reconcile-settle"}
            try:
                settle(self._jobs, self._blobs, job_id)
            except (StorageFullError, JobNotFoundError, OSError) as e:  # one job's trouble is not the others'
                log.warning("not settled: %s", e, extra=extra)
                continue
            log.info("ended or deleted: its files are settled", extra=extra)
            settled.append(job_id)
        return tuple(settled)

    def _sweep(self) -> int:
        now = time.monotonic()
        if now - self._swept_at < _SWEEP_S:
            return 0
        self._swept_at = now
        return sweep_scratch(self._blobs.scratch().iterdir(), SCRATCH_S)


def sweep_scratch(files: Iterable[Path], older_than_s: float) -> int:
    """Remove unfinished files that nothing has written to for that long; returns how many."""
    old = time.time() - older_than_s
    swept = 0
    for path in files:
        try:
            if path.stat().st_mtime < old:
                path.unlink()
                swept += 1
        except FileNotFoundError:
            continue  # somebody was quicker
    return swept
