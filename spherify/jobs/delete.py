"""Delete jobs and meshes: the record before its files, so that nothing points at a file that is gone.

What says that something was deleted is durable before anything else happens: a tombstone for a job, and for a mesh
the absence of its ``record.json``. So a deletion that was acknowledged outlives the server's memory.
"""

from __future__ import annotations

from contextlib import suppress

from spherify.jobs import layout
from spherify.jobs.codec import dump_request
from spherify.jobs.errors import (
    BlobExistsError,
    JobNotFinishedError,
    MeshInUseError,
    MeshNotFoundError,
    StorageFullError,
)
from spherify.jobs.ports import BlobStore, JobStore, MeshStore
from spherify.jobs.settle import remove_folder, settle


def delete_job(jobs: JobStore, blobs: BlobStore, job_id: str) -> None:
    """Forget a finished job and remove its files; raises as `JobStore.delete` does."""
    job = jobs.get(job_id)
    if not job.status.done:
        raise JobNotFinishedError(f"{job_id} is not finished: cancel it first")
    with suppress(BlobExistsError):  # of an attempt that was broken off
        try:
            blobs.create(layout.tombstone(job_id), dump_request(job.spec.request))
        except StorageFullError:  # deleting helps against that, and a name alone takes no space
            blobs.create(layout.tombstone(job_id), b"")
    jobs.delete(job_id)
    settle(jobs, blobs, job_id)


def delete_mesh(meshes: MeshStore, blobs: BlobStore, mesh_id: str) -> None:
    """Forget a mesh no job names and remove its files; raises as `MeshStore.delete` does.

    Also one of which there are the files only: its record was lost, and may be of no use to make it anew.
    """
    try:
        meshes.delete(mesh_id)
    except MeshNotFoundError:
        if blobs.stat(layout.mesh_record(mesh_id)) is None:
            raise
    blobs.delete(layout.mesh_record(mesh_id))  # without it nothing brings the mesh back
    remove_folder(blobs, layout.mesh_folder(mesh_id))
    if blobs.stat(layout.mesh_arrays(mesh_id)) is None:  # else it was uploaded anew, with all its files
        # An upload of the same bytes may have found files still there, and recorded the mesh.
        blobs.delete(layout.mesh_record(mesh_id))
        with suppress(MeshNotFoundError, MeshInUseError):
            meshes.delete(mesh_id)
