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


def ending(jobs: JobStore, job_id: str, status: JobStatus, losses: int) -> Claim:
    """See that a job waits for nothing but its end, which whoever claims it writes; return that claim."""
    job = jobs.get(job_id)
    assert (job.status, job.losses, job.queue_position) == (status, losses, None)
    assert jobs.overdue() == [job_id]
    assert jobs.lost() == jobs.unsettled() == []
    attempts = job.attempt
    claim = jobs.claim(job_id, "w", "one", to_end=True)
    assert claim == Claim(ClaimOutcome.ENDING, job.token + 1)
    assert jobs.claim(job_id, "w", "one") == claim, "who asks twice is told the same"
    assert jobs.claim(job_id, "another", to_end=True) == Claim(ClaimOutcome.LEASED)
    assert jobs.overdue() == []
    assert jobs.get(job_id).attempt == attempts, "it is none"
    return claim


def test_releasing_a_job_to_be_cancelled_leaves_it_to_be_ended(jobs: JobStore) -> None:
    job_id, token = running(jobs)
    jobs.request_cancel(job_id)
    assert not jobs.release(job_id, token)
    claim = ending(jobs, job_id, JobStatus.CANCELLING, 0)
    assert jobs.renew(job_id, token) is Renewal.FENCED
    assert jobs.seal(job_id, claim.token) is Renewal.CANCEL


def test_cancelling_a_job_that_waits_again_leaves_it_to_be_ended_by_no_former_attempt(jobs: JobStore) -> None:
    job_id, token = running(jobs)
    assert jobs.release(job_id, token)
    assert jobs.request_cancel(job_id) is CancelOutcome.CANCELLING
    assert not jobs.commit(job_id, token, DONE)
    ending(jobs, job_id, JobStatus.CANCELLING, 0)


def test_a_seal_counts_no_longer_than_its_lease(jobs: JobStore, forgetful: JobStore) -> None:
    job_id = jobs.add(job_spec()).id
    token = forgetful.claim(job_id, "sleeps").token
    assert jobs.seal(job_id, token) is Renewal.HELD
    assert jobs.request_cancel(job_id) is CancelOutcome.CANCELLING
    ending(jobs, job_id, JobStatus.CANCELLING, 0)
    assert not jobs.commit(job_id, token, DONE)


def test_what_is_to_be_computed_is_not_taken_to_be_ended(jobs: JobStore, forgetful: JobStore) -> None:
    job_id = jobs.add(job_spec()).id
    assert jobs.claim(job_id, "w", to_end=True) == Claim(ClaimOutcome.DONE)
    forgetful.claim(job_id, "w")
    assert jobs.claim(job_id, "w", to_end=True) == Claim(ClaimOutcome.LEASED)
    assert (jobs.get(job_id).losses, jobs.get(job_id).attempt) == (0, 1)
    assert jobs.claim(job_id, "w").outcome is ClaimOutcome.CLAIMED


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


def test_a_job_that_loses_too_many_workers_is_only_ended(make: MakeStore) -> None:
    forgetful = make(lease_s=-1, max_losses=1)
    job_id = forgetful.add(job_spec()).id
    forgetful.claim(job_id, "w")
    forgetful.claim(job_id, "w")  # the first loss
    for token in (3, 4):  # the second, of one allowed; and that is not counted on
        claim = forgetful.claim(job_id, "w")
        assert (claim, claim.attempt, claim.losses) == (Claim(ClaimOutcome.ENDING, token), 2, 2)
    assert forgetful.lost() == []
    assert forgetful.overdue() == [job_id]
    assert forgetful.get(job_id).losses == 2


def test_a_lease_that_ran_out_without_a_fault_is_not_counted(jobs: JobStore, forgetful: JobStore) -> None:
    job_id, cancelled = jobs.add(job_spec()).id, jobs.add(job_spec()).id
    for _ in range(3):  # one loss is allowed
        forgetful.claim(job_id, "w")
        assert forgetful.lost(counted=False) == [job_id]
    assert (jobs.get(job_id).status, jobs.get(job_id).losses) == (JobStatus.ACCEPTED, 0)
    forgetful.claim(cancelled, "w")
    jobs.request_cancel(cancelled)
    assert forgetful.lost(counted=False) == []
    ending(jobs, cancelled, JobStatus.CANCELLING, 0)


def test_poison_is_found_without_a_claim(make: MakeStore) -> None:
    jobs, forgetful = make(max_losses=1), make(lease_s=-1, max_losses=1)
    job_id = jobs.add(job_spec()).id
    forgetful.claim(job_id, "w")
    forgetful.claim(job_id, "w")
    assert forgetful.lost() == []
    assert ending(jobs, job_id, JobStatus.RUNNING, 2).losses == 2


def test_a_runner_that_died_counts_as_a_loss(make: MakeStore) -> None:
    jobs = make(max_losses=1)
    job_id, token = running(jobs)
    assert jobs.lose(job_id, token)
    assert (jobs.get(job_id).status, jobs.get(job_id).losses) == (JobStatus.ACCEPTED, 1)
    token = jobs.claim(job_id, "w").token
    assert not jobs.lose(job_id, token)
    assert jobs.renew(job_id, token) is Renewal.FENCED
    assert ending(jobs, job_id, JobStatus.RUNNING, 2).losses == 2


@pytest.mark.parametrize("claimed", [False, True])
def test_a_job_that_was_lost_too_often_does_not_wait_again_whoever_is_to_blame(
    make: MakeStore, claimed: bool
) -> None:
    """As after an outage, over which whoever was to end it lost its lease as well."""
    jobs, forgetful = make(max_losses=0), make(lease_s=-1, max_losses=0)
    job_id = jobs.add(job_spec()).id
    assert not jobs.lose(job_id, jobs.claim(job_id, "w").token)
    if claimed:
        assert forgetful.claim(job_id, "w", to_end=True).outcome is ClaimOutcome.ENDING
    assert jobs.lost(counted=False) == []
    assert not jobs.release(job_id, jobs.get(job_id).token)
    assert ending(jobs, job_id, JobStatus.RUNNING, 1).losses == 1


def test_who_ends_jobs_takes_none_that_may_still_be_computed(make: MakeStore) -> None:
    """Though one more loss were too many: whether this is one, the reconciler knows."""
    jobs, forgetful = make(max_losses=0), make(lease_s=-1, max_losses=0)
    job_id = jobs.add(job_spec()).id
    forgetful.claim(job_id, "w")
    assert jobs.claim(job_id, "w", to_end=True) == Claim(ClaimOutcome.LEASED)
    assert jobs.lost(counted=False) == [job_id]
    assert jobs.claim(job_id, "w").outcome is ClaimOutcome.CLAIMED


@pytest.mark.parametrize("given_up", [False, True])
def test_a_job_to_be_cancelled_whose_worker_is_lost_is_only_ended(
    jobs: JobStore, forgetful: JobStore, given_up: bool
) -> None:
    job_id = jobs.add(job_spec()).id
    token = forgetful.claim(job_id, "w").token
    jobs.request_cancel(job_id)
    assert not (given_up and jobs.lose(job_id, token))
    claim = ending(jobs, job_id, JobStatus.CANCELLING, 0)
    assert jobs.seal(job_id, claim.token) is Renewal.CANCEL


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
