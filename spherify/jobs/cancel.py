"""Cancel a job: a waiting one at once, a running one through its worker."""

from __future__ import annotations

import logging
from contextlib import suppress

from spherify.jobs import layout
from spherify.jobs.errors import BlobExistsError, StorageFullError
from spherify.jobs.ports import BlobStore, CancelOutcome, ClaimOutcome, JobStore
from spherify.jobs.results import publish_result, read_result
from spherify.jobs.settle import settle

log = logging.getLogger(__name__)


def cancel(jobs: JobStore, blobs: BlobStore, job_id: str) -> CancelOutcome:
    """Ask for the end of a job; the snapshots kept so far stay.

    ``cancel.json`` says for good that it was asked for, so that it outlives the record and a damaged ``result.json``.
    A waiting job is settled here; a running one stops within two seconds, and its worker writes how it ended.
    Where that is written already, it counts: an attempt ended the job and did not live to tell the record.
    """
    result = read_result(blobs, job_id)
    if result is not None:
        claim = jobs.claim(job_id, "cancel")
        if claim.outcome is ClaimOutcome.CLAIMED:
            publish_result(jobs, claim.token, result)
        return jobs.request_cancel(job_id) if jobs.get(job_id).status.done else CancelOutcome.FINISHED
    outcome = jobs.request_cancel(job_id)
    if outcome not in {CancelOutcome.CANCELLED, CancelOutcome.CANCELLING}:
        return outcome
    try:
        with suppress(BlobExistsError):  # asked before
            blobs.create(layout.cancel(job_id), b"")
        # Once more: if the record was lost meanwhile, whoever made it anew may not have seen that file.
        outcome = jobs.request_cancel(job_id)
        if outcome is CancelOutcome.FINISHED:  # it came to its end meanwhile, and nobody is told of a cancel
            blobs.delete(layout.cancel(job_id))
        if outcome is not CancelOutcome.CANCELLING:
            settle(jobs, blobs, job_id)
    except StorageFullError:
        extra = {"job_id": job_id, "action": "cancel"}
        log.warning("cancelled, but not written: the reconciler or the worker will", extra=extra)
    return outcome
