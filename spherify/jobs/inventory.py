"""Compare the files with the records, a slice at a time: what a rebuild would restore, and what nobody owns.

A server can lose some records and keep the others: a replica that was behind takes over, or an older copy is put back.
And a process that writes files before records may die in between. Files seen without a record in two rounds are
restored if there is enough of them; if not, they are removed once they are old. Files that cannot be read are reported
and left. The other way round, a job with a tombstone is deleted once more if an older copy brought its record back, and
so is a mesh that has no files, unless a job names it.
"""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import Final, ParamSpec, TypeVar

from spherify.jobs import layout
from spherify.jobs.delete import delete_job
from spherify.jobs.errors import JobNotFoundError, MeshInUseError, MeshNotFoundError, StoreUnavailableError
from spherify.jobs.ids import is_job_id, time_of
from spherify.jobs.model import Job
from spherify.jobs.ports import BlobStat
from spherify.jobs.restore import UNREADABLE, named, restore_deletion, restore_job, restore_mesh
from spherify.jobs.settle import remove_folder, settle
from spherify.jobs.stock import Stock

P = ParamSpec("P")
T = TypeVar("T")
SLICE: Final = 200  # folders in one look
TOMBSTONES: Final = 10  # for each folder: they cost no request for a file
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
        self._deleted: deque[BlobStat] = deque()
        self._stored: frozenset[str] = frozenset()  # meshes that have files, listed before their records are
        self._listing: Iterator[Sequence[str]] = iter(())  # of the records of meshes, a page at a time
        self._missing: set[str] = set()  # without a record, or files, in the last round
        self._seen: set[str] = set()  # without a record, or files, in this one
        self._unreadable: set[str] = set()  # and told of: once by each process
        self._begun = float("-inf")

    def look(self) -> tuple[str, ...]:
        """Compare the next slice; returns what was restored."""
        recorded = next(self._listing, None)
        if not (self._meshes or self._jobs or self._deleted or recorded) and not self._begin():
            return ()
        self._delete_again(self._next(self._deleted, TOMBSTONES))
        self._forget_empty([mesh_id for mesh_id in recorded or () if mesh_id not in self._stored])
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
        self._stored = frozenset(self._meshes)
        self._listing = self._recorded_meshes()
        self._jobs.extend(blobs.folders(layout.jobs()))
        for stat in list(blobs.list(layout.tombstones())):
            if stat.created_at < time.time() - layout.TOMBSTONE_S:
                self._tried(stat.key.rpartition("/")[2], self._let_go, stat)
            else:
                self._deleted.append(stat)
        return True

    def _next(self, left: deque[T], times: int = 1) -> list[T]:
        return [left.popleft() for _ in range(min(times * self._slice, len(left)))]

    def _delete_again(self, tombstones: Sequence[BlobStat]) -> None:
        """Have the records say what the tombstones do."""
        by_id = {stat.key.rpartition("/")[2]: stat for stat in tombstones}
        for job_id, found in self._stock.jobs.get_all(dict.fromkeys(by_id)).items():
            if isinstance(found, JobNotFoundError):
                self._tried(job_id, self._deleted_before, job_id, by_id[job_id])
            elif isinstance(found, Job) and found.status.done:  # else it is computed without files, and fails
                if job_id not in self._missing:  # it may be being deleted
                    self._seen.add(job_id)
                    continue
                self._tried(job_id, self._delete_once_more, job_id)

    def _delete_once_more(self, job_id: str) -> None:
        delete_job(self._stock.jobs, self._stock.blobs, job_id)
        log.warning("its record came back, and was deleted: deleted again", extra=named(job_id, "inventory"))

    def _let_go(self, tombstone: BlobStat) -> None:
        """Forget an old deletion."""
        # First what a deletion that was broken off may have left: without the mark the job would come back.
        remove_folder(self._stock.blobs, layout.job_folder(tombstone.key.rpartition("/")[2]))
        self._stock.blobs.delete(tombstone.key)

    def _tried(self, name: str, do: Callable[P, object], *args: P.args, **options: P.kwargs) -> None:
        """Do something; its trouble is logged, once by each process, and is not that of the others."""
        try:
            do(*args, **options)
        except StoreUnavailableError:
            raise
        except UNREADABLE:
            if name not in self._unreadable:
                log.exception("its files cannot be read", extra=named(name, "inventory"))
            self._unreadable.add(name)

    def _recorded_meshes(self) -> Iterator[Sequence[str]]:
        """Yield the meshes that have a record, a page at a time."""
        cursor: str | None = None
        while True:
            page = self._stock.meshes.find(limit=self._slice, cursor=cursor)
            yield [record.id for record in page.items]
            cursor = page.next_cursor
            if cursor is None:
                return

    def _forget_empty(self, mesh_ids: Sequence[str]) -> None:
        """Forget meshes without files: an upload of the same bytes then writes them, as of any other mesh."""
        for mesh_id in mesh_ids:
            if mesh_id not in self._missing:  # it may be being uploaded, or deleted
                self._seen.add(mesh_id)
            elif not list(self._stock.blobs.list(layout.mesh_folder(mesh_id))):
                with suppress(
                    MeshNotFoundError, MeshInUseError
                ):  # jobs that name it say themselves what they miss
                    self._stock.meshes.delete(mesh_id)
                    log.warning("its files are gone: its record, too", extra=named(mesh_id, "inventory"))
                    restore_mesh(self._stock, mesh_id)  # if it was uploaded at this moment

    def _deleted_before(self, job_id: str, tombstone: BlobStat) -> None:
        try:
            restore_deletion(self._stock, tombstone)
        except StoreUnavailableError:
            raise
        except UNREADABLE:  # all but the key it was asked for under
            log.exception("its tombstone cannot be read", extra=named(job_id, "inventory"))
        settle(self._stock.jobs, self._stock.blobs, job_id)  # whoever deleted it may not have lived to

    def _compare(
        self,
        unknown: Sequence[str],
        folder: Callable[[str], str],
        restore: Callable[[Stock, str], bool | None],
    ) -> list[str]:
        restored = []
        for name in unknown:
            if name not in self._missing:  # it may be on its way
                self._seen.add(name)
            elif self._restored(name, folder(name), restore):
                restored.append(name)
        return restored

    def _restored(self, name: str, folder: str, restore: Callable[[Stock, str], bool | None]) -> bool:
        """Restore what was without a record in two rounds; what holds nothing to record is removed when it is old."""
        extra = named(name, "inventory")
        try:
            restored = restore(self._stock, name)
        except StoreUnavailableError:
            raise
        except UNREADABLE:  # and not removed: it may be all that is left
            if name not in self._unreadable:
                log.exception("its record was lost, and its files cannot be read", extra=extra)
            self._unreadable.add(name)
        else:
            if restored:
                log.warning("its record was lost: restored from its files", extra=extra)
                return True
            if restored is None:
                self._tried(name, self._remove_old, name, folder)
        self._seen.add(name)
        return False

    def _remove_old(self, name: str, folder: str) -> None:
        """Remove what nobody has written to for a day; what is written at this moment stays."""
        blobs = self._stock.blobs
        found = list(blobs.list(folder))
        begun = time_of(name) if is_job_id(name) else 0.0  # states that it has of another job are older
        newest = max([begun, *(stat.created_at for stat in found)])
        if newest < time.time() - ORPHAN_S and (removed := sum(blobs.delete(stat.key) for stat in found)):
            log.warning("%d files that belong to nothing: removed", removed, extra=named(name, "inventory"))
