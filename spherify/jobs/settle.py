"""Bring the files of a job that ended or was deleted to their last state, which whoever ended it may not live to do."""

from __future__ import annotations

from collections.abc import Sequence

from spherify.jobs import layout
from spherify.jobs.errors import JobGoneError
from spherify.jobs.model import Job, JobStatus, Outcome
from spherify.jobs.ports import BlobStore, JobStore
from spherify.jobs.results import Result, read_result, write_result
from spherify.jobs.rows import Row


def settle(jobs: JobStore, blobs: BlobStore, job_id: str) -> None:
    """Leave an ended job with a ``result.json`` and its snapshots only, and a deleted one without files.

    May be repeated, by anybody; the reconciler does it for everyone who did not.

    Raises:
        JobNotFoundError: nothing is known of it, and nothing is touched.
        StorageFullError, StoreUnavailableError: the reconciler will try again.

    """
    settled = False
    while not settled:  # once more if it was deleted meanwhile
        try:
            job = jobs.get(job_id)
            if not job.status.done:
                return
            result = read_result(blobs, job_id)
            if result is None:
                result = write_result(blobs, result_of(job, _outcome_of(job), jobs.metrics(job_id)))
            remove_folder(blobs, layout.checkpoints(job_id))
            remove_folder(blobs, layout.attempts(job_id))
            if job.token > 1 or job.status is not JobStatus.SUCCESSFUL:
                _remove_unnamed(blobs, job, result)
            settled = jobs.settled(job_id, deleted=False)
        except JobGoneError:
            remove_folder(blobs, layout.job_folder(job_id))
            settled = jobs.settled(job_id, deleted=True)


def remove_folder(blobs: BlobStore, prefix: str) -> int:
    """Remove every blob below a prefix and return how many there were."""
    return sum(blobs.delete(stat.key) for stat in list(blobs.list(prefix)))


def _remove_unnamed(blobs: BlobStore, job: Job, result: Result) -> None:
    """Remove the snapshots that nobody knows of.

    Those of an earlier attempt that a later one made once more, to the same bytes, and those of a runner that was
    killed before it told of them. What the result names stays also if the record ended otherwise: the records may get
    lost.
    """
    named = {snapshot.key for snapshot in (*job.snapshots, *result.snapshots)}
    for stat in list(blobs.list(layout.snapshots(job.id))):
        if stat.key not in named:
            blobs.delete(stat.key)


def result_of(job: Job, outcome: Outcome, rows: Sequence[Row]) -> Result:
    """Return what the record knows of a job, with the end that it has or is to have."""
    return Result(
        job.id,
        job.token,
        outcome,
        job.progress,
        job.snapshots,
        rows,
        started_at=job.started_at,
        attempt=job.attempt,
        losses=job.losses,
    )


def _outcome_of(job: Job) -> Outcome:
    return Outcome(
        status=job.status,
        stop_reason=job.stop_reason,
        stop_detail=job.stop_detail,
        result_iteration=job.result_iteration,
        best_iteration=job.best_iteration,
        error=job.error,
    )
