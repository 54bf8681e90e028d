"""Cancel a job: a waiting one at once, a running one through its worker."""

from __future__ import annotations

import logging

from spherify.jobs.errors import StorageFullError
from spherify.jobs.ports import BlobStore, CancelOutcome, JobStore
from spherify.jobs.settle import settle

log = logging.getLogger(__name__)


def cancel(jobs: JobStore, blobs: BlobStore, job_id: str) -> CancelOutcome:
    """Ask for the end of a job; the snapshots kept so far stay.

    A job that was waiting leaves a ``result.json``, so that it stays cancelled even if its record is lost. A
    running one stops within two seconds; its worker writes that file.
    """
    outcome = jobs.request_cancel(job_id)
    if outcome is CancelOutcome.CANCELLED:
        try:
            settle(jobs, blobs, job_id)
        except StorageFullError:
            log.warning(
                "cancelled, but not written: the reconciler will",
                extra={"job_id": job_id, "action": "cancel"},
            )
    return outcome
