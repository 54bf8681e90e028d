"""The files that hold states of a run, read back: whose run they are of, and what the record is to say of them."""

from __future__ import annotations

import logging
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from numpy.typing import NDArray

from spherify.jobs import layout
from spherify.jobs.errors import BlobNotFoundError, DamagedBlobError
from spherify.jobs.model import Snapshot
from spherify.jobs.ports import BlobStat, BlobStore, Trail
from spherify.jobs.rows import ROWS, Row, rows_to_list
from spherify.stores.arrays import checksum_of, glance_at_arrays, load_arrays

VERTICES: Final = "vertices"
"""Name, in a state's file, of the positions: what has them can be served."""
FINGERPRINT: Final = "fingerprint"
"""Name, in a state's file, of what `run_of` returns."""
log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Glance:
    """What a glance at a state's file tells; the positions in it were not read."""

    stat: BlobStat
    checksum: str
    run: bytes

    @property
    def iteration(self) -> int:
        """How many iterations were done."""
        return layout.numbers(self.stat.key)[1]


def find_trail(blobs: BlobStore, job_id: str, still: Callable[[], object] = lambda: None) -> Trail:
    """Return what the newest run of a job left in its files, whatever its attempts came to tell.

    Only that run's: a later attempt that could not go on from the states of an earlier one had them leave the record.
    A file that is cut off, or none of ours, counts as if it had never been written. Of the others no more is read than
    tells whose they are; only where several attempts left a state of one iteration the whole files are, for an
    intact one. Whoever serves a state, or goes on from it, verifies every byte.

    Args:
        blobs: where the files are.
        job_id: whose.
        still: called for each file: there may be a thousand.

    """
    seen = glances(blobs, job_id, still)
    return trail_of(blobs, [glance for glance in seen if glance.run == seen[-1].run], still)


def trail_of(blobs: BlobStore, states: Sequence[Glance], still: Callable[[], object] = lambda: None) -> Trail:
    """Return what these states of one run, the newest attempt's last, hold; see `find_trail`."""
    rows: list[Row] = []
    for glance in sorted(states, key=lambda glance: glance.iteration, reverse=True):
        still()
        if rows := _rows_of(blobs, glance):
            break
    told = {row["iteration"]: row for row in rows}
    of_iteration: dict[int, list[Glance]] = defaultdict(list)
    for glance in reversed(states):
        if layout.is_snapshot(glance.stat.key):
            of_iteration[glance.iteration].append(glance)
    snapshots = []
    for iteration, left in sorted(of_iteration.items()):
        still()
        found = left[0] if len(left) == 1 else next((g for g in left if _intact(blobs, g)), None)
        if found is not None:
            row = told.get(iteration) or row_of(_rows_of(blobs, found), iteration) or {}
            snapshots.append(snapshot_record(iteration, found.stat, found.checksum, row))
    return Trail(tuple(snapshots), tuple(rows))


def glances(blobs: BlobStore, job_id: str, still: Callable[[], object] = lambda: None) -> list[Glance]:
    """Return the states in a job's files, the newest attempt's last, each after those it came from.

    A best state that was kept in hindsight says not whose it is: it is of the run of the one before it.
    """
    folders = (layout.snapshots(job_id), layout.checkpoints(job_id))
    stats = [stat for folder in folders for stat in layout.numbered_only(blobs.list(folder))]
    seen: list[Glance] = []
    for stat in sorted(stats, key=lambda stat: layout.numbers(stat.key)):
        still()
        try:
            with blobs.open(stat.key) as file:
                checksum, names, found = glance_at_arrays(file, (FINGERPRINT,))
        except (DamagedBlobError, BlobNotFoundError) as e:
            _pass_over(stat, e)
            continue
        if VERTICES in names:
            before = seen[-1].run if seen else b""
            seen.append(Glance(stat, checksum, run_of(found) if FINGERPRINT in found else before))
    return seen


def run_of(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Return what tells the states of one run: mesh, parameters, and which version of which engine computed them."""
    return arrays[FINGERPRINT].tobytes() if FINGERPRINT in arrays else b""


def rows_in(arrays: Mapping[str, NDArray[Any]]) -> list[Row]:
    """Return the time series up to a state, empty if there is none, or one of another form."""
    rows = arrays.get(ROWS)
    if rows is None or rows.ndim != 1 or "iteration" not in (rows.dtype.names or ()):
        return []
    return rows_to_list(rows)


def row_of(rows: Iterable[Row], iteration: int) -> Row | None:
    """Return the row of an iteration, None if it is not among them."""
    return next((row for row in rows if row["iteration"] == iteration), None)


def snapshot_record(iteration: int, stat: BlobStat, checksum: str, row: Row) -> Snapshot:
    """Return the record of a stored snapshot."""
    return Snapshot(
        iteration=iteration,
        key=stat.key,
        sha256=checksum,
        size=stat.size,
        metrics={name: value for name, value in row.items() if name != "iteration"},
        created_at=stat.created_at,
    )


def load_state(blobs: BlobStore, stat: BlobStat) -> tuple[str, dict[str, NDArray[Any]]] | None:
    """Return the checksum of a file and its arrays; None, and a line in the log, if it is damaged or gone."""
    try:
        content = blobs.read(stat.key)
        arrays = load_arrays(content)
    except (DamagedBlobError, BlobNotFoundError) as e:  # an earlier attempt's runner may live yet, and sweep
        _pass_over(stat, e)
        return None
    return checksum_of(content), arrays


def _rows_of(blobs: BlobStore, glance: Glance) -> list[Row]:
    """Return the time series up to a state, empty if it is of another form."""
    try:
        with blobs.open(glance.stat.key) as file:
            return rows_in(glance_at_arrays(file, (ROWS,))[2])
    except (DamagedBlobError, BlobNotFoundError) as e:
        _pass_over(glance.stat, e)
        return []


def _intact(blobs: BlobStore, glance: Glance) -> bool:
    return load_state(blobs, glance.stat) is not None


def _pass_over(stat: BlobStat, error: Exception) -> None:
    log.warning("%s is passed over: %s", stat.key, error, extra={"action": "state"})
