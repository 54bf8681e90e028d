"""Record one mesh, one job or one deletion again, from its files: everything that was acknowledged is in them.

    tombstones/{job}                    the job was deleted, and stays so, and so does its Idempotency-Key; what is left
                                        of its files goes
    jobs/{job}/result.json              the job ended so; if it is damaged, and nothing else says how the job ended,
                                        the job goes on from its newest state, and ends so once more
    jobs/{job}/cancel.json              the job was to be cancelled, and is
    jobs/{job}/spec.json                the job waits again, and goes on from its newest checkpoint; of all jobs also
                                        the Idempotency-Key, for the rest of its day
    jobs/{job}/snapshots/, checkpoints/ what such a job had come to, and told of: it stays, also if the job was to be
                                        cancelled, or is before a worker takes it
    jobs/{job}/attempts/{token}.json    what attempts and losses there were, and how long they took
    meshes/{mesh}/record.json           the mesh

What has a ``withdrawn.json`` was answered with "not accepted" and stays away, unless it had been taken all the same and
an attempt at it has begun. A spec without that and without a record belongs to a client who was answered nothing at
all, or was told that the server does not answer when it had taken the job: such a job comes back too; sending the
request again under the same Idempotency-Key finds it.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from spherify.jobs import layout
from spherify.jobs.accounts import Account, read_account
from spherify.jobs.codec import load_mesh_record, load_request, load_spec
from spherify.jobs.errors import (
    BlobNotFoundError,
    DamagedBlobError,
    JobsError,
    StorageFullError,
    StoreUnavailableError,
)
from spherify.jobs.ids import is_job_id, time_of
from spherify.jobs.model import Job, JobSpec, JobStatus, Progress
from spherify.jobs.ports import BlobStat, Trail
from spherify.jobs.repeats import KEPT_S
from spherify.jobs.results import Result, read_result
from spherify.jobs.rows import Row
from spherify.jobs.settle import settle
from spherify.jobs.stock import Stock

UNREADABLE: Final = (JobsError, OSError, ValueError, LookupError, TypeError)
"""What a file of another form than ours raises: its trouble, not that of the others."""
log = logging.getLogger(__name__)


def named(name: str, action: str) -> dict[str, str]:
    """Return what a log line says of a job or of a mesh."""
    return {"job_id" if is_job_id(name) else "mesh_id": name, "action": action}


def restore_mesh(stock: Stock, mesh_id: str) -> bool | None:
    """Record a mesh again; False if it is known, None if there is nothing to record."""
    try:
        record = load_mesh_record(stock.blobs.read(layout.mesh_record(mesh_id)))
    except BlobNotFoundError:  # it was being deleted, or written
        return None
    if record.id != mesh_id:
        raise DamagedBlobError(f"{layout.mesh_record(mesh_id)} is that of {record.id}")
    return stock.meshes.add(record)


def restore_deletion(stock: Stock, tombstone: BlobStat) -> None:
    """Say again that a job was deleted, and, for the rest of its day, that its Idempotency-Key is taken."""
    job_id = tombstone.key.rpartition("/")[2]
    _bury(stock, tombstone)
    if is_job_id(job_id) and time.time() < time_of(job_id) + KEPT_S:
        request = load_request(stock.blobs.read(layout.tombstone(job_id)))
        if request is not None:
            stock.repeats.remember(request.name, request.fingerprint, job_id, time_of(job_id))


def restore_job(stock: Stock, job_id: str, still: Callable[[], object] = lambda: None) -> bool | None:
    """Record a job again, as ended, cancelled or waiting.

    Args:
        stock: where.
        job_id: which.
        still: called again and again: a job may have left a thousand files.

    Returns:
        False if it is known, was deleted, or may have been meanwhile; None if there is nothing to record.

    """
    if not is_job_id(job_id):
        return None
    # Before the files are read: who sleeps over a further loss restores nothing of what was.
    era = stock.jobs.era()
    tombstone = stock.blobs.stat(layout.tombstone(job_id))
    if tombstone is not None:
        _bury(stock, tombstone)
        settle(stock.jobs, stock.blobs, job_id)  # whoever deleted it died before all files were gone
        return False
    spec = _spec(stock, job_id)
    if spec is None:
        return None
    ended = stock.blobs.stat(layout.result(job_id))
    result = read_result(stock.blobs, job_id)
    if ended is None and result is None and _withdrawn(stock, job_id):
        return None
    if spec.request is not None:
        stock.repeats.remember(spec.request.name, spec.request.fingerprint, job_id, spec.created_at)
    if result is None:
        return _restore_unfinished(stock, spec, era, still)
    job = _ended(spec, result, ended.created_at if ended else time.time())
    return stock.jobs.restore(job, result.rows, era=era)


def _withdrawn(stock: Stock, job_id: str) -> bool:
    """Whether nobody knows of a job; once an attempt has begun, whoever looked has seen it."""
    if stock.blobs.stat(layout.withdrawn(job_id)) is None:
        return False
    return not any(True for _ in stock.blobs.list(layout.attempts(job_id)))


def _bury(stock: Stock, tombstone: BlobStat) -> None:
    job_id = tombstone.key.rpartition("/")[2]
    stock.jobs.bury(job_id, tombstone.created_at + layout.TOMBSTONE_S - time.time())


def _spec(stock: Stock, job_id: str) -> JobSpec | None:
    try:
        spec = load_spec(stock.blobs.read(layout.spec(job_id)))
    except BlobNotFoundError:
        return None
    if spec.id != job_id:
        raise DamagedBlobError(f"{layout.spec(job_id)} is that of {spec.id}")
    return spec


def _restore_unfinished(stock: Stock, spec: JobSpec, era: str, still: Callable[[], object]) -> bool:
    """Record a job that had not ended, as waiting or as cancelled."""
    if not stock.jobs.unknown([spec.id]):
        return False  # by a rebuild that was broken off: its files need not be read once more
    known = read_account(stock.blobs, spec.id)
    trail = _trail(stock, spec.id, still)
    job = _unfinished(spec, known, trail)
    asked = stock.blobs.stat(layout.cancel(spec.id))
    if asked is not None:  # from the first moment on: whoever dies over it leaves nothing that may be claimed
        job = _cancelled(job, trail, asked.created_at)
    if not stock.jobs.restore(job, trail.rows, spent_s=known.spent_s, era=era):
        return False
    if asked is None:
        stock.queue.send(spec.id)
    else:
        _settle(stock, spec.id)
    return True


def _settle(stock: Stock, job_id: str) -> None:
    try:
        settle(stock.jobs, stock.blobs, job_id)
    except StorageFullError as e:
        log.warning("restored, and not settled: %s; the reconciler will", e, extra=named(job_id, "restore"))


def _trail(stock: Stock, job_id: str, still: Callable[[], object]) -> Trail:
    """Return what the attempts at a job left; what is of another form than ours is not in the way of the job."""
    try:
        return stock.find_trail(stock.blobs, job_id, still)
    except (StoreUnavailableError, OSError):  # it may pass, and what the record does not name is removed
        raise
    except UNREADABLE:
        log.exception("restored without its snapshots", extra=named(job_id, "restore"))
        return Trail()


def _unfinished(spec: JobSpec, known: Account, trail: Trail) -> Job:
    """Return a job that waits again, with what its attempts came to and had cost."""
    newest = trail.rows[-1] if trail.rows else None
    return Job(
        spec,
        token=known.token,
        attempt=known.attempt,
        losses=known.losses,
        snapshots=trail.snapshots,
        progress=Progress(int(newest["iteration"]), spec.parameters["iterations"]) if newest else None,
        metrics=_figures(newest),
    )


def _cancelled(job: Job, trail: Trail, at: float) -> Job:
    return replace(
        job, status=JobStatus.CANCELLED, stop_reason="cancelled", best_iteration=trail.best, finished_at=at
    )


def _ended(spec: JobSpec, result: Result, finished_at: float) -> Job:
    outcome = result.outcome
    return Job(
        spec=spec,
        status=outcome.status,
        token=result.token,
        attempt=result.attempt,
        losses=result.losses,
        progress=result.progress,
        metrics=_figures(result.rows[-1] if result.rows else None),
        snapshots=tuple(result.snapshots),
        best_iteration=outcome.best_iteration,
        result_iteration=outcome.result_iteration,
        stop_reason=outcome.stop_reason,
        stop_detail=outcome.stop_detail,
        error=outcome.error,
        started_at=result.started_at,
        finished_at=finished_at,
    )


def _figures(row: Row | None) -> Row:
    """Return a row of the time series without its iteration."""
    return {name: value for name, value in (row or {}).items() if name != "iteration"}
