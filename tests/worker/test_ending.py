"""What an attempt writes as its job's end, whatever its runner came to tell and its record knows."""

from __future__ import annotations

from spherify.jobs.cancel import cancel
from spherify.jobs.model import JobStatus, Outcome, Progress, Snapshot
from spherify.jobs.ports import CancelOutcome
from spherify.jobs.results import read_result
from spherify.jobs.submit import submit
from spherify.stores.connect import Stores
from tests.jobs.examples import job_spec
from worker.ending import Ending


def ending_of(stores: Stores, job_id: str) -> Ending:
    """Claim a job as a worker does."""
    token = stores.jobs.claim(job_id, "w").token
    return Ending(stores.jobs, stores.blobs, stores.queue, job_id, token)


def test_a_cancel_before_the_runner_is_ready_names_what_an_earlier_attempt_kept(stores: Stores) -> None:
    spec = job_spec()
    submit(stores.jobs, stores.blobs, stores.queue, spec)
    former = stores.jobs.claim(spec.id, "former").token
    for iteration, sphericity in ((0, 0.5), (2, 0.7)):
        figures = {"sphericity": sphericity}
        stores.jobs.add_snapshot(spec.id, former, Snapshot(iteration, "k", "s", 1, figures, 1.0))
        stores.jobs.report(
            spec.id, former, Progress(iteration, 3), [{"iteration": iteration, "sphericity": sphericity}]
        )
    stores.jobs.lose(spec.id, former)
    ending = ending_of(stores, spec.id)
    assert cancel(stores.jobs, stores.blobs, spec.id) is CancelOutcome.CANCELLING
    ending.commit(Outcome(JobStatus.CANCELLED, best_iteration=ending.outbox.best), None)
    job, result = stores.jobs.get(spec.id), read_result(stores.blobs, spec.id)
    assert result is not None
    assert (job.status, result.outcome.status) == (JobStatus.CANCELLED, JobStatus.CANCELLED)
    assert [snapshot.iteration for snapshot in result.snapshots] == [0, 2]
    assert (tuple(result.snapshots), list(result.rows)) == (job.snapshots, stores.jobs.metrics(spec.id))
    assert job.best_iteration == result.outcome.best_iteration == 2


def test_a_cancel_counts_though_an_older_copy_of_the_record_was_put_under_a_running_job(
    stores: Stores,
) -> None:
    """As after a replica has taken over that was behind, while the job was computed to its end."""
    spec = job_spec()
    submit(stores.jobs, stores.blobs, stores.queue, spec)
    ending = ending_of(stores, spec.id)
    for key in stores.client.keys("spherify:*"):
        stores.client.copy(key, f"older:{key}")
    assert cancel(stores.jobs, stores.blobs, spec.id) is CancelOutcome.CANCELLING
    for key in stores.client.keys("older:*"):
        stores.client.rename(key, key.removeprefix("older:"))
    assert stores.jobs.get(spec.id).status is JobStatus.RUNNING
    ending.commit(Outcome(JobStatus.SUCCESSFUL, "iterations", result_iteration=3), Progress(3, 3))
    job, result = stores.jobs.get(spec.id), read_result(stores.blobs, spec.id)
    assert result is not None
    assert job.status is result.outcome.status is JobStatus.CANCELLED
    assert (job.result_iteration, job.stop_reason) == (None, "cancelled")
