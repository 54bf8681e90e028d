"""Find again what was lost: records, dead leases, messages that vanished, files nobody finished.

Runs in every process that may, the API's and the workers', of which one at a time leads. It needs the records, the
files and the queue only, not a working consumer. A scan does a bounded amount of work, but for a rebuild after a loss
of everything; and what goes wrong with one job, or in one part of it, is not in the way of the others.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from spherify.jobs.errors import JobGoneError, JobNotFoundError, StorageFullError, StoreUnavailableError
from spherify.jobs.finish import finish
from spherify.jobs.inventory import Inventory
from spherify.jobs.orphans import Orphans
from spherify.jobs.rebuild import rebuild
from spherify.jobs.settle import settle
from spherify.jobs.stock import Stock

SCRATCH_S: Final = 24 * 3600.0  # longer than any upload
_SWEEP_S: Final = 600.0
_LOST: Final = 1000  # jobs freed in one scan; the next one goes on
_SETTLED: Final = 100  # jobs settled in one scan, and jobs ended
log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Scan:
    """What one scan did.

    Attributes:
        lost: sent again because their lease ran out.
        orphans: sent again because no queue held them.
        ended: not to be computed any more, and nobody was at it: cancelled, or lost too often.
        settled: ended or deleted by somebody who did not bring their files to their last state.
        restored: jobs and meshes whose records were missing while others were there.
        swept: unfinished files that were removed.

    """

    lost: tuple[str, ...]
    orphans: tuple[str, ...]
    ended: tuple[str, ...]
    settled: tuple[str, ...]
    restored: tuple[str, ...]
    swept: tuple[str, ...]


class Reconciler:
    """Scans, remembering from one to the next what was missing."""

    def __init__(self, stock: Stock, *, orphan_s: float) -> None:
        self._stock = stock
        self._orphans = Orphans(stock.jobs, stock.queue, orphan_s=orphan_s)
        self._inventory = Inventory(stock)
        self._settled_to = ""
        self._swept_at = float("-inf")
        self._amnesty = 0

    def after_outage(self) -> None:
        """Say that the server was away for so long that leases ran out because nobody could renew them.

        The next scan frees no job: workers that hold one get the time to say so, or to hand it on. The one after
        frees those that nobody spoke for, and counts no loss: it was not they who lost their workers.
        """
        self._amnesty = 2

    def scan(self, still: Callable[[], object] = lambda: None) -> Scan:
        """Look once; raises `StoreUnavailableError`, after which the next scan makes up for it.

        Args:
            still: called again and again while a rebuild takes its time.

        """
        rebuild(self._stock, still)
        waits, counted = self._amnesty == 2, self._amnesty == 0
        self._amnesty = max(self._amnesty - 1, 0)
        return Scan(
            lost=() if waits else _part("lost", lambda: self._send_lost(counted=counted)),
            orphans=_part("orphan", self._send_orphans),  # what needs the files comes later: they may be away
            ended=() if waits else _part("finish", self._finish),
            settled=_part("settle", self._settle),
            restored=_part("inventory", self._inventory.look),
            swept=_part("sweep", self._sweep),
        )

    def _send_lost(self, *, counted: bool) -> tuple[str, ...]:
        lost = tuple(self._stock.jobs.lost(_LOST, counted=counted))
        for job_id in lost:
            log.warning("its lease ran out: sent again", extra={"job_id": job_id, "action": "reconcile-lost"})
            self._stock.queue.send(job_id, ahead=True)
        return lost

    def _finish(self) -> tuple[str, ...]:
        """End what lost its lease and was not sent again."""
        overdue = self._stock.jobs.overdue(_SETTLED)
        return tuple(job_id for job_id in overdue if _tried(job_id, "finish", self._finish_one))

    def _finish_one(self, job_id: str) -> None:
        finish(self._stock.jobs, self._stock.blobs, job_id)

    def _send_orphans(self) -> tuple[str, ...]:
        orphans = self._orphans.look()
        for job_id in orphans:
            log.warning(
                "waiting, and in no queue: sent again", extra={"job_id": job_id, "action": "reconcile-orphan"}
            )
            self._stock.queue.send(job_id, ahead=True)
        return orphans

    def _settle(self) -> tuple[str, ...]:
        """Settle the next jobs in order of their ids; after the last one it begins anew."""
        ids = self._stock.jobs.unsettled(_SETTLED, after=self._settled_to)
        self._settled_to = ids[-1] if len(ids) == _SETTLED else ""
        return tuple(job_id for job_id in ids if _tried(job_id, "settle", self._settle_one))

    def _settle_one(self, job_id: str) -> None:
        settle(self._stock.jobs, self._stock.blobs, job_id)
        log.info(
            "ended or deleted: its files are settled", extra={"job_id": job_id, "action": "reconcile-settle"}
        )

    def _sweep(self) -> tuple[str, ...]:
        now = time.monotonic()
        if now - self._swept_at < _SWEEP_S:
            return ()
        self._swept_at = now
        return sweep_scratch(self._stock.blobs.scratch().iterdir(), SCRATCH_S)


def _part(action: str, do: Callable[[], tuple[str, ...]]) -> tuple[str, ...]:
    """Do one part of a scan; its trouble is logged, and is not the others'."""
    try:
        return do()
    except StoreUnavailableError:  # everybody's trouble
        raise
    except Exception:  # whatever it is, the other parts are not to wait for it; the trace goes to the log
        log.exception("a part of the scan failed", extra={"action": f"reconcile-{action}"})
        return ()


def _tried(name: str, action: str, do: Callable[[str], None]) -> bool:
    """Do something to one job or mesh; its trouble is logged, and is not the others'."""
    extra = {"job_id": name, "action": f"reconcile-{action}"}
    try:
        do(name)
    except StoreUnavailableError:  # everybody's trouble
        raise
    except (StorageFullError, JobNotFoundError, JobGoneError, OSError) as e:
        log.warning("not done, and tried again: %s", e, extra=extra)
        return False
    except Exception:  # a file or record of another form than ours; the trace goes to the log
        log.exception("not done, and tried again", extra=extra)
        return False
    return True


def sweep_scratch(files: Iterable[Path], older_than_s: float) -> tuple[str, ...]:
    """Remove unfinished files that nothing has written to for that long; returns their names."""
    old = time.time() - older_than_s
    swept = []
    for path in files:
        try:
            if path.stat().st_mtime < old:
                path.unlink()
                swept.append(path.name)
        except FileNotFoundError:
            continue  # somebody was quicker
    return tuple(swept)
