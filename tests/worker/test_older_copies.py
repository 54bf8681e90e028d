"""An older copy of the records: what it gives out a second time, and what it lacks."""

from __future__ import annotations

from dataclasses import asdict

from spherify.jobs import layout
from spherify.jobs.accounts import write_account
from spherify.jobs.model import Job, JobStatus, Outcome, Progress, Snapshot
from spherify.jobs.ports import Renewal
from spherify.jobs.results import read_result
from spherify.jobs.submit import submit
from spherify.settings import Settings
from spherify.stores import keys
from spherify.stores.connect import Stores
from tests.jobs.examples import job_spec
from tests.worker.supervised import Watched
from tests.worker.test_supervisor import supervise
from worker.ending import Ending


def test_no_two_attempts_work_under_one_token_and_none_of_them_fails(
    stores: Stores, settings: Settings, runners: Watched
) -> None:
    """The files of one would be in the other's way, and neither be fenced."""
    spec = job_spec()
    submit(stores.jobs, stores.blobs, stores.queue, spec)
    older = stores.client.dump(keys.job(spec.id))
    first = stores.jobs.claim(spec.id, "first")
    write_account(stores.blobs, spec.id, first)
    stores.blobs.create(layout.numbered(layout.snapshots(spec.id), first.token, 0), b"damaged")
    stores.client.restore(keys.job(spec.id), 0, older, replace=True)
    job = supervise(stores, settings, runners, spec.id)
    assert (job.status, job.token, job.losses) == (JobStatus.ACCEPTED, first.token, 0)
    assert stores.jobs.renew(spec.id, first.token) is Renewal.FENCED
    job = supervise(stores, settings, runners, spec.id)
    assert (job.status, job.token, job.losses) == (JobStatus.SUCCESSFUL, first.token + 1, 0)


def test_what_an_older_copy_of_the_record_lacks_is_told_again_with_the_end(stores: Stores) -> None:
    """As after a replica has taken over that was behind: the attempt goes on under its token."""
    spec = job_spec()
    submit(stores.jobs, stores.blobs, stores.queue, spec)
    token = stores.jobs.claim(spec.id, "w").token
    ending = Ending(stores.jobs, stores.blobs, stores.queue, spec.id, token)
    older = stores.client.dump(keys.job(spec.id))
    ending.outbox.take_in({"event": "snapshot", "snapshot": asdict(Snapshot(3, "k", "s", 1, {}, 1.0))})
    ending.outbox.take_in({"event": "report", "progress": asdict(Progress(3, 3)), "rows": [{"iteration": 3}]})
    assert ending.outbox.flush()
    stores.client.delete(keys.snapshots(spec.id), keys.rows(spec.id))
    stores.client.restore(keys.job(spec.id), 0, older, replace=True)
    ending.commit(Outcome(JobStatus.SUCCESSFUL, "iterations", result_iteration=3), Progress(3, 3))
    job, result = stores.jobs.get(spec.id), read_result(stores.blobs, spec.id)
    assert result is not None
    assert job.status is JobStatus.SUCCESSFUL
    assert [snapshot.iteration for snapshot in job.snapshots] == [3]
    assert (tuple(result.snapshots), list(result.rows)) == (job.snapshots, stores.jobs.metrics(spec.id))


def test_whoever_looks_on_is_told_of_changes_after_an_older_copy_of_the_record_was_put_back(
    stores: Stores,
) -> None:
    """A revision that somebody has seen stands for nothing else, and none is passed over as an earlier one."""
    spec = job_spec()
    submit(stores.jobs, stores.blobs, stores.queue, spec)
    token = stores.jobs.claim(spec.id, "w").token
    older = stores.client.dump(keys.job(spec.id))
    for iteration in range(3):
        stores.jobs.report(spec.id, token, Progress(iteration, 3))
    seen = stores.jobs.get(spec.id)
    stores.client.restore(keys.job(spec.id), 0, older, replace=True)
    stores.jobs.commit(spec.id, token, Outcome(JobStatus.SUCCESSFUL, "iterations"))
    [found] = stores.jobs.get_all({spec.id: seen}).values()
    assert isinstance(found, Job)
    assert (found.status, found.rev > seen.rev) == (JobStatus.SUCCESSFUL, True)
