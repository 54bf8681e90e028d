"""Accept a job: file first, record second, message last."""

from __future__ import annotations

import logging

from spherify.jobs import layout
from spherify.jobs.codec import dump_record
from spherify.jobs.errors import BlobExistsError, MeshNotFoundError, StoreUnavailableError
from spherify.jobs.model import Job, JobSpec
from spherify.jobs.ports import BlobStore, JobQueue, JobStore

log = logging.getLogger(__name__)


def submit(jobs: JobStore, blobs: BlobStore, queue: JobQueue, spec: JobSpec) -> Job:
    """Make a job durable, record it, and send it; doing it again with the same spec changes nothing.

    A message that cannot be sent is no error: the reconciler finds the waiting job and sends it.

    Raises:
        StorageFullError: nothing was recorded.
        MeshNotFoundError: its mesh is not there, or no longer; nothing was recorded.
        StoreUnavailableError: the record was, perhaps, not written; submit the same spec again.

    """
    try:
        blobs.create(layout.spec(spec.id), dump_record(spec).encode())
    except BlobExistsError:
        log.info("spec is written already", extra={"job_id": spec.id, "action": "submit"})
    try:
        job = jobs.add(spec)
    except MeshNotFoundError:
        blobs.delete(layout.spec(spec.id))
        raise
    try:
        queue.send(spec.id)
    except StoreUnavailableError:
        log.warning(
            "recorded, but not sent: the reconciler will", extra={"job_id": spec.id, "action": "submit"}
        )
    return job
