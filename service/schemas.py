"""The answers' JSON, and the translation of records into it. Times are RFC 3339 in UTC, links absolute paths."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Annotated, Any, Generic, TypeVar

from pydantic import BaseModel, ConfigDict, Field

from service.snapshots import best_iteration
from spherify.formats import FORMATS_OUT
from spherify.geometry.fields import FIELDS
from spherify.jobs.continuation import may_be_extended, may_be_retried
from spherify.jobs.model import Job, JobStatus, MeshRecord, Snapshot
from spherify.parameters import Parameters, stored_parameters

T = TypeVar("T")
Links = Annotated[dict[str, str], Field(description="Absolute paths of what belongs to this, by name.")]


class Answer(BaseModel):
    """Base of every answer."""

    model_config = ConfigDict(frozen=True)


class FiguresOut(Answer):
    """Figures of one state, in the unit of the mesh; null where one cannot be computed."""

    sphericity: float | None = Field(None, description="π^⅓(6V)^⅔/A: 1 for a sphere.")
    area: float | None = None
    volume: float | None = None
    radius_variation: float | None = Field(
        None, description="Standard deviation of the distance to the centroid over its mean: 0 for a sphere."
    )
    radius_ratio: float | None = Field(None, description="Least over greatest distance to the centroid.")
    curvature_min: float | None = None
    curvature_max: float | None = None
    step: float | None = Field(
        None, description="C in use, a length; of a flow the square root of its time step."
    )
    mean_quality: float | None = Field(
        None, description="Mean of 4√3·area/Σ(edge²): 1 if all are equilateral."
    )
    least_quality: float | None = None
    inward_faces: int | None = Field(None, description="Triangles that look towards the centroid.")


class RowOut(FiguresOut):
    """Figures at one iteration."""

    iteration: int


class MetricsOut(Answer):
    """The time series of a job: dense at first, then each twentieth or some 500, every snapshot, and the end."""

    job_id: str
    rows: list[RowOut]


class PageOut(Answer, Generic[T]):
    """A slice of a listing, newest first."""

    items: list[T]
    next_cursor: str | None = Field(
        description="Send it as `cursor` for the next slice; null at the end. The same is in the `Link` header."
    )
    links: Links


class MeshOut(Answer):
    """An accepted mesh."""

    id: str = Field(examples=["mesh_4T9V0K2J7C8N5R1W3X6Y0ZQABD"])
    name: str = Field(description="File name of the first upload, made safe.", examples=["bunny.obj"])
    sha256: str = Field(description="Of the uploaded bytes.")
    size: int = Field(description="Of the uploaded bytes.")
    format: str = Field(description="What the content is.", examples=["obj"])
    allow: list[str] = Field(description="The switches that let it in.")
    report: dict[str, Any] = Field(
        description="Vertices, faces, components, genus, Euler number, boundary, bounding box, area, volume, "
        "sphericity, what was repaired and what is wrong."
    )
    created_at: datetime
    expires_at: datetime | None = Field(description="null: kept until it is deleted.")
    links: Links


class ProgressOut(Answer):
    """How far the iterating is."""

    percent: float = Field(
        ge=0, le=100, description="100 only when the results are durable; stays where a failed job stopped."
    )
    iteration: int
    iterations_total: int = Field(description="Iterations at most; a run may end before (see `stop_reason`).")
    iterations_per_s: float | None
    eta_s: float | None = Field(description="If no stopping rule ends the run before.")
    elapsed_s: float


class QueueOut(Answer):
    """Where a waiting job stands."""

    position: int | None = Field(description="0 is next; null unless accepted.")


class JobSnapshotsOut(Answer):
    """Iterations at which a state is kept."""

    requested: list[int]
    available: list[int]


class JobErrorOut(Answer):
    """Why a job failed."""

    code: str
    detail: str


class JobOut(Answer):
    """A job."""

    id: str = Field(examples=["job_01K5Z9Q8M4T6V2X0Y7R3N1W5BC"])
    mesh_id: str
    parent_id: str | None = Field(
        description="The job this one goes on from; null if it began with its mesh."
    )
    name: str
    tags: list[str]
    status: JobStatus
    done: bool = Field(
        description="True for exactly successful, failed and cancelled: it will never move again."
    )
    rev: int = Field(description="Rises with every change.")
    preset: str
    parameters: Parameters
    progress: ProgressOut
    queue: QueueOut
    metrics: FiguresOut | None = Field(description="The newest figures; null before the first.")
    snapshots: JobSnapshotsOut
    attempt: int = Field(
        description="Runs started; above 1 after a worker was lost: the run goes on where it was."
    )
    stop_reason: str | None = Field(
        description="How the mathematics ended: iterations, converged, stalled, constant-curvature, collapsed, "
        "cancelled or deadline. How round the result is, `metrics` says: a sphere may be the end of any of them."
    )
    stop_detail: str | None
    best_iteration: int | None = Field(description="Kept state of the highest sphericity.")
    result_iteration: int | None = Field(description="The state that is the result, `snapshots/final`.")
    error: JobErrorOut | None
    created_at: datetime
    started_at: datetime | None = Field(description="When computing started.")
    finished_at: datetime | None
    expires_at: datetime | None = Field(description="null: kept until it is deleted.")
    links: Links


class SnapshotOut(Answer):
    """One kept state."""

    job_id: str
    iteration: int
    sha256: str = Field(description="Of the stored state.")
    metrics: FiguresOut
    created_at: datetime
    links: Links


class SnapshotsOut(Answer):
    """The kept states of a job, ascending."""

    job_id: str
    done: bool = Field(description="False while more may come.")
    requested: list[int]
    items: list[SnapshotOut]
    links: Links


class LocationOut(BaseModel):
    """One place of a defect."""

    kind: str = Field(description="vertex, edge, or component (told by its first vertex).")
    indices: list[int] = Field(description="Vertices, from 0, as the file has them: of an edge both ends.")
    positions: list[tuple[float, float, float]] = Field(description="Where these lie, in the file's unit.")


class FieldErrorOut(BaseModel):
    """One wrong value, or one defect of a mesh."""

    model_config = ConfigDict(extra="allow")

    pointer: str = Field(examples=["#/parameters/step", "query/limit", "form/file"])
    code: str
    detail: str
    locations: list[LocationOut] = Field(
        default=[],
        description="Of a refused mesh: where the defect lies (open edges, edges with three faces, pinch vertices, "
        "components), the first 500.",
    )


class ProblemOut(BaseModel):
    """RFC 9457 problem details: the answer to everything that went wrong."""

    model_config = ConfigDict(extra="allow")

    type: str = Field(
        description="Where this kind of problem is documented.", examples=["/problems/mesh-not-closed"]
    )
    title: str
    status: int
    detail: str = Field(description="What happened, and how to mend it.")
    instance: str = Field(description="The path that was asked.")
    request_id: str = Field(description="The same as in the header `X-Request-ID` and in the service's log.")
    errors: list[FieldErrorOut]


def moment(seconds: float) -> datetime:
    """Return a time from seconds since the epoch."""
    return datetime.fromtimestamp(seconds, UTC)


def _moment_or_none(seconds: float | None) -> datetime | None:
    return None if seconds is None else moment(seconds)


def finite(row: Mapping[str, float | int]) -> dict[str, float | int | None]:
    """Return figures with null for what JSON has no number for."""
    return {name: value if math.isfinite(value) else None for name, value in row.items()}


def figures(row: Mapping[str, float | int]) -> FiguresOut:
    """Translate named figures."""
    return FiguresOut.model_validate(finite(row))


def mesh_out(record: MeshRecord) -> MeshOut:
    """Translate a mesh."""
    path = f"/v1/meshes/{record.id}"
    forms = {form: f"{path}/content.{form}" for form in FORMATS_OUT}
    return MeshOut(
        id=record.id,
        name=record.name,
        sha256=record.sha256,
        size=record.size,
        format=record.format,
        allow=list(record.allow),
        report=record.report,
        created_at=moment(record.created_at),
        expires_at=None,
        links={
            "self": path,
            "jobs": f"/v1/jobs?mesh_id={record.id}",
            "content": f"{path}/content",
            "topology": f"{path}/topology",
            "positions": f"{path}/positions",
            **forms,
        },
    )


def percent(job: Job) -> float:
    """Return how much is done: 100 exactly for successful jobs, and less for all others."""
    if job.status is JobStatus.SUCCESSFUL:
        return 100.0
    if job.progress is None or job.progress.iterations_total == 0:
        return 0.0
    share = 100 * job.progress.iteration / job.progress.iterations_total
    return min(math.floor(share * 10) / 10, 99.9)


def job_out(job: Job) -> JobOut:
    """Translate a job."""
    progress = job.progress
    return JobOut(
        id=job.id,
        mesh_id=job.spec.mesh_id,
        parent_id=job.spec.parent_id,
        name=job.spec.name,
        tags=list(job.spec.tags),
        status=job.status,
        done=job.status.done,
        rev=job.rev,
        preset=job.spec.preset,
        parameters=stored_parameters(job.spec.parameters),
        progress=ProgressOut(
            percent=percent(job),
            iteration=progress.iteration if progress else 0,
            iterations_total=progress.iterations_total if progress else job.spec.parameters["iterations"],
            iterations_per_s=progress.iterations_per_s if progress else None,
            eta_s=progress.eta_s if progress and not job.status.done else None,
            elapsed_s=progress.elapsed_s if progress else 0.0,
        ),
        queue=QueueOut(position=job.queue_position),
        metrics=figures(job.metrics) if job.metrics else None,
        snapshots=JobSnapshotsOut(
            requested=list(job.spec.snapshots_requested),
            available=[snapshot.iteration for snapshot in job.snapshots],
        ),
        attempt=job.attempt,
        stop_reason=job.stop_reason,
        stop_detail=job.stop_detail,
        best_iteration=best_iteration(job),
        result_iteration=job.result_iteration,
        error=JobErrorOut(code=job.error.code, detail=job.error.detail) if job.error else None,
        created_at=moment(job.spec.created_at),
        started_at=_moment_or_none(job.started_at),
        finished_at=_moment_or_none(job.finished_at),
        expires_at=None,
        links=_job_links(job),
    )


def _job_links(job: Job) -> dict[str, str]:
    path = f"/v1/jobs/{job.id}"
    links = {
        "self": path,
        "mesh": f"/v1/meshes/{job.spec.mesh_id}",
        "snapshots": f"{path}/snapshots",
        "metrics": f"{path}/metrics",
        "metrics_csv": f"{path}/metrics.csv",
        "events": f"{path}/events",
        "topology": f"{path}/topology",
    }
    if job.spec.parent_id is not None:
        links["parent"] = f"/v1/jobs/{job.spec.parent_id}"
    if not job.status.done:
        links["cancel"] = f"{path}/cancel"
    if may_be_extended(job):
        links["extend"] = f"{path}/extend"
    if may_be_retried(job):
        links["retry"] = f"{path}/retry"
    if job.status.done:
        links["archive"] = f"{path}/archive.zip"
    if job.snapshots:
        links["latest"] = f"{path}/snapshots/latest"
    if best_iteration(job) is not None:
        links["best"] = f"{path}/snapshots/best"
    if job.result_iteration is not None:
        links["final"] = f"{path}/snapshots/final"
    return links


def snapshot_out(job_id: str, snapshot: Snapshot) -> SnapshotOut:
    """Translate a snapshot."""
    path = f"/v1/jobs/{job_id}/snapshots/{snapshot.iteration}"
    return SnapshotOut(
        job_id=job_id,
        iteration=snapshot.iteration,
        sha256=snapshot.sha256,
        metrics=figures(snapshot.metrics),
        created_at=moment(snapshot.created_at),
        links={
            "self": path,
            "job": f"/v1/jobs/{job_id}",
            "topology": f"/v1/jobs/{job_id}/topology",
            "positions": f"{path}/positions",
            **{field: f"{path}/fields/{field}" for field in FIELDS},
            **{form: f"{path}.{form}" for form in FORMATS_OUT},
        },
    )


def snapshots_out(job: Job) -> SnapshotsOut:
    """Translate all snapshots of a job."""
    path = f"/v1/jobs/{job.id}"
    return SnapshotsOut(
        job_id=job.id,
        done=job.status.done,
        requested=list(job.spec.snapshots_requested),
        items=[snapshot_out(job.id, snapshot) for snapshot in job.snapshots],
        links={"self": f"{path}/snapshots", "job": path},
    )


def metrics_out(job_id: str, rows: Sequence[Mapping[str, float | int]]) -> MetricsOut:
    """Translate the time series."""
    return MetricsOut(job_id=job_id, rows=[RowOut.model_validate(finite(row)) for row in rows])
