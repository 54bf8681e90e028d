"""Cancel a job: a waiting one at once, a running one through its worker."""

from __future__ import annotations

import logging

from spherify.jobs.errors import StorageFullError
from spherify.jobs.model import JobStatus, Outcome
from spherify.jobs.ports import BlobStore, CancelOutcome, JobStore
from spherify.jobs.results import Result, write_result

log = logging.getLogger(__name__)


def cancel(jobs: JobStore, blobs: BlobStore, job_id: str) -> CancelOutcome:
    """Ask for the end of a job; the snapshots kept so far stay.

    A job that was waiting leaves a ``result.json``, so that it stays cancelled even if its record is lost. A
    running one stops within two seconds; its worker writes that file.
    """
    outcome = jobs.request_cancel(job_id)
    if outcome is CancelOutcome.CANCELLED:
        try:
            write_result(blobs, Result(job_id, 0, Outcome(JobStatus.CANCELLED, stop_reason="cancelled")))
        except StorageFullError:  # the record says it too
            log.warning("cancelled, without a file", extra={"job_id": job_id, "action": "cancel"})
    return outcome
