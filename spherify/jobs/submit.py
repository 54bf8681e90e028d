"""Accept a job: file first, record second, message last."""

from __future__ import annotations

import logging

from spherify.jobs import layout
from spherify.jobs.codec import dump_record
from spherify.jobs.errors import (
    BlobExistsError,
    JobGoneError,
    MeshNotFoundError,
    StorageFullError,
    StoreUnavailableError,
)
from spherify.jobs.model import Job, JobSpec
from spherify.jobs.ports import BlobStore, JobQueue, JobStore

log = logging.getLogger(__name__)


def submit(jobs: JobStore, blobs: BlobStore, queue: JobQueue, spec: JobSpec) -> Job:
    """Make a job durable, record it, and send it; doing it again with the same spec changes nothing.

    A message that cannot be sent is no error: the reconciler finds the waiting job and sends it.

    Raises:
        StorageFullError: nothing was recorded.
        MeshNotFoundError: its mesh is not there, or no longer; nothing was recorded.
        JobGoneError: it was made before, and deleted since.
        StoreUnavailableError: the record was, perhaps, not written; submit the same spec again. If it was not, the
            job is withdrawn: nothing brings it back later, when nobody expects it any more.

    """
    try:
        blobs.create(layout.spec(spec.id), dump_record(spec).encode())
    except BlobExistsError:
        log.info("spec is written already", extra={"job_id": spec.id, "action": "submit"})
        if not jobs.complete():  # the record may be among those that are coming back
            raise StoreUnavailableError("the job records are being rebuilt from the files") from None
        blobs.delete(layout.withdrawn(spec.id))
    except StoreUnavailableError:  # it may be written all the same
        _withdraw(blobs, spec.id)
        raise
    try:
        job = jobs.add(spec)
    except StoreUnavailableError:
        _withdraw(blobs, spec.id)
        raise
    except (MeshNotFoundError, JobGoneError):
        blobs.delete(layout.spec(spec.id))
        raise
    try:
        queue.send(spec.id)
    except StoreUnavailableError:
        log.warning(
            "recorded, but not sent: the reconciler will", extra={"job_id": spec.id, "action": "submit"}
        )
    return job


def _withdraw(blobs: BlobStore, job_id: str) -> None:
    """Leave word that a client was told of no job."""
    try:
        blobs.create(layout.withdrawn(job_id), b"")
    except (BlobExistsError, StorageFullError, StoreUnavailableError) as e:
        log.warning("not withdrawn: %s", e, extra={"job_id": job_id, "action": "submit"})
