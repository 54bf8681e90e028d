"""Find again what was lost: dead leases, messages that vanished, files nobody finished.

Runs in every worker, of which one at a time leads. It needs the records and the queue only, not
a working consumer.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from spherify.jobs.errors import JobNotFoundError, StorageFullError, StoreUnavailableError
from spherify.jobs.orphans import Orphans
from spherify.jobs.ports import BlobStore, JobQueue, JobStore
from spherify.jobs.settle import settle

SCRATCH_S: Final = 24 * 3600.0  # longer than any upload
_SWEEP_S: Final = 600.0
_LOST: Final = 1000  # jobs freed in one scan; the next one goes on
_SETTLED: Final = 100  # jobs settled in one scan
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
        self._orphans = Orphans(jobs, queue, orphan_s=orphan_s)
        self._settled_to = ""
        self._swept_at = float("-inf")

    def scan(self) -> Scan:
        """Look once; raises `StoreUnavailableError`, after which the next scan makes up for it."""
        lost = self._jobs.lost(_LOST)
        for job_id in lost:
            log.warning("its lease ran out: sent again", extra={"job_id": job_id, "action": "reconcile-lost"})
            self._queue.send(job_id)
        orphans = self._orphans.look()
        for job_id in orphans:
            log.warning(
                "waiting, and in no queue: sent again", extra={"job_id": job_id, "action": "reconcile-orphan"}
            )
            self._queue.send(job_id)
        return Scan(tuple(lost), orphans, self._settle(), self._sweep())

    def _settle(self) -> tuple[str, ...]:
        """Settle the next jobs in order of their ids; after the last one it begins anew."""
        ids = self._jobs.unsettled(_SETTLED, after=self._settled_to)
        self._settled_to = ids[-1] if len(ids) == _SETTLED else ""
        return tuple(job_id for job_id in ids if _tried(job_id, "settle", self._settle_one))

    def _settle_one(self, job_id: str) -> None:
        settle(self._jobs, self._blobs, job_id)
        log.info(
            "ended or deleted: its files are settled", extra={"job_id": job_id, "action": "reconcile-settle"}
        )

    def _sweep(self) -> int:
        now = time.monotonic()
        if now - self._swept_at < _SWEEP_S:
            return 0
        self._swept_at = now
        return sweep_scratch(self._blobs.scratch().iterdir(), SCRATCH_S)


def _tried(name: str, action: str, do: Callable[[str], None]) -> bool:
    """Do something to one job or mesh; its trouble is logged, and is not the others'."""
    extra = {"job_id": name, "action": f"reconcile-{action}"}
    try:
        do(name)
    except StoreUnavailableError:  # everybody's trouble
        raise
    except (StorageFullError, JobNotFoundError, OSError) as e:
        log.warning("not done, and tried again: %s", e, extra=extra)
        return False
    except Exception:  # a file or record of another form than ours; the trace goes to the log
        log.exception("not done, and tried again", extra=extra)
        return False
    return True


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
