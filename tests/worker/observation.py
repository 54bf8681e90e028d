"""What tests of real workers look at: jobs, log lines, processes."""

from __future__ import annotations

import json
from pathlib import Path

from spherify.jobs import layout
from spherify.jobs.errors import StoreUnavailableError
from spherify.jobs.model import Job, JobSpec, JobStatus
from spherify.jobs.results import Result, read_result
from spherify.jobs.submit import submit
from tests.jobs.examples import ENDLESS
from tests.stack import Stack, wait_for

LONG = {**ENDLESS, "iterations": 1600, "snapshots": "every:200"}
"""Changes that make a job of about a second, so that something can happen to it under way."""


def submitted(stack: Stack, spec: JobSpec) -> str:
    return submit(stack.stores.jobs, stack.stores.blobs, stack.stores.queue, spec).id


def finished(stack: Stack, job_id: str) -> Job:
    return wait_for(
        lambda: job if (job := stack.stores.jobs.get(job_id)).status.done else None,
        limit_s=60,
        what=f"the end of {job_id}, see {stack.data_dir}",
    )


def finished_after_all(stack: Stack, job_id: str) -> Job:
    """Wait for the end of a job of which the server may say that it does not know."""

    def look() -> Job | None:
        try:
            job = stack.stores.jobs.get(job_id)
        except StoreUnavailableError:
            return None
        return job if job.status.done else None

    return wait_for(look, limit_s=60, what=f"the end of {job_id}, see {stack.data_dir}")


def under_way(stack: Stack, job_id: str, iteration: int = 0) -> Job:
    """Wait until a job is computing and a snapshot at or after an iteration is known."""
    return wait_for(
        lambda: (
            job
            if (job := stack.stores.jobs.get(job_id)).snapshots and job.snapshots[-1].iteration >= iteration
            else None
        ),
        what=f"iteration {iteration} of {job_id}, see {stack.data_dir}",
    )


def hashes(job: Job) -> dict[int, str]:
    return {snapshot.iteration: snapshot.sha256 for snapshot in job.snapshots}


def log_lines(stack: Stack, job_id: str) -> list[dict[str, object]]:
    lines = [line for path in stack.data_dir.glob("worker-*.log") for line in path.read_text().splitlines()]
    parsed = [json.loads(line) for line in lines if line.startswith("{")]
    return [line for line in parsed if line.get("job_id") == job_id]


def actions(stack: Stack, job_id: str) -> list[str]:
    """Return what the log says of a job, but for the reconciler and the second deliveries that come of it."""
    found = [str(line["action"]) for line in log_lines(stack, job_id)]
    return [action for action in found if action != "drop" and not action.startswith("reconcile-")]


def runner_of(stack: Stack, job_id: str) -> int:
    """Return the process id of the runner that works on a job."""
    starts = [line for line in log_lines(stack, job_id) if line["action"] == "start"]
    return int(str(starts[-1]["message"]).rpartition(" ")[2])


def parent_of(pid: int) -> int:
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def check_whole(stack: Stack, job: Job) -> Result:
    """Assert that record, files and result of a successful job say the same."""
    assert job.error is None
    assert (job.status, job.worker, job.lease_until) == (JobStatus.SUCCESSFUL, None, None)
    result = read_result(stack.stores.blobs, job.id)
    assert result is not None
    assert result.outcome.status is job.status
    assert tuple(result.snapshots) == job.snapshots
    assert list(result.rows) == stack.stores.jobs.metrics(job.id)
    assert result.progress == job.progress
    wait_for(lambda: not list(stack.stores.blobs.list(layout.checkpoints(job.id))))  # swept after the record
    return result
