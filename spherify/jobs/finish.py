"""End a job that is not to be computed any more: one that is to be cancelled, or was lost too often.

Like every end, it is written to ``result.json`` before the record says so. If that file is there already, it counts: an
attempt wrote it and died, or was suspended, before it could tell. The job's other files are settled afterwards.
"""

from __future__ import annotations

import logging

from spherify.jobs import layout
from spherify.jobs.errors import StorageFullError
from spherify.jobs.model import Job, JobStatus, Outcome
from spherify.jobs.outcome import worker_lost
from spherify.jobs.ports import BlobStore, ClaimOutcome, JobStore, Renewal, Trail
from spherify.jobs.results import Result, publish_result, read_result, write_result
from spherify.jobs.settle import result_of

log = logging.getLogger(__name__)


def finish(jobs: JobStore, blobs: BlobStore, job_id: str) -> bool:
    """Take a job that is only to be ended and that nobody holds, and end it; False if it is no such job.

    Raises:
        JobGoneError: it was deleted meanwhile.
        StoreUnavailableError: the reconciler will try again.

    """
    claim = jobs.claim(job_id, "finish", to_end=True)
    return claim.outcome is ClaimOutcome.ENDING and conclude(jobs, blobs, job_id, claim.token)


def conclude(jobs: JobStore, blobs: BlobStore, job_id: str, token: int) -> bool:
    """End a job that was claimed for this; False if somebody else has it now. Raises as `finish`."""
    result = read_result(blobs, job_id)
    if result is None and blobs.stat(layout.cancel(job_id)) is not None:  # the record may be an older copy
        jobs.request_cancel(job_id)
    if result is not None:
        ended = publish_result(jobs, token, result)
    elif (sealed := jobs.seal(job_id, token)) is Renewal.FENCED:
        return False
    else:
        job = jobs.get(job_id)
        mine = result_of(job, _outcome(job, sealed), jobs.metrics(job_id))
        result = _written(blobs, mine)
        own = result is mine  # then the record has all of it but the end
        ended = jobs.commit(job_id, token, mine.outcome) if own else publish_result(jobs, token, result)
    if ended:
        extra = {"job_id": job_id, "action": "finish"}
        log.info("%s, without a runner", result.outcome.status, extra=extra)
    return ended


def _outcome(job: Job, sealed: Renewal) -> Outcome:
    best = Trail(job.snapshots).best
    if sealed is Renewal.CANCEL:
        return Outcome(JobStatus.CANCELLED, stop_reason="cancelled", best_iteration=best)
    return Outcome(JobStatus.FAILED, best_iteration=best, error=worker_lost(job.losses))


def _written(blobs: BlobStore, result: Result) -> Result:
    try:
        return write_result(blobs, result)
    except StorageFullError as e:  # the record alone must say it until there is room
        log.warning("ended, but not written: %s", e, extra={"job_id": result.job_id, "action": "finish"})
        return result
