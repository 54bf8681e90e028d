"""Job, its states and their legal moves, progress, snapshots, and the record of a mesh.

                      a                       b
          submit ─► accepted ───claim──► running ───commit──► successful | failed
                     │ │ ▲                 │  │
                   e │ │ └──── c: lost or ─┘  │ d: cancel asked
                     │ │       released       ▼
                     │ └─────────────────► cancelling ──f──► cancelled
                     └───────────────────────────────────────────▲

a claim · b commit · c the lease ran out, or the worker hands the job on · d, e cancel; e ends at once what was never
claimed · f the runner has stopped, or there was none.
A job that lost its worker too often, or is cancelling, does not wait again: it stays as it is until whoever claims it
has ended it. As every end, that is written to ``result.json`` before the record says it; where an attempt wrote another
end there, and did not live to tell, that end counts, and is recorded by arrow b from any state in which somebody holds
the job.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Final


class JobStatus(StrEnum):
    """Where a job is in its life; the names are those of OGC API - Processes, and `cancelled`."""

    ACCEPTED = "accepted"
    RUNNING = "running"
    CANCELLING = "cancelling"
    SUCCESSFUL = "successful"
    FAILED = "failed"
    CANCELLED = "cancelled"

    @property
    def done(self) -> bool:
        """Whether the job will never move again."""
        return self in TERMINAL


TERMINAL: Final = frozenset({JobStatus.SUCCESSFUL, JobStatus.FAILED, JobStatus.CANCELLED})
LEGAL_MOVES: Final = {
    JobStatus.ACCEPTED: frozenset({JobStatus.RUNNING, JobStatus.CANCELLING, JobStatus.CANCELLED}),
    JobStatus.RUNNING: frozenset({JobStatus.ACCEPTED, JobStatus.CANCELLING, *TERMINAL}),
    JobStatus.CANCELLING: TERMINAL,
    JobStatus.SUCCESSFUL: frozenset[JobStatus](),
    JobStatus.FAILED: frozenset[JobStatus](),
    JobStatus.CANCELLED: frozenset[JobStatus](),
}


@dataclass(frozen=True, slots=True)
class Progress:
    """How far the iterating is.

    Attributes:
        iteration: iterations done.
        iterations_total: iterations at most; a run may end before.
        iterations_per_s: rate over the last seconds; None before it is known.
        eta_s: seconds left at that rate if no stopping rule ends the run first; None before it is known.
        elapsed_s: seconds since computing started, over this attempt.

    """

    iteration: int
    iterations_total: int
    iterations_per_s: float | None = None
    eta_s: float | None = None
    elapsed_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Snapshot:
    """One kept state of a run: its file is complete and durable before this record exists.

    Attributes:
        iteration: iterations done at this state.
        key: the blob that holds it, a checkpoint in the form of `spherify.stores.arrays`.
        sha256: of that blob but for the checksum that ends it, which this is; hexadecimal.
        size: of that blob, bytes.
        metrics: the named figures of `spherify.geometry.metrics.Metrics`.
        created_at: seconds since the epoch.

    """

    iteration: int
    key: str
    sha256: str
    size: int
    metrics: dict[str, float | int]
    created_at: float


@dataclass(frozen=True, slots=True)
class JobError:
    """Why a job failed: a problem code and a sentence that says what to do next."""

    code: str
    detail: str


@dataclass(frozen=True, slots=True)
class RequestKey:
    """The Idempotency-Key that a job was asked for under, see `spherify.jobs.repeats`.

    Attributes:
        name: hash of the operation and the key.
        fingerprint: hash of what was asked.

    """

    name: str
    fingerprint: str


@dataclass(frozen=True, slots=True)
class JobSpec:
    """What was asked, immutable: written once as ``jobs/{id}/spec.json`` before anything else exists.

    Attributes:
        parameters: every parameter, resolved: the JSON form of `spherify.parameters.Parameters`.
        snapshots_requested: iterations at which a state is kept, ascending, 0 and the last one included.
        parent_id: the job this one goes on from, None if it began with its mesh.
        request: the key of the request that made it, None if that had none.

    """

    id: str
    mesh_id: str
    name: str
    tags: tuple[str, ...]
    preset: str
    parameters: dict[str, Any]
    snapshots_requested: tuple[int, ...]
    created_at: float
    parent_id: str | None = None
    request: RequestKey | None = None


@dataclass(frozen=True, slots=True)
class Job:
    """The live record of one job, as read at one moment.

    Attributes:
        rev: rises with every change; the API's weak ETag.
        token: fencing token of the present or last attempt, 0 before the first.
        attempt: runs started so far.
        losses: runs whose worker was lost.
        metrics: the newest figures, empty before the first.
        snapshots: kept states by iteration, ascending.
        result_iteration: iteration of the state that is the result, None before the end.
        best_iteration: kept state of the highest sphericity, None before the first.
        stop_reason: how the mathematics ended, a value of `spherify.geometry.flow.StopReason`.
        lease_until: seconds since the epoch; None unless a worker holds the job.
        queue_position: 0 is next; None unless accepted.

    """

    spec: JobSpec
    status: JobStatus = JobStatus.ACCEPTED
    rev: int = 1
    token: int = 0
    attempt: int = 0
    losses: int = 0
    worker: str | None = None
    lease_until: float | None = None
    progress: Progress | None = None
    metrics: dict[str, float | int] = field(default_factory=dict)
    snapshots: tuple[Snapshot, ...] = ()
    best_iteration: int | None = None
    result_iteration: int | None = None
    stop_reason: str | None = None
    stop_detail: str | None = None
    error: JobError | None = None
    started_at: float | None = None
    finished_at: float | None = None
    queue_position: int | None = None

    @property
    def id(self) -> str:
        """The job's identifier, ``job_`` and a ULID."""
        return self.spec.id


@dataclass(frozen=True, slots=True)
class Outcome:
    """How an attempt ended, to be committed.

    Attributes:
        status: successful, failed or cancelled.
        result_iteration: iteration of the snapshot that is the result; None if there is none.

    """

    status: JobStatus
    stop_reason: str | None = None
    stop_detail: str | None = None
    result_iteration: int | None = None
    best_iteration: int | None = None
    error: JobError | None = None


@dataclass(frozen=True, slots=True)
class MeshRecord:
    """An accepted mesh: immutable, written once as ``meshes/{id}/record.json``.

    Attributes:
        id: ``mesh_`` and 26 base-32 digits of the hash of (content, allow switches): the same bytes read the
            same way are the same mesh.
        name: file name of the first upload, made safe.
        sha256: of the uploaded bytes, hexadecimal.
        size: of the uploaded bytes.
        format: obj, ply, stl, off, glb or 3mf.
        allow: the switches that let it in, sorted.
        report: the JSON form of `spherify.formats.report.MeshReport`.
        created_at: seconds since the epoch.

    """

    id: str
    name: str
    sha256: str
    size: int
    format: str
    allow: tuple[str, ...]
    report: dict[str, Any]
    created_at: float
