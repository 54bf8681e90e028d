"""Delete jobs and meshes: the record first, so that nothing points at a file that is gone."""

from __future__ import annotations

from spherify.jobs import layout
from spherify.jobs.ports import BlobStore, JobStore, MeshStore
from spherify.jobs.settle import remove_folder, settle


def delete_job(jobs: JobStore, blobs: BlobStore, job_id: str) -> None:
    """Forget a finished job and remove its files; raises as `JobStore.delete` does."""
    jobs.delete(job_id)
    settle(jobs, blobs, job_id)


def delete_mesh(meshes: MeshStore, blobs: BlobStore, mesh_id: str) -> None:
    """Forget a mesh no job names and remove its files; raises as `MeshStore.delete` does."""
    meshes.delete(mesh_id)
    remove_folder(blobs, layout.mesh_folder(mesh_id))
