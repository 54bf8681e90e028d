"""One suite for the twin in memory and the real server: what the port promises."""

from __future__ import annotations

import pytest

from spherify.jobs.errors import (
    JobGoneError,
    JobNotFinishedError,
    JobNotFoundError,
    MeshNotFoundError,
)
from spherify.jobs.ids import new_job_id
from spherify.jobs.model import JobError, JobStatus, Outcome, Progress
from spherify.jobs.ports import CancelOutcome, Claim, ClaimOutcome, JobStore, Kept, Renewal
from tests.jobs.examples import job_spec
from tests.stores.played import DONE, running, snapshot


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


@pytest.mark.parametrize(("snapshots", "rows"), [({0, 3}, {0}), ({0}, {0, 3})])
def test_a_commit_that_names_what_was_never_told_is_refused(
    jobs: JobStore, snapshots: set[int], rows: set[int]
) -> None:
    """As where an older copy of the record was put back under an attempt: it tells all once more."""
    job_id, token = running(jobs)
    jobs.report(job_id, token, Progress(0, 3), [{"iteration": 0}])
    jobs.add_snapshot(job_id, token, snapshot(0))
    kept = Kept(frozenset(snapshots), frozenset(rows))
    assert not jobs.commit(job_id, token, DONE, kept)
    assert jobs.get(job_id).status is JobStatus.RUNNING
    jobs.report(job_id, token, Progress(3, 3), [{"iteration": 3}])
    jobs.add_snapshot(job_id, token, snapshot(3))
    assert jobs.commit(job_id, token, DONE, kept)


def test_what_the_present_attempt_does_not_go_on_from_is_disowned(jobs: JobStore) -> None:
    job_id, former = running(jobs)
    jobs.report(job_id, former, Progress(6, 9), [{"iteration": i, "sphericity": 0.5} for i in (0, 3, 6)])
    for iteration in (0, 3, 6):
        jobs.add_snapshot(job_id, former, snapshot(iteration))
    jobs.lose(job_id, former)
    token = jobs.claim(job_id, "w").token
    kept = Kept(frozenset({3}), frozenset({0, 3}))
    assert not jobs.disown(job_id, former, kept)
    before = jobs.get(job_id)
    assert jobs.disown(job_id, token, kept)
    after = jobs.get(job_id)
    assert [s.iteration for s in after.snapshots] == [3]
    assert [row["iteration"] for row in jobs.metrics(job_id)] == [0, 3]
    assert after.rev > before.rev
    assert jobs.disown(job_id, token, Kept(frozenset(), frozenset()))
    assert jobs.get(job_id).snapshots == ()


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


def test_a_running_job_is_told_and_then_ends_as_its_file_says(jobs: JobStore) -> None:
    job_id, token = running(jobs)
    assert jobs.request_cancel(job_id) is CancelOutcome.CANCELLING
    assert jobs.request_cancel(job_id) is CancelOutcome.CANCELLING
    assert jobs.get(job_id).status is JobStatus.CANCELLING
    assert jobs.renew(job_id, token) is Renewal.CANCEL
    assert jobs.report(job_id, token, Progress(1, 2))
    assert jobs.seal(job_id, token) is Renewal.CANCEL
    assert jobs.commit(job_id, token, Outcome(JobStatus.CANCELLED, "cancelled", best_iteration=2))
    job = jobs.get(job_id)
    assert (job.status, job.stop_reason, job.stop_detail) == (JobStatus.CANCELLED, "cancelled", None)
    assert (job.result_iteration, job.best_iteration) == (None, 2)  # snapshots, and no result
    job_id, token = running(jobs)
    jobs.request_cancel(job_id)
    assert jobs.commit(job_id, token, DONE)  # an earlier attempt had written this, and did not live to tell
    assert jobs.get(job_id).status is JobStatus.SUCCESSFUL


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


def test_every_end_is_unsettled_until_its_files_are(jobs: JobStore) -> None:
    committed, token = running(jobs)
    assert jobs.unsettled() == []
    jobs.commit(committed, token, DONE)
    cancelled = jobs.add(job_spec()).id
    jobs.request_cancel(cancelled)
    ends = sorted([committed, cancelled])
    assert jobs.unsettled() == ends
    for job_id in ends:
        assert not jobs.settled(job_id, deleted=True)
    assert jobs.unsettled() == ends
    jobs.delete(committed)
    assert not jobs.settled(committed, deleted=False)
    assert jobs.settled(committed, deleted=True)
    assert jobs.settled(cancelled, deleted=False)
    assert jobs.unsettled() == []
    jobs.delete(cancelled)  # its files are to go now
    assert jobs.unsettled() == [cancelled]


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
