"""The record of a job that has ended holds what the attempt that ended it told, as its ``result.json`` does."""

from __future__ import annotations

from spherify.jobs import layout
from spherify.jobs.model import JobStatus, Progress, Snapshot
from spherify.jobs.results import read_result
from spherify.jobs.submit import submit
from spherify.settings import Settings
from spherify.stores.connect import Stores
from tests.jobs.examples import job_spec
from tests.worker.supervised import Watched
from tests.worker.test_supervisor import supervise


def test_what_a_former_attempt_told_and_the_last_one_did_not_come_to_is_gone(
    stores: Stores, settings: Settings, runners: Watched
) -> None:
    spec = job_spec(iterations=9, snapshots="3,6")
    submit(stores.jobs, stores.blobs, stores.queue, spec)
    former = stores.jobs.claim(spec.id, "former").token
    beyond = layout.numbered(
        layout.snapshots(spec.id), former, 8
    )  # a best state in hindsight: none goes on from it
    stores.blobs.create(beyond, b"")
    stores.jobs.report(
        spec.id, former, Progress(8, 9), [{"iteration": 8, "sphericity": 0.5}, {"iteration": 99}]
    )
    stores.jobs.add_snapshot(spec.id, former, Snapshot(8, beyond, "s", 0, {"sphericity": 0.5}, 1.0))
    stores.jobs.lose(spec.id, former)
    job = supervise(stores, settings, runners, spec.id)
    result = read_result(stores.blobs, spec.id)
    assert result is not None
    assert (job.status, result.whole) == (JobStatus.SUCCESSFUL, True)
    assert {0, 3, 6} <= {snapshot.iteration for snapshot in job.snapshots}
    assert job.snapshots == tuple(result.snapshots)
    assert stores.jobs.metrics(spec.id) == list(result.rows)
    kept = {snapshot.key for snapshot in job.snapshots}
    left = {stat.key for stat in stores.blobs.list(layout.snapshots(spec.id))}
    assert left == kept
    assert beyond not in kept
