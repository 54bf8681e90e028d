"""What a job ends with, whatever former attempts told or an older copy of its record says."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from numpy.typing import NDArray

from spherify.jobs import layout
from spherify.jobs.cancel import cancel
from spherify.jobs.model import Job, JobStatus, Progress, Snapshot
from spherify.jobs.ports import CancelOutcome
from spherify.jobs.rebuild import rebuild
from spherify.jobs.results import read_result
from spherify.jobs.settle import settle
from spherify.jobs.submit import submit
from spherify.settings import Settings
from spherify.stores.arrays import dump_arrays, load_arrays
from spherify.stores.connect import Stores
from tests.jobs.examples import job_spec
from tests.worker.supervised import Watched, endless
from tests.worker.test_supervisor import supervise, when_computing


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


def test_a_cancel_counts_though_an_older_copy_of_the_record_knows_nothing_of_it(
    stores: Stores, settings: Settings, runners: Watched
) -> None:
    """As after a replica has taken over that was behind; the states that were kept stay."""
    job_id = endless(stores)
    begun = supervise(
        stores, settings, runners, job_id, each_tick=lambda: len(stores.jobs.get(job_id).snapshots) > 1
    )
    assert begun.status is JobStatus.ACCEPTED
    for key in stores.client.keys("spherify:*"):
        stores.client.copy(key, f"older:{key}")
    stores.jobs.claim(job_id, "another")
    assert cancel(stores.jobs, stores.blobs, job_id) is CancelOutcome.CANCELLING
    for key in stores.client.keys("older:*"):
        stores.client.rename(key, key.removeprefix("older:"))
    assert stores.jobs.get(job_id).status is JobStatus.ACCEPTED
    limited = settings.model_copy(update={"wall_limit_s": 30.0, "cancel_grace_s": 30.0})
    job = supervise(stores, limited, runners, job_id)
    assert (job.status, job.losses) == (JobStatus.CANCELLED, 0)
    assert {0, 2} <= {snapshot.iteration for snapshot in job.snapshots}
    result = read_result(stores.blobs, job_id)
    assert result is not None
    assert (result.outcome.status, result.whole) == (JobStatus.CANCELLED, True)
    assert tuple(result.snapshots) == job.snapshots


@dataclass(frozen=True)
class Begun:
    """A job that was handed on with its states of 0 and 2, and the file of a further one, at 5, left beside them.

    Attributes:
        ours: keys of the states that were told, by iteration.
        state: the arrays of that of 2.
        beyond: key of the one at 5.

    """

    stores: Stores
    job_id: str
    ours: dict[int, str]
    state: dict[str, NDArray[Any]]
    beyond: str

    def told(self) -> dict[int, str]:
        return told(self.stores, self.job_id)

    def key(self, token: int, iteration: int) -> str:
        return layout.numbered(layout.snapshots(self.job_id), token, iteration)

    def of_another_version(self) -> bytes:
        return dump_arrays({**self.state, "fingerprint": self.state["fingerprint"] ^ 1})


def told(stores: Stores, job_id: str) -> dict[int, str]:
    return {snapshot.iteration: snapshot.key for snapshot in stores.jobs.get(job_id).snapshots}


@pytest.fixture
def begun(stores: Stores, settings: Settings, runners: Watched) -> Begun:
    job_id = endless(stores)
    supervise(stores, settings, runners, job_id, each_tick=lambda: len(told(stores, job_id)) > 1)
    ours = told(stores, job_id)
    state = load_arrays(stores.blobs.read(ours[2]))
    beyond = layout.numbered(layout.snapshots(job_id), 1, 5)
    stores.blobs.create(beyond, dump_arrays(state))
    return Begun(stores, job_id, ours, state, beyond)


def test_of_two_versions_one_takes_only_the_others_snapshots_out_of_the_record(
    begun: Begun, stores: Stores, settings: Settings, runners: Watched
) -> None:
    """Ours is damaged at 2, and what it came to beyond that was told, and is served until it is made again."""
    job_id, ours = begun.job_id, begun.ours
    Path(settings.data_dir, "blobs", ours[2]).write_bytes(b"damaged")
    for iteration in (0, 2, 6):
        stores.blobs.create(begun.key(2, iteration), begun.of_another_version())
    token = stores.jobs.claim(job_id, "former").token
    for iteration in (5, 6):
        stores.jobs.add_snapshot(job_id, token, Snapshot(iteration, begun.key(2, iteration), "s", 0, {}, 1.0))
    stores.jobs.release(job_id, token)
    supervise(stores, settings, runners, job_id, each_tick=lambda: begun.told().get(2) not in {None, ours[2]})
    assert begun.told() == {0: ours[0], 2: begun.told()[2], 5: begun.beyond}
    assert layout.numbers(begun.told()[2])[0] > token


def test_a_damaged_beginning_does_not_keep_the_snapshots_of_another_version_in_the_record(
    begun: Begun, stores: Stores, settings: Settings, runners: Watched
) -> None:
    """Nothing can be gone on from, so that it is not even tried; what is ours of the rest is served meanwhile."""
    job_id, ours, theirs = begun.job_id, begun.ours, begun.key(2, 6)
    stores.blobs.create(theirs, begun.of_another_version())
    Path(settings.data_dir, "blobs", ours[0]).write_bytes(b"damaged")
    token = stores.jobs.claim(job_id, "former").token
    stores.jobs.add_snapshot(job_id, token, Snapshot(6, theirs, "s", 0, {}, 1.0))
    stores.jobs.report(job_id, token, Progress(1_000_000, 1_000_000), [{"iteration": 1_000_000}])
    stores.jobs.release(job_id, token)
    supervise(stores, settings, runners, job_id, each_tick=lambda: begun.told()[2] != ours[2])
    assert {iteration: layout.numbers(key)[0] for iteration, key in begun.told().items()} == {
        0: 3,
        2: 3,
        5: 1,
    }
    rows = [row["iteration"] for row in stores.jobs.metrics(job_id)]
    assert rows[0] == 0, "that of the first state was told before whose it is"
    assert rows[-1] < 1_000_000


@pytest.mark.parametrize("cancelled_first", [True, False], ids=["and-then-lost", "after-the-loss"])
def test_a_cancel_together_with_the_loss_of_the_records_takes_no_snapshot_away(
    stores: Stores, settings: Settings, runners: Watched, cancelled_first: bool
) -> None:
    job_id = endless(stores)
    told: list[Job] = []

    def forget() -> None:
        told.append(stores.jobs.get(job_id))
        if cancelled_first:
            assert cancel(stores.jobs, stores.blobs, job_id) is CancelOutcome.CANCELLING
        stores.client.flushall()
        assert rebuild(stores.stock)

    job = supervise(
        stores, settings, runners, job_id, each_tick=when_computing(stores, job_id, forget)
    )  # the attempt is fenced
    if not cancelled_first:  # what was told is served before a worker takes the job up once more
        assert job.status is JobStatus.ACCEPTED
        assert job.snapshots == told[0].snapshots
        assert cancel(stores.jobs, stores.blobs, job_id) is CancelOutcome.CANCELLED
    settle(stores.jobs, stores.blobs, job_id)
    job = stores.jobs.get(job_id)
    assert (job.status, job.snapshots) == (JobStatus.CANCELLED, told[0].snapshots)
    assert [snapshot.iteration for snapshot in job.snapshots] == [0, 2]
    assert {snapshot.key for snapshot in job.snapshots} == {
        stat.key for stat in stores.blobs.list(layout.snapshots(job_id))
    }
    assert job.progress is not None
    assert job.progress.iteration == stores.jobs.metrics(job_id)[-1]["iteration"] >= 2
    assert job.best_iteration == 2
    result = read_result(stores.blobs, job_id)
    assert result is not None
    assert (tuple(result.snapshots), list(result.rows)) == (job.snapshots, stores.jobs.metrics(job_id))
