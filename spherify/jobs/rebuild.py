"""Bring records back that the server lost: everything that was acknowledged is in the files.

    tombstones/{job}                    the job was deleted, and stays so, and so does its Idempotency-Key
    jobs/{job}/result.json              the job ended so; if it is damaged, and nothing else says how the job ended,
                                        the job goes on from its newest state, and ends so once more
    jobs/{job}/cancel.json              the job was to be cancelled, and is
    jobs/{job}/spec.json                the job waits again, and goes on from its newest checkpoint; of all jobs also
                                        the Idempotency-Key, for the rest of its day
    jobs/{job}/snapshots/, checkpoints/ what such a job had come to, and told of: it stays, also if the job was to be
                                        cancelled, or is before a worker takes it
    jobs/{job}/attempts/{token}.json    what attempts and losses there were, and how long they took
    meshes/{mesh}/record.json           the mesh

What has a ``withdrawn.json`` was answered with "not accepted" and stays away. A spec without that and without a record
belongs to a client who was answered nothing at all, or was told that the server does not answer when it had taken the
job: such a job comes back too; sending the request again under the same Idempotency-Key finds it.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from spherify.jobs import layout
from spherify.jobs.accounts import read_account
from spherify.jobs.codec import load_mesh_record, load_request, load_spec
from spherify.jobs.errors import BlobNotFoundError, JobsError, StorageFullError, StoreUnavailableError
from spherify.jobs.ids import is_job_id, time_of
from spherify.jobs.model import Job, JobSpec, JobStatus, Progress
from spherify.jobs.ports import BlobStore, JobQueue, JobStore, MeshStore, Trail, TrailFinder
from spherify.jobs.repeats import KEPT_S, RepeatStore
from spherify.jobs.results import Result, read_result
from spherify.jobs.settle import settle

UNREADABLE: Final = (JobsError, OSError, ValueError, LookupError, TypeError)
"""What a file of another form than ours raises: its trouble, not that of the others."""
log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Stock:
    """Everything that is stored, and the way to the workers."""

    jobs: JobStore
    meshes: MeshStore
    blobs: BlobStore
    queue: JobQueue
    repeats: RepeatStore
    find_trail: TrailFinder


def rebuild(stock: Stock, still: Callable[[], object] = lambda: None) -> bool:
    """Restore everything if the server lost its records; whether it had.

    May be done by several at a time, and again after it was broken off.

    Args:
        stock: what to look through.
        still: called again and again, by which the caller says that it still is at it.

    Raises:
        StoreUnavailableError: it is to be done again.

    """
    if stock.jobs.complete():
        return False
    began = time.monotonic()
    name = stock.jobs.begin_rebuild()
    counts = {"meshes": 0, "jobs": 0}
    for stat in stock.blobs.list(layout.tombstones()):
        still()
        job_id = stat.key.rpartition("/")[2]
        stock.jobs.bury(job_id, stat.created_at + layout.TOMBSTONE_S - time.time())
        _tried(stock, job_id, remember_deleted)
    for kind, prefix, restore in (
        ("meshes", layout.meshes(), restore_mesh),
        ("jobs", layout.jobs(), restore_job),
    ):
        for found in stock.blobs.folders(prefix):
            still()
            counts[kind] += _tried(stock, found, restore)
    complete = stock.jobs.end_rebuild(name)
    said = f"{counts['jobs']} jobs and {counts['meshes']} meshes in {time.monotonic() - began:.1f} s"
    level = logging.WARNING if any(counts.values()) else logging.INFO  # a new server has nothing to lose
    log.log(
        level,
        "records rebuilt: %s%s",
        said,
        "" if complete else ", and lost again",
        extra={"action": "rebuild"},
    )
    return True


def named(name: str, action: str) -> dict[str, str]:
    """Return what a log line says of a job or of a mesh."""
    return {"job_id" if is_job_id(name) else "mesh_id": name, "action": action}


def restore_mesh(stock: Stock, mesh_id: str) -> bool:
    """Record a mesh again from its files; whether there was anything to record."""
    try:
        record = load_mesh_record(stock.blobs.read(layout.mesh_record(mesh_id)))
    except BlobNotFoundError:  # it was being deleted, or written
        return False
    return stock.meshes.add(record)


def remember_deleted(stock: Stock, job_id: str) -> bool:
    """Take up again the key that a deleted job was asked for under, for the rest of its day; whether there was one."""
    if not is_job_id(job_id) or time_of(job_id) + KEPT_S < time.time():
        return False
    request = load_request(stock.blobs.read(layout.tombstone(job_id)))
    return request is not None and stock.repeats.remember(
        request.name, request.fingerprint, job_id, time_of(job_id)
    )


def restore_job(stock: Stock, job_id: str) -> bool:
    """Record a job again from its files, as ended or as waiting; whether there was anything to record."""
    blobs = stock.blobs
    if not is_job_id(job_id) or blobs.stat(layout.tombstone(job_id)) is not None:
        return False
    try:
        spec = load_spec(blobs.read(layout.spec(job_id)))
    except BlobNotFoundError:
        return False
    ended = blobs.stat(layout.result(job_id))
    result = read_result(blobs, job_id)
    if result is None and ended is None and blobs.stat(layout.withdrawn(job_id)) is not None:
        return False
    if spec.request is not None:
        stock.repeats.remember(spec.request.name, spec.request.fingerprint, job_id, spec.created_at)
    if result is not None:
        return stock.jobs.restore(
            _ended(spec, result, ended.created_at if ended else time.time()), result.rows
        )
    if not stock.jobs.unknown([job_id]):
        return False  # by a rebuild that was broken off: its files need not be read once more
    known = read_account(blobs, job_id)
    trail = _trail(stock, job_id)
    job = _unfinished(Job(spec, token=known.token, attempt=known.attempt, losses=known.losses), trail)
    asked = blobs.stat(layout.cancel(job_id))
    if asked is not None:  # from the first moment on: whoever dies over it leaves nothing that may be claimed
        job = replace(
            job,
            status=JobStatus.CANCELLED,
            stop_reason="cancelled",
            best_iteration=trail.best,
            finished_at=asked.created_at,
        )
    restored = stock.jobs.restore(job, trail.rows, spent_s=known.spent_s)
    if restored and asked is None:
        stock.queue.send(job_id)
    elif restored:
        try:
            settle(stock.jobs, blobs, job_id)
        except StorageFullError as e:
            log.warning(
                "restored, and not settled: %s; the reconciler will", e, extra=named(job_id, "rebuild")
            )
    return restored


def _trail(stock: Stock, job_id: str) -> Trail:
    """Return what the attempts at a job left; what is of another form than ours is not in the way of the job."""
    try:
        return stock.find_trail(stock.blobs, job_id)
    except StoreUnavailableError:
        raise
    except UNREADABLE:
        log.exception("restored without its snapshots", extra=named(job_id, "rebuild"))
        return Trail()


def _unfinished(job: Job, trail: Trail) -> Job:
    """Return a job that goes on, or is to be cancelled, with what its attempts came to."""
    if not trail.rows:
        return job
    newest = trail.rows[-1]
    return replace(
        job,
        progress=Progress(int(newest["iteration"]), job.spec.parameters["iterations"]),
        metrics={name: value for name, value in newest.items() if name != "iteration"},
        snapshots=trail.snapshots,
    )


def _ended(spec: JobSpec, result: Result, finished_at: float) -> Job:
    outcome = result.outcome
    newest = result.rows[-1] if result.rows else {}
    return Job(
        spec=spec,
        status=outcome.status,
        token=result.token,
        attempt=result.attempt,
        losses=result.losses,
        progress=result.progress,
        metrics={name: value for name, value in newest.items() if name != "iteration"},
        snapshots=tuple(result.snapshots),
        best_iteration=outcome.best_iteration,
        result_iteration=outcome.result_iteration,
        stop_reason=outcome.stop_reason,
        stop_detail=outcome.stop_detail,
        error=outcome.error,
        started_at=result.started_at,
        finished_at=finished_at,
    )


def _tried(stock: Stock, name: str, restore: Callable[[Stock, str], bool]) -> bool:
    try:
        return restore(stock, name)
    except StoreUnavailableError:
        raise
    except UNREADABLE:
        log.exception("cannot be restored", extra=named(name, "rebuild"))
        return False
