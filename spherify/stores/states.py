"""The files that hold states of a run, read back: whose run they are of, and what the record is to say of them."""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from spherify.jobs import layout
from spherify.jobs.errors import BlobNotFoundError, DamagedBlobError
from spherify.jobs.model import Snapshot
from spherify.jobs.ports import BlobStat, BlobStore, Trail
from spherify.jobs.rows import ROWS, Row, rows_to_list
from spherify.stores.arrays import load_arrays

log = logging.getLogger(__name__)


def find_trail(blobs: BlobStore, job_id: str) -> Trail:
    """Return what the newest run of a job left in its files, whatever its attempts came to tell.

    Only that run's: a later attempt that could not go on from the states of an earlier one had them leave the record.
    A damaged file counts as if it had never been written, and so does one whose name is none of ours. Without files
    nothing but their list is read.
    """
    public = layout.snapshots(job_id)
    stats = [stat for folder in (public, layout.checkpoints(job_id)) for stat in blobs.list(folder)]
    newest: bytes | None = None
    snapshots: dict[int, Snapshot] = {}
    rows: list[Row] = []
    for stat in sorted(filter(_is_numbered, stats), key=lambda stat: layout.numbers(stat.key), reverse=True):
        content, arrays = load_state(blobs, stat) or (b"", {})
        if ROWS not in arrays or newest not in {None, run_of(arrays)}:
            continue
        newest = run_of(arrays)
        told = rows_to_list(arrays[ROWS])
        if not rows or told[-1]["iteration"] > rows[-1]["iteration"]:
            rows = told
        iteration = layout.numbers(stat.key)[1]
        row = row_of(told, iteration)
        if stat.key.startswith(public) and iteration not in snapshots and row is not None:
            snapshots[iteration] = snapshot_record(iteration, stat, content, row)
    return Trail(tuple(snapshots[i] for i in sorted(snapshots)), tuple(rows))


def run_of(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Return what tells the states of one run: mesh, parameters, and which version of which engine computed them."""
    return arrays["fingerprint"].tobytes() if "fingerprint" in arrays else b""


def row_of(rows: list[Row], iteration: int) -> Row | None:
    """Return the row of an iteration, None if it is not among them."""
    return next((row for row in rows if row["iteration"] == iteration), None)


def snapshot_record(iteration: int, stat: BlobStat, content: bytes, row: Row) -> Snapshot:
    """Return the record of a stored snapshot."""
    return Snapshot(
        iteration=iteration,
        key=stat.key,
        sha256=hashlib.sha256(content).hexdigest(),
        size=stat.size,
        metrics={name: value for name, value in row.items() if name != "iteration"},
        created_at=stat.created_at,
    )


def load_state(blobs: BlobStore, stat: BlobStat) -> tuple[bytes, dict[str, NDArray[Any]]] | None:
    """Return the bytes of a file and the arrays they hold; None, and a line in the log, if it is damaged or gone."""
    try:
        content = blobs.read(stat.key)
        return content, load_arrays(content)
    except (DamagedBlobError, BlobNotFoundError) as e:  # an earlier attempt's runner may live yet, and sweep
        log.warning("%s is passed over: %s", stat.key, e, extra={"action": "state"})
        return None


def _is_numbered(stat: BlobStat) -> bool:
    try:
        layout.numbers(stat.key)
    except ValueError:
        return False
    return True
