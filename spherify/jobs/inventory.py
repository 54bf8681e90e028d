"""Compare the files with the records, a slice at a time: what a rebuild would restore, and what nobody owns.

A server can lose some records and keep the others: a replica takes over that was behind, or an older copy is put back.
And whoever writes files before records may die in between. What is seen without a record in two rounds is restored, if
there is enough of it; if not, it is removed when it is old. What is there and cannot be read is told of, and left.
"""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Final

from spherify.jobs import layout
from spherify.jobs.errors import StoreUnavailableError
from spherify.jobs.rebuild import UNREADABLE, Stock, named, restore_job, restore_mesh
from spherify.jobs.settle import remove_folder

SLICE: Final = 200  # folders in one look
ROUND_S: Final = 60.0  # from the beginning of one round to that of the next, at least
ORPHAN_S: Final = 24 * 3600.0
log = logging.getLogger(__name__)


class Inventory:
    """Goes through meshes, jobs and tombstones, round after round."""

    def __init__(
        self, stock: Stock, *, slice_: int = SLICE, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._stock = stock
        self._slice = slice_
        self._clock = clock
        self._meshes: deque[str] = deque()
        self._jobs: deque[str] = deque()
        self._missing: set[str] = set()  # without a record in the last round
        self._seen: set[str] = set()  # without a record in this one
        self._unreadable: set[str] = set()  # and told of: once by each process
        self._begun = float("-inf")

    def look(self) -> tuple[str, ...]:
        """Compare the next slice; returns what was restored."""
        if not self._meshes and not self._jobs and not self._begin():
            return ()
        meshes, jobs = self._next(self._meshes), self._next(self._jobs)
        return (
            *self._compare(self._stock.meshes.unknown(meshes), layout.mesh_folder, restore_mesh),
            *self._compare(self._stock.jobs.unknown(jobs), layout.job_folder, restore_job),
        )

    def _begin(self) -> bool:
        if self._clock() - self._begun < ROUND_S:
            return False
        self._begun = self._clock()
        self._missing, self._seen = self._seen, set()
        blobs = self._stock.blobs
        self._meshes.extend(blobs.folders(layout.meshes()))
        self._jobs.extend(blobs.folders(layout.jobs()))
        for stat in list(blobs.list(layout.tombstones())):
            if stat.created_at < time.time() - layout.TOMBSTONE_S:
                blobs.delete(stat.key)
        return True

    def _next(self, names: deque[str]) -> list[str]:
        return [names.popleft() for _ in range(min(self._slice, len(names)))]

    def _compare(
        self, unknown: Sequence[str], folder: Callable[[str], str], restore: Callable[[Stock, str], bool]
    ) -> list[str]:
        restored = []
        for name in unknown:
            if name not in self._missing:  # it may be on its way
                self._seen.add(name)
            elif self._restored(name, folder(name), restore):
                restored.append(name)
        return restored

    def _restored(self, name: str, folder: str, restore: Callable[[Stock, str], bool]) -> bool:
        """Restore what was without a record in two rounds; what cannot be is removed when it is old."""
        extra = named(name, "inventory")
        try:
            if restore(self._stock, name):
                log.warning("its record was lost: restored from its files", extra=extra)
                return True
        except StoreUnavailableError:
            raise
        except UNREADABLE:  # and not removed: it may be all that is left
            if name not in self._unreadable:
                log.exception("its record was lost, and its files cannot be read", extra=extra)
            self._unreadable.add(name)
        else:
            if (removed := self._remove_old(folder)) > 0:
                log.warning("%d files that belong to nothing: removed", removed, extra=extra)
                return False
        self._seen.add(name)
        return False

    def _remove_old(self, folder: str) -> int:
        """Remove what nobody has written to for a day."""
        newest = max((stat.created_at for stat in self._stock.blobs.list(folder)), default=0.0)
        return remove_folder(self._stock.blobs, folder) if newest < time.time() - ORPHAN_S else 0
