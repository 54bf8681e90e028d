"""A token that an older copy of the records gives out a second time."""

from __future__ import annotations

from spherify.jobs import layout
from spherify.jobs.accounts import write_account
from spherify.jobs.model import JobStatus
from spherify.jobs.ports import Renewal
from spherify.jobs.submit import submit
from spherify.settings import Settings
from spherify.stores import keys
from spherify.stores.connect import Stores
from tests.jobs.examples import job_spec
from tests.worker.supervised import Watched
from tests.worker.test_supervisor import supervise


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
