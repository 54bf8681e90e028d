"""One suite for the twin in memory and the real server: what the port promises."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from spherify.jobs.errors import (
    JobGoneError,
    JobNotFinishedError,
    JobNotFoundError,
    MeshNotFoundError,
)
from spherify.jobs.ids import new_job_id
from spherify.jobs.model import JobError, JobStatus, Outcome, Progress, Snapshot
from spherify.jobs.ports import CancelOutcome, Claim, ClaimOutcome, JobStore, Kept, Renewal
from tests.jobs.examples import job_spec

DONE = Outcome(JobStatus.SUCCESSFUL, "converged", "round", result_iteration=3, best_iteration=2)
MakeStore = Callable[..., JobStore]


def snapshot(iteration: int, key: str = "k") -> Snapshot:
    return Snapshot(iteration, key, "0" * 64, 8, {"sphericity": 0.5}, 1.0)


def running(jobs: JobStore) -> tuple[str, int]:
    job = jobs.add(job_spec())
    claim = jobs.claim(job.id, "w")
    assert claim.outcome is ClaimOutcome.CLAIMED
    return job.id, claim.token


def test_a_new_job_is_accepted_and_queued(jobs: JobStore) -> None:
    spec = job_spec(tags=("a", "b"), snapshots="1,2")
    job = jobs.add(spec)
    assert job == jobs.get(spec.id)
    assert job.spec == spec
    assert (job.status, job.rev, job.token, job.attempt, job.losses) == (JobStatus.ACCEPTED, 1, 0, 0, 0)
    assert job.queue_position == 0
    assert jobs.add(job_spec()).queue_position == 1
    assert jobs.waiting(0) == [spec.id, jobs.waiting(0)[1]]
    assert jobs.waiting(60) == []


def test_adding_again_changes_nothing(jobs: JobStore) -> None:
    spec = job_spec()
    jobs.add(spec)
    jobs.claim(spec.id, "w")
    assert jobs.add(spec).status is JobStatus.RUNNING
    assert jobs.counts()[JobStatus.ACCEPTED] == 0


def test_an_unknown_job(jobs: JobStore) -> None:
    job_id, _ = new_job_id()
    with pytest.raises(JobNotFoundError):
        jobs.get(job_id)
    with pytest.raises(JobNotFoundError):
        jobs.metrics(job_id)
    with pytest.raises(JobNotFoundError):
        jobs.delete(job_id)
    assert jobs.request_cancel(job_id) is CancelOutcome.UNKNOWN
    assert jobs.claim(job_id, "w") == Claim(ClaimOutcome.DONE)
    assert jobs.renew(job_id, 1) is Renewal.FENCED
    assert not jobs.report(job_id, 1, Progress(0, 1))
    assert not jobs.add_snapshot(job_id, 1, snapshot(0))
    assert not jobs.release(job_id, 1)
    assert not jobs.lose(job_id, 1)
    assert jobs.seal(job_id, 1) is Renewal.FENCED
    assert not jobs.commit(job_id, 1, DONE)
    assert sum(jobs.counts().values()) == 0


def test_a_claimed_job_is_held_by_one(jobs: JobStore) -> None:
    job_id, token = running(jobs)
    assert token == 1
    assert jobs.claim(job_id, "other") == Claim(ClaimOutcome.LEASED)
    job = jobs.get(job_id)
    assert (job.status, job.worker, job.attempt, job.queue_position) == (JobStatus.RUNNING, "w", 1, None)
    assert job.started_at is not None
    assert job.lease_until is not None
    assert job.lease_until > job.started_at
    assert jobs.waiting(0) == []
    assert jobs.renew(job_id, token) is Renewal.HELD
    assert jobs.lost() == []


def test_reports_are_idempotent_and_rows_ascend(jobs: JobStore) -> None:
    job_id, token = running(jobs)
    rows = [{"iteration": i, "sphericity": i / 10} for i in (10, 9, 100)]
    for _ in range(2):
        assert jobs.report(job_id, token, Progress(100, 200, 5.0, 20.0, 1.5), rows)
    job = jobs.get(job_id)
    assert job.progress == Progress(100, 200, 5.0, 20.0, 1.5)
    assert job.metrics == {"sphericity": 10.0}
    assert jobs.metrics(job_id) == [{"iteration": i, "sphericity": i / 10} for i in (9, 10, 100)]
    assert jobs.report(job_id, token, Progress(101, 200))
    assert jobs.get(job_id).metrics == {"sphericity": 10.0}


def test_many_rows_at_once(jobs: JobStore) -> None:
    job_id, token = running(jobs)
    rows = [{"iteration": i, "sphericity": 0.5} for i in range(1700)]
    assert jobs.report(job_id, token, Progress(1699, 2000), rows)
    assert jobs.metrics(job_id) == rows


def test_snapshots_ascend_and_a_later_one_replaces(jobs: JobStore) -> None:
    job_id, token = running(jobs)
    for it, key in ((100, "a"), (5, "b"), (100, "c")):
        assert jobs.add_snapshot(job_id, token, snapshot(it, key))
    assert [(s.iteration, s.key) for s in jobs.get(job_id).snapshots] == [(5, "b"), (100, "c")]


def test_a_commit_keeps_what_it_names_of_all_that_former_attempts_left(jobs: JobStore) -> None:
    job_id, first = running(jobs)
    for iteration in (0, 10, 20):
        jobs.report(job_id, first, Progress(iteration, 30), [{"iteration": iteration}])
        jobs.add_snapshot(job_id, first, snapshot(iteration, "first"))
    assert jobs.lose(job_id, first)
    second = jobs.claim(job_id, "w").token
    assert all(jobs.add_snapshot(job_id, second, snapshot(i, "second")) for i in (0, 10))
    kept = Kept(snapshots=frozenset({0, 10}), rows=frozenset({0, 20}))
    assert not jobs.commit(job_id, first, DONE, kept)
    assert len(jobs.metrics(job_id)) == len(jobs.get(job_id).snapshots) == 3, "fenced"
    assert jobs.commit(job_id, second, DONE, kept)
    assert [(s.iteration, s.key) for s in jobs.get(job_id).snapshots] == [(0, "second"), (10, "second")]
    assert jobs.metrics(job_id) == [{"iteration": 0}, {"iteration": 20}]
    assert jobs.commit(job_id, second, DONE, Kept(frozenset(), frozenset()))
    assert len(jobs.get(job_id).snapshots) == 2, "a repetition changes nothing"


def test_a_commit_ends_the_job_once(jobs: JobStore) -> None:
    job_id, token = running(jobs)
    assert jobs.commit(job_id, token, DONE)
    job = jobs.get(job_id)
    assert (job.status, job.stop_reason, job.stop_detail) == (JobStatus.SUCCESSFUL, "converged", "round")
    assert (job.result_iteration, job.best_iteration, job.error) == (3, 2, None)
    assert (job.worker, job.lease_until) == (None, None)
    assert job.finished_at is not None
    assert jobs.commit(job_id, token, DONE)
    assert not jobs.commit(job_id, token, Outcome(JobStatus.FAILED))
    assert not jobs.commit(job_id, token + 1, DONE)
    assert jobs.get(job_id) == job
    assert jobs.request_cancel(job_id) is CancelOutcome.FINISHED
    assert jobs.claim(job_id, "w") == Claim(ClaimOutcome.DONE)
    assert jobs.lost() == []


def test_a_failure_says_why(jobs: JobStore) -> None:
    job_id, token = running(jobs)
    error = JobError("collapsed", "iteration 7; try “robust”")
    assert jobs.commit(job_id, token, Outcome(JobStatus.FAILED, "collapsed", error=error, result_iteration=0))
    assert jobs.get(job_id).error == error


def test_a_waiting_job_is_cancelled_at_once(jobs: JobStore) -> None:
    job_id = jobs.add(job_spec()).id
    assert jobs.request_cancel(job_id) is CancelOutcome.CANCELLED
    assert jobs.request_cancel(job_id) is CancelOutcome.CANCELLED
    job = jobs.get(job_id)
    assert (job.status, job.stop_reason, job.queue_position) == (JobStatus.CANCELLED, "cancelled", None)
    assert jobs.claim(job_id, "w") == Claim(ClaimOutcome.DONE)
    assert jobs.waiting(0) == []


def test_a_running_job_is_told_and_then_cancelled_whatever_it_says(jobs: JobStore) -> None:
    job_id, token = running(jobs)
    assert jobs.request_cancel(job_id) is CancelOutcome.CANCELLING
    assert jobs.request_cancel(job_id) is CancelOutcome.CANCELLING
    assert jobs.get(job_id).status is JobStatus.CANCELLING
    assert jobs.renew(job_id, token) is Renewal.CANCEL
    assert jobs.report(job_id, token, Progress(1, 2))
    assert jobs.commit(job_id, token, DONE)
    job = jobs.get(job_id)
    assert (job.status, job.stop_reason, job.stop_detail) == (JobStatus.CANCELLED, "cancelled", None)
    assert (job.result_iteration, job.best_iteration) == (None, 2)  # snapshots, and no result


def test_a_job_on_an_unknown_mesh_is_not_recorded(jobs: JobStore) -> None:
    spec = job_spec(mesh_id="mesh_" + "2" * 26)
    with pytest.raises(MeshNotFoundError):
        jobs.add(spec)
    with pytest.raises(JobNotFoundError):
        jobs.get(spec.id)
    assert jobs.waiting(0) == []


def test_a_cancel_is_heard_until_the_end_is_sealed(jobs: JobStore) -> None:
    job_id, token = running(jobs)
    assert jobs.seal(job_id, token) is Renewal.HELD
    assert jobs.request_cancel(job_id) is CancelOutcome.FINISHED
    assert jobs.seal(job_id, token) is Renewal.HELD
    assert jobs.commit(job_id, token, DONE)
    assert jobs.get(job_id).status is JobStatus.SUCCESSFUL
    job_id, token = running(jobs)
    jobs.request_cancel(job_id)
    assert jobs.seal(job_id, token) is Renewal.CANCEL


def test_a_seal_ends_with_its_attempt(jobs: JobStore) -> None:
    job_id, token = running(jobs)
    jobs.seal(job_id, token)
    jobs.lose(job_id, token)
    assert jobs.seal(job_id, token) is Renewal.FENCED
    jobs.claim(job_id, "w")
    assert jobs.request_cancel(job_id) is CancelOutcome.CANCELLING


def test_every_end_is_unsettled_until_its_files_are(jobs: JobStore, forgetful: JobStore) -> None:
    committed, token = running(jobs)
    assert jobs.unsettled() == []
    jobs.commit(committed, token, DONE)
    cancelled = jobs.add(job_spec()).id
    jobs.request_cancel(cancelled)
    released, token = running(jobs)
    jobs.request_cancel(released)
    jobs.release(released, token)
    poisoned = jobs.add(job_spec()).id
    forgetful.claim(poisoned, "w")
    forgetful.lost()
    forgetful.claim(poisoned, "w")
    forgetful.lost()
    ends = sorted([committed, cancelled, released, poisoned])
    assert jobs.unsettled() == ends
    for job_id in ends:
        assert not jobs.settled(job_id, deleted=True)
    assert jobs.unsettled() == ends
    jobs.delete(committed)
    assert not jobs.settled(committed, deleted=False)
    assert jobs.settled(committed, deleted=True)
    for job_id in (cancelled, released, poisoned):
        assert jobs.settled(job_id, deleted=False)
    assert jobs.unsettled() == []
    jobs.delete(cancelled)  # its files are to go now
    assert jobs.unsettled() == [cancelled]


def test_a_released_job_is_next_and_has_lost_nothing(jobs: JobStore) -> None:
    job_id, token = running(jobs)
    jobs.add(job_spec())
    assert jobs.release(job_id, token)
    job = jobs.get(job_id)
    assert (job.status, job.losses, job.queue_position, job.worker) == (JobStatus.ACCEPTED, 0, 0, None)
    assert jobs.renew(job_id, token) is Renewal.FENCED
    assert jobs.claim(job_id, "w") == Claim(ClaimOutcome.CLAIMED, 2)
    assert jobs.get(job_id).started_at == job.started_at


def test_releasing_a_job_to_be_cancelled_cancels_it(jobs: JobStore) -> None:
    job_id, token = running(jobs)
    jobs.request_cancel(job_id)
    assert jobs.release(job_id, token)
    assert jobs.get(job_id).status is JobStatus.CANCELLED


def test_whoever_lost_the_lease_writes_nothing_more(jobs: JobStore, forgetful: JobStore) -> None:
    job_id = jobs.add(job_spec()).id
    old = forgetful.claim(job_id, "old")
    assert forgetful.lost() == [job_id]
    job = jobs.get(job_id)
    assert (job.status, job.losses) == (JobStatus.ACCEPTED, 1)
    new = jobs.claim(job_id, "new")
    assert new.token > old.token
    before = jobs.get(job_id)
    assert jobs.renew(job_id, old.token) is Renewal.FENCED
    assert not jobs.report(job_id, old.token, Progress(9, 9), [{"iteration": 9}])
    assert not jobs.add_snapshot(job_id, old.token, snapshot(9))
    assert not jobs.commit(job_id, old.token, DONE)
    assert not jobs.release(job_id, old.token)
    assert not jobs.lose(job_id, old.token)
    assert jobs.get(job_id) == before
    assert jobs.metrics(job_id) == []


def test_a_dead_lease_may_be_claimed_directly(jobs: JobStore, forgetful: JobStore) -> None:
    job_id = jobs.add(job_spec()).id
    forgetful.claim(job_id, "old")
    assert jobs.claim(job_id, "new") == Claim(ClaimOutcome.CLAIMED, 2)
    assert (jobs.get(job_id).losses, jobs.get(job_id).attempt) == (1, 2)


def test_a_worker_that_renews_late_keeps_a_job_nobody_took(jobs: JobStore, forgetful: JobStore) -> None:
    job_id = jobs.add(job_spec()).id
    token = forgetful.claim(job_id, "late").token
    assert jobs.renew(job_id, token) is Renewal.HELD
    assert forgetful.lost() == []


def test_a_job_that_loses_too_many_workers_fails(jobs: JobStore, forgetful: JobStore) -> None:
    job_id = jobs.add(job_spec()).id
    forgetful.claim(job_id, "w")
    forgetful.claim(job_id, "w")  # the first loss
    assert forgetful.claim(job_id, "w") == Claim(ClaimOutcome.POISONED)  # the second, of one allowed
    job = jobs.get(job_id)
    assert (job.status, job.losses) == (JobStatus.FAILED, 2)
    assert job.error is not None
    assert job.error.code == "worker-lost"
    assert "2 times" in job.error.detail
    assert forgetful.claim(job_id, "w") == Claim(ClaimOutcome.DONE)


def test_a_lease_that_ran_out_without_a_fault_is_not_counted(jobs: JobStore, forgetful: JobStore) -> None:
    job_id, cancelled = jobs.add(job_spec()).id, jobs.add(job_spec()).id
    for _ in range(3):  # one loss is allowed
        forgetful.claim(job_id, "w")
        assert forgetful.lost(counted=False) == [job_id]
    assert (jobs.get(job_id).status, jobs.get(job_id).losses) == (JobStatus.ACCEPTED, 0)
    forgetful.claim(cancelled, "w")
    jobs.request_cancel(cancelled)
    assert forgetful.lost(counted=False) == []
    assert jobs.get(cancelled).status is JobStatus.CANCELLED


def test_poison_is_found_without_a_claim(jobs: JobStore, forgetful: JobStore) -> None:
    job_id = jobs.add(job_spec()).id
    forgetful.claim(job_id, "w")
    forgetful.claim(job_id, "w")
    assert forgetful.lost() == []
    assert jobs.get(job_id).status is JobStatus.FAILED


def test_a_runner_that_died_counts_as_a_loss(make: MakeStore) -> None:
    jobs = make(max_losses=1)
    job_id, token = running(jobs)
    assert jobs.lose(job_id, token)
    assert (jobs.get(job_id).status, jobs.get(job_id).losses) == (JobStatus.ACCEPTED, 1)
    token = jobs.claim(job_id, "w").token
    assert not jobs.lose(job_id, token)
    assert jobs.get(job_id).status is JobStatus.FAILED


@pytest.mark.parametrize("found_by", ["lost", "claim"])
def test_a_job_to_be_cancelled_whose_worker_is_lost_is_cancelled(
    jobs: JobStore, forgetful: JobStore, found_by: str
) -> None:
    job_id = jobs.add(job_spec()).id
    forgetful.claim(job_id, "w")
    jobs.request_cancel(job_id)
    if found_by == "lost":
        assert jobs.lost() == []
    else:
        assert jobs.claim(job_id, "other") == Claim(ClaimOutcome.DONE)
    job = jobs.get(job_id)
    assert (job.status, job.losses, job.stop_reason) == (JobStatus.CANCELLED, 0, "cancelled")


def test_only_a_finished_job_is_deleted_and_leaves_a_tombstone(jobs: JobStore) -> None:
    spec = job_spec(tags=("t",))
    jobs.add(spec)
    with pytest.raises(JobNotFinishedError):
        jobs.delete(spec.id)
    jobs.request_cancel(spec.id)
    jobs.delete(spec.id)
    with pytest.raises(JobGoneError):
        jobs.get(spec.id)
    with pytest.raises(JobGoneError):
        jobs.metrics(spec.id)
    with pytest.raises(JobGoneError):
        jobs.add(spec)
    assert jobs.find().items == jobs.find(tag="t").items == jobs.find(mesh_id=spec.mesh_id).items == ()
    assert sum(jobs.counts().values()) == 0


def test_every_change_raises_the_revision(jobs: JobStore) -> None:
    job_id = jobs.add(job_spec()).id
    revisions = [jobs.get(job_id).rev]

    def changed() -> None:
        revisions.append(jobs.get(job_id).rev)

    token = jobs.claim(job_id, "w").token
    changed()
    jobs.report(job_id, token, Progress(1, 2))
    changed()
    jobs.add_snapshot(job_id, token, snapshot(0))
    changed()
    jobs.request_cancel(job_id)
    changed()
    jobs.commit(job_id, token, DONE)
    changed()
    assert revisions == sorted(set(revisions))


def test_the_server_answers(jobs: JobStore) -> None:
    jobs.ping()


def test_who_asks_twice_is_told_the_same_twice(jobs: JobStore) -> None:
    spec = job_spec()
    jobs.add(spec)
    first = jobs.claim(spec.id, "w", "one")
    assert jobs.claim(spec.id, "w", "one") == first
    assert jobs.claim(spec.id, "w", "another").outcome is ClaimOutcome.LEASED
    assert jobs.claim(spec.id, "w").outcome is ClaimOutcome.LEASED
    assert jobs.get(spec.id).attempt == 1
    assert jobs.release(spec.id, first.token)
    assert jobs.claim(spec.id, "w", "one").token == first.token + 1  # a new attempt, whoever it is
    assert jobs.get(spec.id).attempt == 2
