"""``result.json``: how a job ended, written once by the attempt that ended it, and told to the record from there.

Whoever finds the file ends the record with it: a worker may die between the two.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from spherify.jobs import layout
from spherify.jobs.codec import dumps, load_outcome, load_progress, load_snapshot
from spherify.jobs.errors import BlobExistsError, BlobNotFoundError
from spherify.jobs.model import Outcome, Progress, Snapshot
from spherify.jobs.ports import BlobStore, JobStore
from spherify.jobs.rows import Row


@dataclass(frozen=True, slots=True)
class Result:
    """Everything there is to know of a job that has ended.

    Attributes:
        token: of the attempt that ended it.
        progress: None if it never got that far.
        snapshots: ascending by iteration.
        rows: the time series, ascending by iteration.
        started_at: when its first attempt began, seconds since the epoch.
        attempt: how many there were.
        losses: how many of them lost their worker.

    """

    job_id: str
    token: int
    outcome: Outcome
    progress: Progress | None = None
    snapshots: Sequence[Snapshot] = ()
    rows: Sequence[Row] = ()
    started_at: float | None = None
    attempt: int = 0
    losses: int = 0


def write_result(blobs: BlobStore, result: Result) -> Result:
    """Make an end durable; returns the one that counts, which is an earlier attempt's if there is one."""
    document = {
        "job_id": result.job_id,
        "token": result.token,
        "outcome": asdict(result.outcome),
        "progress": None if result.progress is None else asdict(result.progress),
        "snapshots": [asdict(snapshot) for snapshot in result.snapshots],
        "metrics": list(result.rows),
        "started_at": result.started_at,
        "attempt": result.attempt,
        "losses": result.losses,
    }
    try:
        blobs.create(layout.result(result.job_id), dumps(document).encode())
    except BlobExistsError:
        return _parsed(json.loads(blobs.read(layout.result(result.job_id))))
    return result


def read_result(blobs: BlobStore, job_id: str) -> Result | None:
    """Return how a job ended, None if it has not."""
    try:
        return _parsed(json.loads(blobs.read(layout.result(job_id))))
    except BlobNotFoundError:
        return None


def publish_result(jobs: JobStore, token: int, result: Result) -> bool:
    """Bring the record to the end that is written; False if another attempt has the job now.

    May be repeated, and by another attempt than the one that wrote it.
    """
    for snapshot in result.snapshots:
        if not jobs.add_snapshot(result.job_id, token, snapshot):
            break  # fenced, or ended already: the commit below tells which
    if result.progress is not None:
        jobs.report(result.job_id, token, result.progress, result.rows)
    return jobs.commit(result.job_id, token, result.outcome)


def _parsed(data: dict[str, Any]) -> Result:
    return Result(
        job_id=data["job_id"],
        token=data["token"],
        outcome=load_outcome(data["outcome"]),
        progress=None if data["progress"] is None else load_progress(data["progress"]),
        snapshots=tuple(map(load_snapshot, data["snapshots"])),
        rows=tuple(data["metrics"]),
        started_at=data.get("started_at"),  # the three are younger than the rest
        attempt=data.get("attempt", 0),
        losses=data.get("losses", 0),
    )
