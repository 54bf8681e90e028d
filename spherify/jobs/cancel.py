"""Cancel a job: a waiting one at once, a running one through its worker."""

from __future__ import annotations

from contextlib import suppress

from spherify.jobs import layout
from spherify.jobs.codec import dumps
from spherify.jobs.errors import BlobExistsError
from spherify.jobs.model import JobStatus
from spherify.jobs.ports import BlobStore, CancelOutcome, JobStore


def cancel(jobs: JobStore, blobs: BlobStore, job_id: str) -> CancelOutcome:
    """Ask for the end of a job; the snapshots kept so far stay.

    A job that was waiting leaves a ``result.json``, so that it stays cancelled even if its record is lost. A
    running one stops within two seconds; its worker writes that file.
    """
    outcome = jobs.request_cancel(job_id)
    if outcome is CancelOutcome.CANCELLED:
        end = {"job_id": job_id, "token": 0, "status": JobStatus.CANCELLED, "stop_reason": "cancelled"}
        with suppress(BlobExistsError):  # cancelled before
            blobs.create(layout.result(job_id), dumps(end).encode())
    return outcome
