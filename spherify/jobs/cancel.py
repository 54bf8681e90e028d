"""Cancel a job: a waiting one at once, a running one through its worker."""

from __future__ import annotations

import logging
from contextlib import suppress

from spherify.jobs import layout
from spherify.jobs.errors import BlobExistsError, StorageFullError
from spherify.jobs.finish import finish
from spherify.jobs.model import JobStatus
from spherify.jobs.ports import BlobStore, CancelOutcome, JobStore
from spherify.jobs.results import publish_result, read_result
from spherify.jobs.settle import settle

log = logging.getLogger(__name__)


def cancel(jobs: JobStore, blobs: BlobStore, job_id: str) -> CancelOutcome:
    """Ask for the end of a job; the snapshots kept so far stay.

    ``cancel.json`` says for good that it was asked for, so that it outlives the record and a damaged ``result.json``.
    A waiting job is ended here; a running one stops within two seconds, and its worker writes how it ended.
    Where that is written already, it counts: an attempt ended the job and did not live to tell the record.

    Raises:
        StorageFullError: the record knows of it, and nothing else: it is to be asked for again.

    """
    if blobs.stat(layout.result(job_id)) is not None:
        _tell_end(jobs, blobs, job_id)
    outcome = jobs.request_cancel(job_id)
    if outcome not in {CancelOutcome.CANCELLED, CancelOutcome.CANCELLING}:
        return outcome
    result = read_result(blobs, job_id)
    if result is None:
        _keep(blobs, job_id)
    # Once more: if the record was lost meanwhile, whoever made it anew may not have seen that file.
    outcome = jobs.request_cancel(job_id)
    if outcome is CancelOutcome.CANCELLING:
        finish(jobs, blobs, job_id)
        outcome = jobs.request_cancel(job_id)  # tells how it ended, here or with a worker that was told
    if (
        outcome is CancelOutcome.CANCELLING
        and result is not None
        and result.outcome.status is not JobStatus.CANCELLED
    ):
        outcome = CancelOutcome.FINISHED  # whoever holds it tells the record so
    try:
        settle(jobs, blobs, job_id)
    except StorageFullError:
        extra = {"job_id": job_id, "action": "cancel"}
        log.warning("cancelled, but not settled: the reconciler will", extra=extra)
    if outcome is CancelOutcome.FINISHED and result is None:  # meanwhile: nobody is told of a cancel
        blobs.delete(layout.cancel(job_id))
    return outcome


def _tell_end(jobs: JobStore, blobs: BlobStore, job_id: str) -> None:
    """Have the record say how the job ended, if it is an older copy of a time when nobody had begun it."""
    result, job = read_result(blobs, job_id), jobs.get(job_id)
    if result is not None and job.status is JobStatus.ACCEPTED and job.token == 0:
        publish_result(jobs, jobs.claim(job_id, "cancel").token, result)


def _keep(blobs: BlobStore, job_id: str) -> None:
    """Leave word for good; on a full disk by a second name of what is there, which takes no room."""
    with suppress(BlobExistsError):  # asked before
        try:
            blobs.create(layout.cancel(job_id), b"")
        except StorageFullError:
            _keep_without_room(blobs, job_id)


def _keep_without_room(blobs: BlobStore, job_id: str) -> None:
    try:
        blobs.copy(layout.spec(job_id), layout.cancel(job_id))
    except StorageFullError as e:
        told = "the job is told to end, but its record alone knows"
        raise StorageFullError(f"{told}: cancel it once more when there is room ({e})") from e
