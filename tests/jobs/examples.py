"""A small mesh and jobs on it, for tests of everything around the mathematics."""

from __future__ import annotations

from functools import cache

from spherify.geometry.mesh import TriangleMesh
from spherify.geometry.samples import SAMPLES
from spherify.geometry.schedule import SnapshotPlan
from spherify.jobs import layout
from spherify.jobs.codec import dump_record
from spherify.jobs.ids import job_id_at, new_job_id
from spherify.jobs.model import (
    JobError,
    JobSpec,
    JobStatus,
    MeshRecord,
    Outcome,
    Progress,
    RequestKey,
    Snapshot,
)
from spherify.jobs.ports import BlobStore, MeshStore
from spherify.jobs.results import Result
from spherify.parameters import resolve
from spherify.stores.arrays import dump_arrays

MESH_ID = "mesh_0123456789abcdefghjkmnpqrs"
OTHER_MESH = "mesh_" + "1" * 26
ENDLESS = {"iterations": 1_000_000, "annealing": None, "stop_radius_variation": 0}
"""Changes of the preset robust after which only a cancel ends it."""


@cache
def stone(vertices: int = 60) -> TriangleMesh:
    """A small closed mesh on which the preset robust passes its best state."""
    return SAMPLES["stone"].build(vertices)


def store_mesh(meshes: MeshStore, blobs: BlobStore, mesh: TriangleMesh, mesh_id: str = MESH_ID) -> None:
    """Put a mesh where runners look for it, and record it."""
    arrays = {"vertices": mesh.vertices, "faces": mesh.faces}
    blobs.create(layout.mesh_arrays(mesh_id), dump_arrays(arrays))
    blobs.create(layout.mesh_record(mesh_id), dump_record(mesh_record(mesh_id)).encode())
    meshes.add(mesh_record(mesh_id))


def job_spec(
    *,
    iterations: int = 3,
    snapshots: str = "",
    preset: str = "robust",
    mesh_id: str = MESH_ID,
    tags: tuple[str, ...] = (),
    at: float | None = None,
    request: RequestKey | None = None,
    **overrides: object,
) -> JobSpec:
    """Return a spec with a new id, or one of a given time."""
    job_id, created_at = new_job_id()
    if at is not None:
        job_id, created_at = job_id_at(at), at
    iterations = int(str(overrides.pop("iterations", iterations)))
    parameters = resolve(preset, {"iterations": iterations, **overrides})
    plan = SnapshotPlan.parse(snapshots, iterations)
    return JobSpec(
        id=job_id,
        mesh_id=mesh_id,
        name="stone",
        tags=tags,
        preset=preset,
        parameters=parameters.model_dump(mode="json"),
        snapshots_requested=plan.iterations,
        created_at=created_at,
        request=request,
    )


def mesh_record(mesh_id: str = MESH_ID, *, created_at: float = 1.0) -> MeshRecord:
    """Return the record of a mesh."""
    return MeshRecord(
        id=mesh_id,
        name="stone.obj",
        sha256="0" * 64,
        size=10,
        format="obj",
        allow=(),
        report={"vertices": 3},
        created_at=created_at,
    )


def result_of(job_id: str, token: int) -> Result:
    return Result(
        job_id,
        token,
        Outcome(JobStatus.FAILED, "collapsed", "it broke", 1, 1, JobError("collapsed", "it broke; try ü")),
        Progress(2, 3, 1.0, 1.0, 2.0),
        (Snapshot(0, "k", "s", 1, {"sphericity": 0.5}, 1.0), Snapshot(1, "l", "t", 2, {}, 2.0)),
        ({"iteration": 0, "sphericity": 0.5}, {"iteration": 1, "sphericity": 0.1 + 0.2}),
    )
