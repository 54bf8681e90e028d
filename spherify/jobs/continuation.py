"""Go on from where another job ended: with more iterations, or once more.

The new job takes over what the old one kept, as if an earlier attempt of its own had: a worker finds the newest state
and goes on from it, so that every state and figure from there is that of one longer run, bit for bit. The files are
the new job's own; deleting the old one takes nothing from it.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from typing import Any, Final

from spherify.geometry.errors import InvalidConfigError
from spherify.geometry.flow import StopReason
from spherify.geometry.schedule import MAX_SNAPSHOTS, SnapshotPlan
from spherify.jobs import layout
from spherify.jobs.errors import (
    BlobExistsError,
    JobCannotGoOnError,
    JobNotFinishedError,
    JobsError,
)
from spherify.jobs.ids import time_of
from spherify.jobs.model import Job, JobSpec, JobStatus
from spherify.jobs.ports import BlobStore, JobQueue, JobStore
from spherify.jobs.settle import remove_folder
from spherify.jobs.submit import submit

_OPEN_ENDS: Final = frozenset({None, StopReason.ITERATIONS, StopReason.CANCELLED, StopReason.DEADLINE})


def last_iteration(job: Job) -> int:
    """Return the iteration of the newest kept state, 0 if none is kept."""
    return max((snapshot.iteration for snapshot in job.snapshots), default=0)


def may_be_extended(job: Job) -> bool:
    """Whether more iterations would lead further than a job came."""
    return job.status.done and job.stop_reason in _OPEN_ENDS


def may_be_retried(job: Job) -> bool:
    """Whether another attempt at a job may do what it did not."""
    return may_be_extended(job) and job.status is not JobStatus.SUCCESSFUL


def extension(parent: Job, job_id: str, more: int, wanted: str | Iterable[int]) -> JobSpec:
    """Return the job that goes on from the last state of another.

    Args:
        parent: ended by its iterations, a cancel or a deadline; any other end would only be met again.
        job_id: of the new job.
        more: iterations beyond the last one of the parent.
        wanted: a plan as `SnapshotPlan.parse` reads it. Iterations go on counting where the parent ended, and those
            up to there are the parent's; ``log:N`` spreads N states from there.

    Raises:
        JobNotFinishedError, JobCannotGoOnError: of the parent.
        InvalidConfigError: of the plan.

    """
    _check_ended(parent)
    if not may_be_extended(parent):
        raise JobCannotGoOnError(
            f"{parent.id} ended by itself, as {parent.stop_reason}: more iterations would end in the same state. "
            "Submit its mesh with other parameters"
        )
    last = last_iteration(parent)
    total = last + more
    if isinstance(wanted, str) and wanted.strip().startswith("log"):
        new = {last + i for i in SnapshotPlan.parse(wanted, more).iterations}
    else:
        new = set(SnapshotPlan.parse(wanted, total).iterations)
    kept = {snapshot.iteration for snapshot in parent.snapshots} & {*parent.spec.snapshots_requested, last}
    plan = tuple(sorted({0, *kept, *(i for i in new if i > last)}))
    if len(plan) > MAX_SNAPSHOTS:
        raise InvalidConfigError(
            f"with the {len(kept)} of the parent these are {len(plan)} snapshots, and at most {MAX_SNAPSHOTS} are kept"
        )
    return _child(parent, job_id, parent.spec.parameters | {"iterations": total}, plan)


def repetition(parent: Job, job_id: str) -> JobSpec:
    """Return the job that does what a failed or cancelled one did not, from its last state on.

    Raises:
        JobNotFinishedError, JobCannotGoOnError: of the parent.

    """
    _check_ended(parent)
    if parent.status is JobStatus.SUCCESSFUL:
        raise JobCannotGoOnError(
            f"{parent.id} was successful: there is nothing to do again. Extend it for more"
        )
    if not may_be_retried(parent):
        raise JobCannotGoOnError(
            f"{parent.id} ended as {parent.stop_reason}, and the same parameters would end it in the same iteration. "
            "Submit its mesh with others"
        )
    return _child(parent, job_id, parent.spec.parameters, parent.spec.snapshots_requested)


def submit_continuation(jobs: JobStore, blobs: BlobStore, queue: JobQueue, parent: Job, spec: JobSpec) -> Job:
    """Hand the parent's states over to the new job, then submit it; doing it again with the same spec is harmless.

    Raises:
        JobNotFoundError, JobGoneError: the parent was deleted meanwhile.
        StorageFullError, MeshNotFoundError, StoreUnavailableError: as `submit` does.

    """
    try:
        for snapshot in parent.snapshots:
            planned = snapshot.iteration in spec.snapshots_requested
            if planned or snapshot.iteration == last_iteration(parent):
                folder = layout.snapshots(spec.id) if planned else layout.checkpoints(spec.id)
                with suppress(BlobExistsError):  # this was begun before
                    blobs.copy(snapshot.key, layout.numbered(folder, 0, snapshot.iteration))
        jobs.get(parent.id)  # if it was deleted meanwhile, files may be missing
        return submit(jobs, blobs, queue, spec)
    except JobsError:
        if blobs.stat(layout.spec(spec.id)) is None:
            remove_folder(blobs, layout.job_folder(spec.id))
        raise


def _check_ended(job: Job) -> None:
    if not job.status.done:
        raise JobNotFinishedError(
            f"{job.id} is {job.status}: wait for its end, or cancel it, then go on from there"
        )


def _child(parent: Job, job_id: str, parameters: dict[str, Any], plan: tuple[int, ...]) -> JobSpec:
    return replace(
        parent.spec,
        id=job_id,
        parent_id=parent.id,
        request=None,
        parameters=parameters,
        snapshots_requested=plan,
        created_at=time_of(job_id),
    )
