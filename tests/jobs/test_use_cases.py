"""Submitting, cancelling, deleting, reconciling, and the end of a job, over the twins in memory."""

from __future__ import annotations

import json
import os
import resource
from pathlib import Path

import pytest

from spherify.jobs import layout
from spherify.jobs.cancel import cancel
from spherify.jobs.codec import load_spec
from spherify.jobs.delete import delete_job, delete_mesh
from spherify.jobs.errors import (
    BlobNotFoundError,
    JobGoneError,
    JobNotFoundError,
    MeshNotFoundError,
    StoreUnavailableError,
)
from spherify.jobs.ids import earliest_job_id, is_job_id, job_id_at, new_job_id
from spherify.jobs.model import JobStatus, Outcome, RequestKey
from spherify.jobs.orphans import Orphans
from spherify.jobs.ports import BlobStat, CancelOutcome, Renewal
from spherify.jobs.reconcile import Reconciler, sweep_scratch
from spherify.jobs.results import Result, publish_result, read_result, write_result
from spherify.jobs.submit import submit
from spherify.stores.blobs import FolderBlobStore
from spherify.stores.memory_meshes import MemoryJobQueue
from tests.jobs.examples import job_spec, mesh_record, result_of
from tests.jobs.world import World


class BrokenQueue(MemoryJobQueue):
    def send(self, job_id: str, *, ahead: bool = False) -> None:
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


def test_a_lease_that_ran_out_while_the_server_was_away_is_no_loss(world: World) -> None:
    spec, other = job_spec(), job_spec()
    reconciler = Reconciler(world.stock, orphan_s=15)
    for one in (spec, other):
        submit(world.jobs, world.blobs, world.queue, one)
    for _ in range(3):  # the cap is one loss
        tokens = [world.jobs.claim(one.id, "w").token for one in (spec, other)]
        world.now[0] += 60
        reconciler.after_outage()
        assert reconciler.scan().lost == (), "workers get the time to say that they live"
        assert world.jobs.renew(other.id, tokens[1]) is Renewal.HELD
        assert reconciler.scan().lost == (spec.id,)
        assert world.jobs.get(spec.id).losses == 0
        assert world.jobs.release(other.id, tokens[1])
    world.jobs.claim(spec.id, "w")
    world.now[0] += 60
    assert reconciler.scan().lost == (spec.id,)
    assert world.jobs.get(spec.id).losses == 1, "and then they count again"


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
    token = world.jobs.claim(spec.id, "dies").token
    world.jobs.seal(spec.id, token)
    result = write_result(world.blobs, result_of(spec.id, token))
    assert (
        cancel(world.jobs, world.blobs, spec.id) is CancelOutcome.FINISHED
    )  # its lease lasts: nothing is touched
    assert world.jobs.get(spec.id).status is JobStatus.RUNNING
    world.now[0] += 31
    assert cancel(world.jobs, world.blobs, spec.id) is CancelOutcome.FINISHED
    job = world.jobs.get(spec.id)
    assert (job.status, job.error) == (JobStatus.FAILED, result.outcome.error)  # as the file says
    assert job.snapshots == tuple(result.snapshots)
    assert job.losses == 0
    assert world.blobs.stat(layout.cancel(spec.id)) is None, "nobody was told of a cancel"


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


@pytest.mark.parametrize("anew", [False, True])
def test_a_mesh_recorded_while_it_is_deleted_has_its_files_or_no_record(
    world: World, tmp_path: Path, anew: bool
) -> None:
    """An upload of the same bytes finds all files before the first of them is removed, or writes them anew after."""
    mesh = mesh_record()
    files = {
        layout.mesh_arrays(mesh.id): b"arrays",
        layout.mesh_original(mesh.id, mesh.format): b"bytes",
        layout.mesh_record(mesh.id): b"record",
    }

    class Meanwhile(FolderBlobStore):
        def delete(self, key: str) -> bool:
            if not anew and key == layout.mesh_record(mesh.id) and Path(self.root, key).exists():
                assert world.meshes.add(mesh)
            return super().delete(key)

        def stat(self, key: str) -> BlobStat | None:
            gone = not any(Path(self.root, name).exists() for name in files)
            if anew and gone and key == layout.mesh_arrays(mesh.id):
                assert world.meshes.add(mesh)
                for name, content in files.items():
                    self.create(name, content)
            return super().stat(key)

    blobs = Meanwhile(tmp_path / "blobs")
    for name, content in files.items():
        blobs.create(name, content)
    delete_mesh(world.meshes, blobs, mesh.id)
    assert world.meshes.unknown([mesh.id]) == ([] if anew else [mesh.id])
    assert {blob.key for blob in blobs.list(layout.mesh_folder(mesh.id))} == (set(files) if anew else set())


def test_a_full_disk_is_no_reason_not_to_delete(world: World, tmp_path: Path) -> None:
    """What there is no room for is the key; a name without content still says that the job was deleted."""
    blobs = FolderBlobStore(tmp_path / "blobs")
    spec = job_spec(request=RequestKey("name", "fingerprint"))
    submit(world.jobs, blobs, world.queue, spec)
    cancel(world.jobs, blobs, spec.id)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, before[1]))  # the kernel refuses to write a byte
    try:
        delete_job(world.jobs, blobs, spec.id)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert [stat.key for stat in blobs.list("")] == [layout.tombstone(spec.id)]
    assert blobs.read(layout.tombstone(spec.id)) == b""


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
