"""What the end of a run means for its job."""

from __future__ import annotations

from spherify.geometry.flow import StopReason
from spherify.jobs.model import JobError, JobStatus, Outcome
from spherify.jobs.run import RunEnd

DEADLINE_ADVICE = "the last state is kept as the result; ask for fewer iterations or a smaller mesh"


def internal_error(job_id: str, what: str) -> JobError:
    """Return the error of a job that failed by a fault of ours."""
    detail = (
        f"a fault of the service: {what}; the worker's log has the trace under {job_id}. Please report it"
    )
    return JobError("internal-error", detail)


def worker_lost(losses: int) -> JobError:
    """Return the error of a job that lost that many workers, one more than it may."""
    detail = f"its worker was lost {losses} times, the last time without a word: most often the memory was not enough"
    return JobError("worker-lost", detail)


def outcome_of(end: RunEnd) -> Outcome:
    """Return how a job ends whose run ended so.

    A numerical end (iterations, converged, stalled, constant curvature) is a success: the result is the last
    state. A collapse is a failure with the best state as its result. A deadline is a failure too, with the last
    state: what was asked for was not done. A cancelled job has snapshots and no result.

    Raises:
        ValueError: the run was handed on; its job has not ended.

    """
    if end.stop_reason is None:
        raise ValueError("a run that was handed on has not ended")
    error = None
    status = JobStatus.SUCCESSFUL
    if end.stop_reason is StopReason.COLLAPSED:
        status = JobStatus.FAILED
        error = JobError(
            "collapsed",
            f"{end.stop_detail} (sphericity {end.sphericity:.4f}); the snapshots up to there are kept. "
            "The preset robust gets through most meshes that do this.",
        )
    elif end.stop_reason is StopReason.DEADLINE:
        status = JobStatus.FAILED
        error = JobError("deadline", f"{end.stop_detail}; {DEADLINE_ADVICE}")
    elif end.stop_reason is StopReason.CANCELLED:
        status = JobStatus.CANCELLED
    return Outcome(
        status=status,
        stop_reason=end.stop_reason.value,
        stop_detail=end.stop_detail,
        result_iteration=None if status is JobStatus.CANCELLED else end.iteration,
        best_iteration=end.best_iteration,
        error=error,
    )
