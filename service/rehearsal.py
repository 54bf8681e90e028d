"""A job asked for with ``dry_run``: what it would be, and what it would take; nothing is queued."""

from __future__ import annotations

from pydantic import Field

from service.requests import JobPlan
from service.schemas import Answer, JobSnapshotsOut, MeshOut, mesh_out
from spherify.jobs.estimate import estimate
from spherify.jobs.model import MeshRecord
from spherify.parameters import Parameters


class EstimateOut(Answer):
    """What the job would take if it does all its iterations, good to a factor of two or three; most end before."""

    seconds: float = Field(description="Of computing, once a worker has taken it.")
    memory_bytes: int = Field(description="Of the process that computes.")
    storage_bytes: int = Field(description="Of the kept states.")


class DryRunOut(Answer):
    """A job that would be accepted."""

    mesh: MeshOut = Field(description="A mesh that came with the request is kept, for the job to name.")
    name: str
    tags: list[str]
    preset: str
    parameters: Parameters
    snapshots: JobSnapshotsOut
    estimate: EstimateOut


def rehearsed(planned: JobPlan, mesh: MeshRecord, name: str | None = None) -> DryRunOut:
    """Describe the job that a plan would make on a mesh."""
    iterations = planned.parameters.iterations
    taken = estimate(planned.parameters.config(), iterations, mesh.report["vertices"], len(planned.snapshots))
    return DryRunOut(
        mesh=mesh_out(mesh),
        name=planned.named(mesh, name),
        tags=list(planned.tags),
        preset=planned.preset,
        parameters=planned.parameters,
        snapshots=JobSnapshotsOut(requested=list(planned.snapshots), available=[]),
        estimate=EstimateOut(
            seconds=round(taken.seconds, 2),
            memory_bytes=taken.memory_bytes,
            storage_bytes=taken.storage_bytes,
        ),
    )
