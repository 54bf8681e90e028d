"""The part of a worker, played on a job store."""

from __future__ import annotations

from spherify.jobs.model import JobStatus, Outcome, Snapshot
from spherify.jobs.ports import ClaimOutcome, JobStore
from tests.jobs.examples import job_spec

DONE = Outcome(JobStatus.SUCCESSFUL, "converged", "round", result_iteration=3, best_iteration=2)


def snapshot(iteration: int, key: str = "k") -> Snapshot:
    """Return a snapshot of no file."""
    return Snapshot(iteration, key, "0" * 64, 8, {"sphericity": 0.5}, 1.0)


def running(jobs: JobStore) -> tuple[str, int]:
    """Submit a job and claim it; returns its id and the token."""
    job = jobs.add(job_spec())
    claim = jobs.claim(job.id, "w")
    assert claim.outcome is ClaimOutcome.CLAIMED
    return job.id, claim.token
