"""One suite for the twin in memory and the real server: the lease of an attempt, and a job that loses it."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from spherify.jobs.model import JobStatus, Progress
from spherify.jobs.ports import CancelOutcome, Claim, ClaimOutcome, JobStore, Renewal
from tests.jobs.examples import job_spec
from tests.stores.played import DONE, running, snapshot

MakeStore = Callable[..., JobStore]


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


def test_a_seal_ends_with_its_attempt(jobs: JobStore) -> None:
    job_id, token = running(jobs)
    jobs.seal(job_id, token)
    jobs.lose(job_id, token)
    assert jobs.seal(job_id, token) is Renewal.FENCED
    jobs.claim(job_id, "w")
    assert jobs.request_cancel(job_id) is CancelOutcome.CANCELLING


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
