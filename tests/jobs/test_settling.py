"""Bringing files to their last state after every end: by the reconciler, bounded, one job not hindering another."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from spherify.jobs import layout, reconcile
from spherify.jobs.accounts import write_account
from spherify.jobs.cancel import cancel
from spherify.jobs.delete import delete_job
from spherify.jobs.errors import (
    JobNotFoundError,
    StorageFullError,
)
from spherify.jobs.ids import new_job_id
from spherify.jobs.model import JobStatus, Outcome, Snapshot
from spherify.jobs.ports import BlobStat, CancelOutcome, Claim, ClaimOutcome
from spherify.jobs.reconcile import Reconciler
from spherify.jobs.results import read_result, write_result
from spherify.jobs.settle import settle
from spherify.jobs.submit import submit
from spherify.stores.memory_blobs import MemoryBlobStore
from tests.jobs.examples import job_spec, result_of
from tests.jobs.world import World


def settled(world: World) -> tuple[str, ...]:
    return Reconciler(world.stock, orphan_s=15).scan().settled


def test_what_a_later_attempt_made_once_more_is_kept_once_and_what_nobody_knows_of_not_at_all(
    world: World,
) -> None:
    spec = job_spec(iterations=9, snapshots="3,6")
    submit(world.jobs, world.blobs, world.queue, spec)
    folder = layout.snapshots(spec.id)
    first = world.jobs.claim(spec.id, "w").token
    write_account(world.blobs, spec.id, Claim(ClaimOutcome.CLAIMED, first))
    for iteration in (0, 3, 6):
        world.blobs.create(layout.numbered(folder, first, iteration), b"")
    world.jobs.lose(spec.id, first)
    second = world.jobs.claim(spec.id, "w").token
    kept = {0: first, 3: second, 6: second, 9: second}  # it went on from 0, as 3 was damaged
    for iteration, token in kept.items():
        key = layout.numbered(folder, token, iteration)
        if token == second:
            world.blobs.create(key, b"")
        world.jobs.add_snapshot(spec.id, second, Snapshot(iteration, key, "s", 1, {}, 1.0))
    world.blobs.create(layout.numbered(folder, first, 7), b"")  # it was killed before it could tell of it
    world.jobs.commit(spec.id, second, Outcome(JobStatus.SUCCESSFUL, "iterations", None, 9, 9))
    assert settled(world) == (spec.id,)
    names = {stat.key for stat in world.blobs.list(layout.job_folder(spec.id))}
    kept_keys = {layout.numbered(folder, token, iteration) for iteration, token in kept.items()}
    assert names == {layout.spec(spec.id), layout.result(spec.id), *kept_keys}


def checkpoint(world: World, job_id: str) -> None:
    world.blobs.create(layout.numbered(layout.checkpoints(job_id), 1, 5), b"")


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


@pytest.mark.parametrize(
    "damaged", [b"", b"{", b"[1]", b"7", b'{"outcome": "\xff"}', b'{"job_id": "a"}', b"[" * 100_000]
)
def test_a_damaged_result_is_judged_once_and_written_anew_from_the_record(
    world: World, caplog: pytest.LogCaptureFixture, damaged: bytes
) -> None:
    spec = job_spec()
    submit(world.jobs, world.blobs, world.queue, spec)
    world.blobs.create(layout.result(spec.id), damaged)
    assert cancel(world.jobs, world.blobs, spec.id) is CancelOutcome.CANCELLED
    assert world.jobs.unsettled() == []
    result = read_result(world.blobs, spec.id)
    assert result is not None
    assert result.outcome.status is JobStatus.CANCELLED
    settle(world.jobs, world.blobs, spec.id)
    assert write_result(world.blobs, result_of(spec.id, 9)) == result, "the first one wins there, too"
    assert [record.__dict__["job_id"] for record in caplog.records if "damaged" in record.message] == [
        spec.id
    ]


def test_a_result_that_was_altered_is_no_result(world: World) -> None:
    write_result(world.blobs, result_of("job_a", 1))
    text = world.blobs.read(layout.result("job_a"))
    world.blobs.create(layout.result("job_b"), text.replace(b'"iteration":2', b'"iteration":3'))
    assert read_result(world.blobs, "job_b") is None
    old = json.loads(text)
    del old["sha256"]
    world.blobs.create(layout.result("job_c"), json.dumps(old).encode())
    assert read_result(world.blobs, "job_c") == result_of("job_a", 1), "of before there were checksums"


def test_where_every_result_is_damaged_the_record_alone_tells_the_end(world: World) -> None:
    spec = job_spec()
    submit(world.jobs, world.blobs, world.queue, spec)
    for key in (layout.result(spec.id), layout.result_again(spec.id)):
        world.blobs.create(key, b"{")
    world.jobs.request_cancel(spec.id)
    assert settled(world) == (spec.id,)
    assert settled(world) == ()


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

        def copy(self, source: str, key: str) -> BlobStat:
            return super().create(key, self.read(source))

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
