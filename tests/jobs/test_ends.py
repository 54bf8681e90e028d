"""How a job ended is what its first intact ``result.json`` says: the record never says anything else, whoever dies."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from spherify.jobs import layout
from spherify.jobs.cancel import cancel
from spherify.jobs.errors import StorageFullError, StoreUnavailableError
from spherify.jobs.model import Job, JobStatus, Outcome, Progress, Snapshot
from spherify.jobs.ports import BlobStat, CancelOutcome, ClaimOutcome, Renewal
from spherify.jobs.rebuild import rebuild
from spherify.jobs.reconcile import Reconciler
from spherify.jobs.results import Result, read_result, write_result
from spherify.jobs.stock import Stock
from spherify.jobs.submit import submit
from spherify.stores.blobs import FolderBlobStore
from spherify.stores.memory_blobs import MemoryBlobStore
from tests.jobs.examples import job_spec
from tests.jobs.world import World, submitted

LEASE_S = 31.0


def lost_at_work(world: World, *, cancelled: bool = False, losses: int = 1) -> tuple[str, int]:
    """Submit a job that told of something and then lost its worker; returns it and the token of that attempt."""
    spec = job_spec()
    submit(world.jobs, world.blobs, world.queue, spec)
    for _ in range(losses):
        world.jobs.lose(spec.id, world.jobs.claim(spec.id, "dies").token)
    token = world.jobs.claim(spec.id, "dies").token
    world.jobs.add_snapshot(spec.id, token, Snapshot(2, "k", "s", 1, {"sphericity": 0.5}, 1.0))
    world.jobs.report(spec.id, token, Progress(2, 3), [{"iteration": 2, "sphericity": 0.5}])
    world.blobs.create(layout.numbered(layout.checkpoints(spec.id), token, 2), b"")
    if cancelled:
        assert cancel(world.jobs, world.blobs, spec.id) is CancelOutcome.CANCELLING
    world.now[0] += LEASE_S
    return spec.id, token


def ended(world: World, job_id: str) -> tuple[Job, Result]:
    """Return what record and file say of a job that nobody computes any more, once the reconciler has been there."""
    reconciler = Reconciler(world.stock, orphan_s=15)
    assert reconciler.scan().ended == (job_id,)
    assert reconciler.scan().ended == ()
    assert world.jobs.unsettled() == world.queue.pending()[1:] == []
    result = read_result(world.blobs, job_id)
    assert result is not None
    job = world.jobs.get(job_id)
    assert (job.status, job.error) == (result.outcome.status, result.outcome.error)
    assert (job.snapshots, job.progress) == (tuple(result.snapshots), result.progress)
    assert world.jobs.metrics(job_id) == list(result.rows) != []
    assert list(world.blobs.list(layout.checkpoints(job_id))) == []
    return job, result


@pytest.mark.parametrize("cancelled", [False, True], ids=["lost-too-often", "cancelled"])
def test_a_job_that_nobody_computes_any_more_is_ended_by_the_reconciler(
    world: World, cancelled: bool
) -> None:
    job, result = ended(world, lost_at_work(world, cancelled=cancelled)[0])
    assert (job.best_iteration, job.result_iteration, result.attempt) == (2, None, 2)
    if cancelled:
        assert (job.status, job.stop_reason, job.losses) == (JobStatus.CANCELLED, "cancelled", 1)
    else:
        assert (job.status, job.losses) == (JobStatus.FAILED, 2)
        assert job.error is not None
        assert job.error.code == "worker-lost"
        assert "2 times" in job.error.detail


@pytest.mark.parametrize("cancelled", [False, True], ids=["lost-too-often", "cancelled"])
def test_an_end_that_was_written_counts_though_its_worker_was_the_last_that_might_be_lost(
    world: World, cancelled: bool
) -> None:
    job_id, token = lost_at_work(world, cancelled=cancelled)
    told = Outcome(JobStatus.SUCCESSFUL, "iterations", result_iteration=2, best_iteration=2)
    snapshots = world.jobs.get(job_id).snapshots
    rows = ({"iteration": 2, "sphericity": 0.5},)
    written = write_result(
        world.blobs, Result(job_id, token, told, Progress(3, 3), snapshots, rows, whole=True)
    )
    job, result = ended(world, job_id)
    assert (job.status, job.result_iteration, result) == (JobStatus.SUCCESSFUL, 2, written)


def test_files_that_are_away_keep_no_message_from_being_sent_again(world: World) -> None:
    class Away(MemoryBlobStore):
        def read(self, key: str) -> bytes:
            raise StoreUnavailableError("the files cannot be reached")

    job_id, _ = lost_at_work(world)
    blobs, world.blobs = world.blobs, Away(world.blobs.scratch())
    waiting = job_spec()
    submit(world.jobs, world.blobs, world.queue, waiting)
    while world.queue.length():
        world.queue.take()
    world.now[0] += LEASE_S
    reconciler = Reconciler(world.stock, orphan_s=0)
    for _ in range(2):  # once to miss the message, and once more
        with pytest.raises(StoreUnavailableError):
            reconciler.scan()
        world.now[0] += LEASE_S
    assert world.queue.pending() == [waiting.id]
    world.blobs = blobs
    assert Reconciler(world.stock, orphan_s=15).scan().ended == (job_id,)


def test_whoever_sleeps_with_its_end_in_hand_finds_another_one_written(world: World) -> None:
    """Sealed, and not yet written: when the lease is over, a cancel counts, and nothing that is written later."""
    job_id, token = lost_at_work(world, losses=0)
    assert world.jobs.seal(job_id, token) is Renewal.HELD
    assert Reconciler(world.stock, orphan_s=15).scan().lost == (job_id,)
    assert cancel(world.jobs, world.blobs, job_id) is CancelOutcome.CANCELLED
    job = world.jobs.get(job_id)
    assert (job.status, job.losses, job.attempt, job.best_iteration) == (JobStatus.CANCELLED, 1, 1, 2)
    result = read_result(world.blobs, job_id)
    assert result is not None
    assert (result.outcome.status, tuple(result.snapshots)) == (JobStatus.CANCELLED, job.snapshots)
    late = Result(job_id, token, Outcome(JobStatus.SUCCESSFUL, result_iteration=2))
    assert write_result(world.blobs, late) == result
    assert not world.jobs.commit(job_id, token, late.outcome)


def test_whoever_dies_over_a_cancel_costs_no_loss(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    """Before the end is written, and before it is told: the reconciler does both, and it is no attempt."""

    class Killed(BaseException):
        pass

    def die(*_: object, **__: object) -> bool:
        raise Killed

    for step, losses in (("seal", 0), ("commit", 0)):
        spec = job_spec()
        submit(world.jobs, world.blobs, world.queue, spec)
        world.jobs.release(spec.id, world.jobs.claim(spec.id, "w").token)
        with monkeypatch.context() as patch:
            patch.setattr(world.jobs, step, die)
            with pytest.raises(Killed):
                cancel(world.jobs, world.blobs, spec.id)
        assert world.jobs.claim(spec.id, "w").outcome is ClaimOutcome.LEASED
        world.now[0] += LEASE_S
        assert Reconciler(world.stock, orphan_s=15).scan().ended == (spec.id,)
        job = world.jobs.get(spec.id)
        assert (job.status, job.losses, job.attempt) == (JobStatus.CANCELLED, losses, 1)


def test_an_end_that_finds_no_room_is_told_by_the_record_until_there_is(world: World) -> None:
    class Full(MemoryBlobStore):
        full = True

        def create(self, key: str, chunks: bytes | Iterable[bytes]) -> BlobStat:
            if self.full:
                raise StorageFullError
            return super().create(key, chunks)

    job_id, _ = lost_at_work(world)
    world.blobs = blobs = Full(world.blobs.scratch())
    reconciler = Reconciler(world.stock, orphan_s=15)
    assert reconciler.scan().ended == (job_id,)
    assert world.jobs.get(job_id).status is JobStatus.FAILED
    assert read_result(world.blobs, job_id) is None
    blobs.full = False
    assert reconciler.scan().settled == (job_id,)
    result = read_result(world.blobs, job_id)
    assert result is not None
    assert result.outcome.error == world.jobs.get(job_id).error


class NoRoom(FolderBlobStore):
    """A disk on which nothing new finds room, be it empty; only what is there may have a second name."""

    links = True

    def create(self, key: str, chunks: bytes | Iterable[bytes]) -> BlobStat:
        raise StorageFullError(f"there is no space left to store {key}")

    def copy(self, source: str, key: str) -> BlobStat:
        if not self.links:
            raise StorageFullError(f"there is no space left to store {key}")
        return super().copy(source, key)


@pytest.mark.parametrize("begun", [False, True])
def test_a_cancel_on_a_full_disk_outlives_the_records(
    stock: Stock, lose: Callable[[], object], tmp_path: Path, begun: bool
) -> None:
    spec = submitted(stock)
    if begun:
        stock.jobs.release(spec.id, stock.jobs.claim(spec.id, "w").token)
    assert cancel(stock.jobs, NoRoom(tmp_path / "blobs"), spec.id) is CancelOutcome.CANCELLED
    assert stock.jobs.get(spec.id).status is JobStatus.CANCELLED, "it can be deleted, which makes room"
    assert stock.blobs.stat(layout.result(spec.id)) is None
    lose()
    assert rebuild(stock)
    assert stock.jobs.get(spec.id).status is JobStatus.CANCELLED
    assert stock.jobs.claim(spec.id, "w").outcome is ClaimOutcome.DONE


def test_a_cancel_that_nothing_but_the_record_keeps_is_not_acknowledged(
    stock: Stock, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec = submitted(stock)
    monkeypatch.setattr(NoRoom, "links", False)
    for _ in range(2):
        with pytest.raises(StorageFullError, match="cancel it once more when there is room"):
            cancel(stock.jobs, NoRoom(tmp_path / "blobs"), spec.id)
    assert stock.jobs.claim(spec.id, "w").outcome is ClaimOutcome.DONE, "it does not run meanwhile"
    assert cancel(stock.jobs, stock.blobs, spec.id) is CancelOutcome.CANCELLED
    assert stock.blobs.stat(layout.cancel(spec.id)) is not None
