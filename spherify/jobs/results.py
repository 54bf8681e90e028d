"""``result.json``: how a job ended, written once by the attempt that ended it, and told to the record from there.

Whoever finds the file ends the record with it: a worker may die between the two. It carries the SHA-256 of its
content; one that is damaged counts as if it were not there, and the end is written once more beside it, in
``result-again.json``. Nothing is ever replaced, so that of any number of writers one wins there, too.
"""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from spherify.jobs import layout
from spherify.jobs.codec import dumps, load_outcome, load_progress, load_snapshot
from spherify.jobs.errors import BlobExistsError, BlobNotFoundError, DamagedBlobError
from spherify.jobs.model import Outcome, Progress, Snapshot
from spherify.jobs.ports import BlobStore, JobStore, Kept
from spherify.jobs.rows import Row

log = logging.getLogger(__name__)


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
        whole: whether the runner told its end itself, and so of every snapshot and row; one that was killed may have
            told a part only.

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
    whole: bool = False

    @property
    def kept(self) -> Kept | None:
        """What stays in the record, of all that former attempts told; None, which is everything, if a part is known."""
        if not self.whole:
            return None
        return Kept(
            frozenset(snapshot.iteration for snapshot in self.snapshots),
            frozenset(int(row["iteration"]) for row in self.rows),
        )


def write_result(blobs: BlobStore, result: Result) -> Result:
    """Make an end durable; returns the one that counts, which is an earlier attempt's if there is an intact one."""
    job_id, text = result.job_id, _dumped(result)
    try:
        blobs.create(layout.result(job_id), text)
    except BlobExistsError:
        try:
            return _parsed(blobs.read(layout.result(job_id)))
        except DamagedBlobError as e:
            return _write_again(blobs, result, text, e)
    return result


def read_result(blobs: BlobStore, job_id: str) -> Result | None:
    """Return how a job ended, None if it has not, or if nothing intact says how."""
    for key in (layout.result(job_id), layout.result_again(job_id)):
        try:
            return _parsed(blobs.read(key))
        except BlobNotFoundError:
            return None
        except DamagedBlobError:
            continue  # told in the log by whoever writes it once more
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
    return jobs.commit(result.job_id, token, result.outcome, result.kept)


def _write_again(blobs: BlobStore, result: Result, text: bytes, damage: DamagedBlobError) -> Result:
    key = layout.result_again(result.job_id)
    try:
        blobs.create(key, text)
    except BlobExistsError:
        try:
            return _parsed(blobs.read(key))
        except DamagedBlobError:
            return result  # the record alone will say it
    extra = {"job_id": result.job_id, "action": "result"}
    log.warning("result.json is damaged: the end is written once more, in %s: %s", key, damage, extra=extra)
    return result


def _dumped(result: Result) -> bytes:
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
        "whole": result.whole,
    }
    return dumps(document | {"sha256": _checksum(document)}).encode()


def _parsed(text: bytes) -> Result:
    """Read what `_dumped` wrote; raises `DamagedBlobError`."""
    try:
        data = json.loads(text)
        told = data.pop("sha256", None)  # it and the last four are younger than the rest
        if told is not None and told != _checksum(data):
            raise DamagedBlobError("its checksum does not fit")
        return Result(
            job_id=data["job_id"],
            token=data["token"],
            outcome=load_outcome(data["outcome"]),
            progress=None if data["progress"] is None else load_progress(data["progress"]),
            snapshots=tuple(map(load_snapshot, data["snapshots"])),
            rows=tuple(data["metrics"]),
            started_at=data.get("started_at"),
            attempt=data.get("attempt", 0),
            losses=data.get("losses", 0),
            whole=data.get("whole", False),
        )
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as e:
        raise DamagedBlobError(f"it has another form: {e!r}") from e


def _checksum(document: dict[str, Any]) -> str:
    return hashlib.sha256(dumps(document).encode()).hexdigest()
