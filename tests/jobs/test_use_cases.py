"""Submitting, cancelling, deleting, reconciling, and the end of a job, over the twins in memory."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from spherify.jobs import layout, reconcile
from spherify.jobs.cancel import cancel
from spherify.jobs.codec import load_spec
from spherify.jobs.delete import delete_job, delete_mesh
from spherify.jobs.errors import (
    BlobNotFoundError,
    JobGoneError,
    JobNotFoundError,
    MeshNotFoundError,
    StorageFullError,
    StoreUnavailableError,
)
from spherify.jobs.ids import earliest_job_id, is_job_id, job_id_at, new_job_id
from spherify.jobs.model import JobError, JobStatus, Outcome, Progress, Snapshot
from spherify.jobs.orphans import Orphans
from spherify.jobs.ports import BlobStat, CancelOutcome
from spherify.jobs.rebuild import Stock
from spherify.jobs.reconcile import Reconciler, sweep_scratch
from spherify.jobs.results import Result, publish_result, read_result, write_result
from spherify.jobs.settle import settle
from spherify.jobs.submit import submit
from spherify.stores.memory import MemoryJobStore
from spherify.stores.memory_blobs import MemoryBlobStore
from spherify.stores.memory_meshes import MemoryJobQueue, MemoryMeshStore
from tests.jobs.examples import job_spec, mesh_record


@dataclass
class World:
    jobs: MemoryJobStore
    meshes: MemoryMeshStore
    blobs: MemoryBlobStore
    queue: MemoryJobQueue
    now: list[float]

    @property
    def stock(self) -> Stock:
        return Stock(self.jobs, self.meshes, self.blobs, self.queue)


@pytest.fixture
def world(tmp_path: Path) -> World:
    now = [1000.0]
    jobs = MemoryJobStore(lease_s=30, max_losses=1, clock=lambda: now[0])
    meshes = MemoryMeshStore(jobs)
    meshes.add(mesh_record())
    return World(jobs, meshes, MemoryBlobStore(tmp_path), MemoryJobQueue(), now)


class BrokenQueue(MemoryJobQueue):
    def send(self, job_id: str) -> None:
        raise StoreUnavailableError


def test_a_submitted_job_is_durable_recorded_and_sent(world: World) -> None:
    spec = job_spec(snapshots="1,2", tags=("t",))
    job = submit(world.jobs, world.blobs, world.queue, spec)
    assert job.status is JobStatus.ACCEPTED
    assert load_spec(world.blobs.read(layout.spec(spec.id))) == spec
    assert world.queue.pending() == [spec.id]
    assert submit(world.jobs, world.blobs, world.queue, spec) == job


def test_a_message_that_cannot_be_sent_is_no_error(world: World) -> None:
    spec = job_spec()
    assert submit(world.jobs, world.blobs, BrokenQueue(), spec).status is JobStatus.ACCEPTED
    assert world.jobs.waiting(0) == [spec.id]


def test_a_job_on_a_mesh_that_is_gone_leaves_no_trace(world: World) -> None:
    world.meshes.delete(mesh_record().id)
    spec = job_spec()
    with pytest.raises(MeshNotFoundError):
        submit(world.jobs, world.blobs, world.queue, spec)
    with pytest.raises(JobNotFoundError):
        world.jobs.get(spec.id)
    assert list(world.blobs.list("")) == []
    assert world.queue.pending() == []


def test_a_job_no_queue_holds_is_sent_after_two_scans(world: World) -> None:
    spec = job_spec()
    submit(world.jobs, world.blobs, BrokenQueue(), spec)
    reconciler = Reconciler(world.stock, orphan_s=15)
    assert reconciler.scan().orphans == ()  # it is young
    world.now[0] += 16
    assert reconciler.scan().orphans == ()  # missed once: it may be on its way
    assert reconciler.scan().orphans == (spec.id,)
    assert world.queue.pending() == [spec.id]
    assert [reconciler.scan().orphans for _ in range(3)] == [(), (), ()]
    assert world.queue.take() == spec.id  # and whoever has it dies before the claim
    assert [reconciler.scan().orphans for _ in range(3)] == [(), (spec.id,), ()]


def test_a_long_queue_is_read_in_slices_and_nothing_in_it_is_sent_twice(world: World) -> None:
    specs = [job_spec() for _ in range(7)]
    for spec in specs:
        submit(world.jobs, world.blobs, BrokenQueue() if spec is specs[2] else world.queue, spec)
    world.now[0] += 100
    orphans = Orphans(world.jobs, world.queue, orphan_s=15, slice_=2)
    found: list[str] = []
    for _ in range(8):  # two rounds of four looks
        newcomer = job_spec()
        submit(world.jobs, world.blobs, world.queue, newcomer)  # moves what the round has not seen yet
        found += orphans.look()
        if world.queue.length() > 4:
            world.jobs.claim(world.queue.take(), "w")
    for _ in range(20):
        found += orphans.look()
    assert found[:1] == [specs[2].id]
    assert set(found) == {specs[2].id}


def test_a_job_whose_lease_ran_out_is_sent_again_until_it_is_poison(world: World) -> None:
    spec = job_spec()
    submit(world.jobs, world.blobs, world.queue, spec)
    reconciler = Reconciler(world.stock, orphan_s=15)
    for expected in ((spec.id,), ()):
        world.queue.take()
        world.jobs.claim(spec.id, "w")
        assert reconciler.scan().lost == ()
        world.now[0] += 31
        assert reconciler.scan().lost == expected
    assert world.jobs.get(spec.id).status is JobStatus.FAILED


def test_a_waiting_job_is_cancelled_for_good(world: World) -> None:
    spec = job_spec()
    submit(world.jobs, world.blobs, world.queue, spec)
    assert cancel(world.jobs, world.blobs, spec.id) is CancelOutcome.CANCELLED
    assert cancel(world.jobs, world.blobs, spec.id) is CancelOutcome.CANCELLED
    result = read_result(world.blobs, spec.id)
    assert result is not None
    assert result.outcome.status is JobStatus.CANCELLED
    assert cancel(world.jobs, world.blobs, new_job_id()[0]) is CancelOutcome.UNKNOWN


def test_a_running_job_is_only_told(world: World) -> None:
    spec = job_spec()
    submit(world.jobs, world.blobs, world.queue, spec)
    world.jobs.claim(spec.id, "w")
    assert cancel(world.jobs, world.blobs, spec.id) is CancelOutcome.CANCELLING
    assert read_result(world.blobs, spec.id) is None


def result_of(job_id: str, token: int) -> Result:
    return Result(
        job_id,
        token,
        Outcome(JobStatus.FAILED, "collapsed", "it broke", 1, 1, JobError("collapsed", "it broke; try ü")),
        Progress(2, 3, 1.0, 1.0, 2.0),
        (Snapshot(0, "k", "s", 1, {"sphericity": 0.5}, 1.0), Snapshot(1, "l", "t", 2, {}, 2.0)),
        ({"iteration": 0, "sphericity": 0.5}, {"iteration": 1, "sphericity": 0.1 + 0.2}),
    )


def test_the_first_result_counts(world: World) -> None:
    first = result_of("job_a", 1)
    assert write_result(world.blobs, first) is first
    assert write_result(world.blobs, Result("job_a", 2, Outcome(JobStatus.SUCCESSFUL))) == first
    assert read_result(world.blobs, "job_a") == first
    assert read_result(world.blobs, "job_b") is None
    assert json.loads(world.blobs.read(layout.result("job_a")))["snapshots"][1]["sha256"] == "t"


def test_any_attempt_can_tell_the_record_of_a_result(world: World) -> None:
    spec = job_spec()
    submit(world.jobs, world.blobs, world.queue, spec)
    world.jobs.claim(spec.id, "dies")
    result = write_result(world.blobs, result_of(spec.id, 1))
    world.now[0] += 31
    token = world.jobs.claim(spec.id, "finds it").token
    assert not publish_result(world.jobs, 1, result)  # the first one is fenced
    assert publish_result(world.jobs, token, result)
    assert publish_result(world.jobs, token, result)
    job = world.jobs.get(spec.id)
    assert (job.status, job.error, job.result_iteration) == (JobStatus.FAILED, result.outcome.error, 1)
    assert job.snapshots == tuple(result.snapshots)
    assert world.jobs.metrics(spec.id) == list(result.rows)
    assert job.progress == result.progress


def test_a_cancel_after_a_crash_between_file_and_record_comes_too_late(world: World) -> None:
    spec = job_spec()
    submit(world.jobs, world.blobs, world.queue, spec)
    result = write_result(world.blobs, result_of(spec.id, world.jobs.claim(spec.id, "dies").token))
    assert (
        cancel(world.jobs, world.blobs, spec.id) is CancelOutcome.FINISHED
    )  # its lease lasts: nothing is touched
    assert world.jobs.get(spec.id).status is JobStatus.RUNNING
    world.now[0] += 31
    assert cancel(world.jobs, world.blobs, spec.id) is CancelOutcome.FINISHED
    job = world.jobs.get(spec.id)
    assert (job.status, job.error) == (JobStatus.FAILED, result.outcome.error)  # as the file says
    assert job.snapshots == tuple(result.snapshots)


def test_deleting_removes_the_files(world: World) -> None:
    spec, mesh = job_spec(), mesh_record()
    world.blobs.create(layout.mesh_arrays(mesh.id), b"")
    submit(world.jobs, world.blobs, world.queue, spec)
    cancel(world.jobs, world.blobs, spec.id)
    delete_job(world.jobs, world.blobs, spec.id)
    with pytest.raises(JobGoneError):
        world.jobs.get(spec.id)
    assert list(world.blobs.list(layout.job_folder(spec.id))) == []
    delete_mesh(world.meshes, world.blobs, mesh.id)
    with pytest.raises(MeshNotFoundError):
        world.meshes.get(mesh.id)
    with pytest.raises(BlobNotFoundError):
        world.blobs.read(layout.mesh_arrays(mesh.id))


def settled(world: World) -> tuple[str, ...]:
    return Reconciler(world.stock, orphan_s=15).scan().settled


def checkpoint(world: World, job_id: str) -> None:
    world.blobs.create(layout.numbered(layout.checkpoints(job_id), 1, 5), b"")


@pytest.mark.parametrize("end", ["poison", "cancelled and lost", "cancelled and released"])
def test_a_job_the_record_ended_gets_its_result_from_the_reconciler(world: World, end: str) -> None:
    spec = job_spec()
    submit(world.jobs, world.blobs, world.queue, spec)
    token = world.jobs.claim(spec.id, "w").token
    world.jobs.add_snapshot(spec.id, token, Snapshot(0, "k", "s", 1, {"sphericity": 0.5}, 1.0))
    world.jobs.report(spec.id, token, Progress(2, 3), [{"iteration": 0, "sphericity": 0.5}])
    checkpoint(world, spec.id)
    if end == "poison":
        world.jobs.lose(spec.id, token)
        world.jobs.lose(spec.id, world.jobs.claim(spec.id, "w").token)
    else:
        world.jobs.request_cancel(spec.id)
        (world.jobs.lose if end == "cancelled and lost" else world.jobs.release)(spec.id, token)
    assert settled(world) == (spec.id,)
    job = world.jobs.get(spec.id)
    assert job.status.done
    result = read_result(world.blobs, spec.id)
    assert result is not None
    assert (result.outcome.status, result.outcome.error) == (job.status, job.error)
    assert (result.snapshots, result.progress) == (job.snapshots, job.progress)
    assert list(result.rows) == world.jobs.metrics(spec.id) != []
    assert list(world.blobs.list(layout.checkpoints(spec.id))) == []
    assert settled(world) == ()


def test_a_worker_that_died_after_its_commit_leaves_no_checkpoints(world: World) -> None:
    spec = job_spec()
    submit(world.jobs, world.blobs, world.queue, spec)
    token = world.jobs.claim(spec.id, "dies").token
    checkpoint(world, spec.id)
    result = write_result(world.blobs, result_of(spec.id, token))
    world.jobs.commit(spec.id, token, result.outcome)
    assert settled(world) == (spec.id,)
    assert list(world.blobs.list(layout.checkpoints(spec.id))) == []
    assert read_result(world.blobs, spec.id) == result


def test_files_of_a_job_whose_deletion_was_broken_off_are_removed(world: World) -> None:
    spec = job_spec()
    submit(world.jobs, world.blobs, world.queue, spec)
    cancel(world.jobs, world.blobs, spec.id)
    world.jobs.delete(spec.id)  # and then the process died
    assert list(world.blobs.list(layout.job_folder(spec.id))) != []
    assert settled(world) == (spec.id,)
    assert list(world.blobs.list(layout.job_folder(spec.id))) == []


def test_a_job_deleted_while_it_is_settled_leaves_no_files(world: World) -> None:
    spec = job_spec()
    submit(world.jobs, world.blobs, world.queue, spec)
    world.jobs.request_cancel(spec.id)

    class Slow(MemoryBlobStore):
        """Somebody deletes the job just before its result is written."""

        def create(self, key: str, chunks: bytes | Iterable[bytes]) -> BlobStat:
            delete_job(world.jobs, world.blobs, spec.id)
            return world.blobs.create(key, chunks)

        def list(self, prefix: str) -> Iterator[BlobStat]:
            return world.blobs.list(prefix)

        def delete(self, key: str) -> bool:
            return world.blobs.delete(key)

    settle(world.jobs, Slow(world.blobs.scratch()), spec.id)
    assert list(world.blobs.list(layout.job_folder(spec.id))) == []
    assert world.jobs.unsettled() == []


def test_a_full_disk_puts_the_result_off(world: World) -> None:
    class Full(MemoryBlobStore):
        full = False

        def create(self, key: str, chunks: bytes | Iterable[bytes]) -> BlobStat:
            if self.full:
                raise StorageFullError
            return super().create(key, chunks)

    world.blobs = blobs = Full(world.blobs.scratch())
    spec = job_spec()
    submit(world.jobs, blobs, world.queue, spec)
    blobs.full = True
    assert cancel(world.jobs, blobs, spec.id) is CancelOutcome.CANCELLED
    assert settled(world) == ()
    blobs.full = False
    assert settled(world) == (spec.id,)
    assert read_result(blobs, spec.id) is not None


def test_files_that_cannot_be_removed_do_not_keep_others_from_being_settled(world: World) -> None:
    class Stuck(MemoryBlobStore):
        def list(self, prefix: str) -> Iterator[BlobStat]:
            if prefix == layout.checkpoints(specs[0].id):
                raise PermissionError(13, "not yours")
            return super().list(prefix)

    specs = [job_spec(), job_spec()]
    world.blobs = Stuck(world.blobs.scratch())
    for spec in specs:
        submit(world.jobs, world.blobs, world.queue, spec)
        world.jobs.request_cancel(spec.id)
    assert settled(world) == (specs[1].id,)
    assert world.jobs.unsettled() == [specs[0].id]


def test_what_is_wrong_with_one_job_or_one_part_of_a_scan_is_not_in_the_way_of_the_others(
    world: World,
) -> None:
    class Broken(MemoryBlobStore):
        def list(self, prefix: str) -> Iterator[BlobStat]:
            if prefix == layout.checkpoints(ended[0].id):
                raise ZeroDivisionError  # whatever it is
            return super().list(prefix)

        def scratch(self) -> Path:
            raise ZeroDivisionError

    ended, lost = [job_spec(), job_spec()], job_spec()
    world.blobs = Broken(world.blobs.scratch())
    for spec in (*ended, lost):
        submit(world.jobs, world.blobs, world.queue, spec)
    for spec in ended:
        world.jobs.request_cancel(spec.id)
    world.jobs.claim(lost.id, "w")
    world.now[0] += 31
    scan = Reconciler(world.stock, orphan_s=15).scan()
    assert (scan.lost, scan.settled, scan.swept) == ((lost.id,), (ended[1].id,), ())


def test_a_scan_settles_some_and_the_next_ones_the_rest(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reconcile, "_SETTLED", 2)
    specs = [job_spec() for _ in range(5)]
    for spec in specs:
        submit(world.jobs, world.blobs, world.queue, spec)
        world.jobs.request_cancel(spec.id)
    reconciler = Reconciler(world.stock, orphan_s=15)
    ids = sorted(spec.id for spec in specs)
    assert [reconciler.scan().settled for _ in range(3)] == [tuple(ids[:2]), tuple(ids[2:4]), tuple(ids[4:])]


def test_settling_touches_nothing_that_goes_on_or_is_unknown(world: World) -> None:
    spec = job_spec()
    submit(world.jobs, world.blobs, world.queue, spec)
    before = list(world.blobs.list(""))
    settle(world.jobs, world.blobs, spec.id)
    assert list(world.blobs.list("")) == before
    unknown = new_job_id()[0]
    world.blobs.create(layout.spec(unknown), b"")
    with pytest.raises(JobNotFoundError):
        settle(world.jobs, world.blobs, unknown)
    assert world.blobs.stat(layout.spec(unknown)) is not None


def test_old_scratch_files_are_swept(tmp_path: Path) -> None:
    old, young = tmp_path / "old", tmp_path / "young"
    for path in (old, young):
        path.write_bytes(b"")
    os.utime(old, (1.0, 1.0))
    assert sweep_scratch(tmp_path.iterdir(), 3600.0) == ("old",)
    assert [path.name for path in tmp_path.iterdir()] == ["young"]
    assert sweep_scratch([old], 3600.0) == ()  # somebody was quicker


def test_identifiers_sort_by_time_and_are_recognised() -> None:
    made = [job_id_at(1_700_000_000.0 + i / 1000) for i in range(5)]
    assert made == sorted(made)
    assert all(is_job_id(job_id) for job_id in made)
    assert made[1] < earliest_job_id(1_700_000_000.002) <= made[2]
    job_id, created = new_job_id()
    assert earliest_job_id(created) <= job_id
    for text in ("", "job_", made[0].lower(), made[0] + "0", "mesh" + made[0][3:], made[0] + "\n"):
        assert not is_job_id(text)


def test_names_of_files_sort_as_numbers_and_tell_them() -> None:
    keys = [layout.numbered(layout.snapshots("j"), token, it) for token in (2, 10) for it in (9, 100)]
    assert keys == sorted(keys)
    assert [layout.numbers(key) for key in keys] == [(2, 9), (2, 100), (10, 9), (10, 100)]
