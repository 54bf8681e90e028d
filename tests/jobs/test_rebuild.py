"""What comes back after a loss of records, and what does not: over the twins, and over a real server and folder."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import redis

from spherify.jobs import inventory, layout, rows
from spherify.jobs.accounts import write_account
from spherify.jobs.codec import dump_record
from spherify.jobs.continuation import extension
from spherify.jobs.delete import delete_job, delete_mesh
from spherify.jobs.errors import (
    JobGoneError,
    JobNotFoundError,
    KeyReusedError,
    MeshNotFoundError,
    StoreUnavailableError,
)
from spherify.jobs.ids import new_job_id
from spherify.jobs.inventory import Inventory
from spherify.jobs.model import JobError, JobSpec, JobStatus, Outcome, Progress, RequestKey, Snapshot
from spherify.jobs.ports import CancelOutcome
from spherify.jobs.rebuild import rebuild
from spherify.jobs.repeats import KEPT_S, Beginning
from spherify.jobs.results import Result, write_result
from spherify.jobs.settle import settle
from spherify.jobs.stock import Stock
from spherify.jobs.submit import submit
from spherify.stores import keys
from spherify.stores.arrays import dump_arrays
from tests.jobs.examples import MESH_ID, job_spec, mesh_record
from tests.jobs.world import submitted

ROWS = [{"iteration": 0, "sphericity": 0.5}, {"iteration": 3, "sphericity": 0.1 + 0.2}]


def ended(
    stock: Stock, outcome: Outcome, waiting: Callable[[], object] = lambda: None, **changes: object
) -> JobSpec:
    """Submit a job and let a worker's part be played to its end; `waiting` is called before that."""
    spec = submitted(stock, tags=("a", "b"), **changes)
    waiting()
    token = stock.jobs.claim(spec.id, "w").token
    snapshots = (Snapshot(0, "k", "s", 1, {"sphericity": 0.5}, 1.0), Snapshot(3, "l", "t", 2, {}, 2.0))
    progress = Progress(3, 3, 1.5, 0.0, 2.0)
    for snapshot in snapshots:
        stock.jobs.add_snapshot(spec.id, token, snapshot)
    stock.jobs.report(spec.id, token, progress, ROWS)
    job = stock.jobs.get(spec.id)
    write_result(
        stock.blobs,
        Result(spec.id, token, outcome, progress, snapshots, ROWS, job.started_at, job.attempt, job.losses),
    )
    stock.jobs.commit(spec.id, token, outcome)
    settle(stock.jobs, stock.blobs, spec.id)
    return spec


@pytest.mark.parametrize(
    "outcome",
    [
        Outcome(JobStatus.SUCCESSFUL, "converged", None, 3, 3),
        Outcome(JobStatus.FAILED, "collapsed", "it broke", 0, 0, JobError("collapsed", "it broke; try ü")),
        Outcome(JobStatus.CANCELLED, "cancelled", None, None, 3),
    ],
)
def test_an_ended_job_comes_back_as_it_was(
    stock: Stock, lose: Callable[[], object], outcome: Outcome
) -> None:
    spec = ended(stock, outcome)
    before = stock.jobs.get(spec.id)
    lose()
    assert rebuild(stock)
    after = stock.jobs.get(spec.id)
    assert after.rev > before.rev
    assert after.token > before.token
    assert after.finished_at == pytest.approx(before.finished_at, abs=5)
    assert replace(after, rev=0, token=0, finished_at=0) == replace(before, rev=0, token=0, finished_at=0)
    assert stock.jobs.metrics(spec.id) == ROWS
    for found in (
        stock.jobs.find(status=outcome.status),
        stock.jobs.find(tag="b"),
        stock.jobs.find(mesh_id=MESH_ID),
        stock.jobs.find(),
    ):
        assert found.items == (after,)
    assert stock.jobs.waiting(0) == []
    assert stock.queue.pending() == []
    assert not rebuild(stock)


def test_a_job_that_had_not_ended_waits_again_with_a_token_beyond_all_others(
    stock: Stock, lose: Callable[[], object]
) -> None:
    early, late = submitted(stock, at=1_700_000_000.0), submitted(stock)
    token = stock.jobs.claim(early.id, "w").token
    future = 10**15
    stock.blobs.create(layout.numbered(layout.checkpoints(late.id), future, 7), b"")
    lose()
    rebuild(stock)
    assert stock.jobs.waiting(0) == [early.id, late.id]
    assert sorted(stock.queue.pending()) == sorted([early.id, late.id])
    assert stock.jobs.get(early.id).started_at is None
    assert not stock.jobs.report(early.id, token, Progress(1, 3))  # the attempt of before is fenced
    assert stock.jobs.claim(early.id, "w").token > time.time() * 1000 - 60_000
    assert stock.jobs.claim(late.id, "w").token == future + 2


def test_what_attempts_have_cost_is_not_forgotten(stock: Stock, lose: Callable[[], object]) -> None:
    """So neither poison nor a job beyond its limit begins anew, however often the records are lost."""
    spec, young = submitted(stock), submitted(stock)
    first = stock.jobs.claim(spec.id, "w")
    write_account(stock.blobs, spec.id, first)
    stock.jobs.lose(spec.id, first.token)
    second = replace(stock.jobs.claim(spec.id, "w"), spent_s=100.0)
    write_account(stock.blobs, spec.id, second)
    key = layout.numbered(layout.checkpoints(spec.id), second.token, 7)
    stock.blobs.create(key, b"")
    with stock.blobs.open(key) as file:
        path = file.name
    began = stock.blobs.stat(layout.account(spec.id, second.token))
    assert began is not None
    os.utime(path, (began.created_at + 20, began.created_at + 20))
    lose()
    rebuild(stock)
    job = stock.jobs.get(spec.id)
    assert (job.attempt, job.losses) == (2, 1)
    claim = stock.jobs.claim(spec.id, "w")
    assert claim.spent_s == pytest.approx(120.0, abs=0.01)
    assert (claim.attempt, claim.losses) == (3, 1)
    assert stock.jobs.claim(young.id, "w").spent_s == 0


@pytest.mark.parametrize("damaged", [b"", b"{", b"[1]", b'{"attempt": 3}'])
def test_a_job_whose_account_is_damaged_comes_back_with_the_one_before(
    stock: Stock, lose: Callable[[], object], damaged: bytes
) -> None:
    spec = submitted(stock)
    claim = stock.jobs.claim(spec.id, "w")
    write_account(stock.blobs, spec.id, replace(claim, losses=1, spent_s=100.0))
    stock.blobs.create(layout.account(spec.id, claim.token + 1), damaged)
    lose()
    rebuild(stock)
    job = stock.jobs.get(spec.id)
    assert (job.status, job.attempt, job.losses) == (JobStatus.ACCEPTED, 1, 1)
    assert stock.jobs.claim(spec.id, "w").spent_s == pytest.approx(100.0, abs=0.01)


def test_a_key_comes_back_with_its_job_for_the_rest_of_its_day(
    stock: Stock, lose: Callable[[], object], client: redis.Redis
) -> None:
    now = time.time()
    fresh = submitted(stock, at=now - 3600, request=RequestKey("fresh", "f"))
    done = ended(stock, Outcome(JobStatus.SUCCESSFUL), request=RequestKey("done", "g"))
    submitted(stock, at=now - KEPT_S - 1, request=RequestKey("old", "h"))
    child = extension(stock.jobs.get(done.id), new_job_id()[0], 5, "")
    assert child.request is None, "a key is the name of one job"
    lose()
    with pytest.raises(StoreUnavailableError):  # it may be among those that come back
        stock.repeats.begin("fresh", "f", "another")
    rebuild(stock)
    assert set(client.scan_iter(keys.repeat("*"))) == {keys.repeat("fresh"), keys.repeat("done")}
    assert client.ttl(keys.repeat("fresh")) == pytest.approx(KEPT_S - 3600, abs=30)
    with pytest.raises(KeyReusedError):
        stock.repeats.begin("fresh", "something else", "another")
    assert stock.repeats.begin("fresh", "f", "another") == Beginning(fresh.id)
    assert stock.repeats.begin("done", "g", "another") == Beginning(done.id)


def test_what_was_deleted_stays_deleted(stock: Stock, lose: Callable[[], object]) -> None:
    kept = ended(stock, Outcome(JobStatus.SUCCESSFUL))
    gone, broken_off = (ended(stock, Outcome(JobStatus.SUCCESSFUL)) for _ in range(2))
    other = mesh_record("mesh_" + "2" * 26)
    stock.blobs.create(layout.mesh_record(other.id), dump_record(other).encode())
    stock.meshes.add(other)
    delete_job(stock.jobs, stock.blobs, gone.id)
    stock.blobs.create(layout.tombstone(broken_off.id), b"")
    stock.jobs.delete(broken_off.id)  # and then the process died, with all files in place
    delete_mesh(stock.meshes, stock.blobs, other.id)
    lose()
    rebuild(stock)
    for spec in (gone, broken_off):
        with pytest.raises(JobGoneError):
            stock.jobs.get(spec.id)
    with pytest.raises(MeshNotFoundError):
        stock.meshes.get(other.id)
    assert [job.id for job in stock.jobs.find().items] == [kept.id]
    assert list(stock.blobs.folders(layout.jobs())) == [kept.id], (
        "else it would come back after the tombstone"
    )


def test_until_everything_is_back_nothing_is_said_to_be_missing(
    stock: Stock, lose: Callable[[], object], client: redis.Redis
) -> None:
    spec = ended(stock, Outcome(JobStatus.SUCCESSFUL))
    lose()
    asked: list[Callable[[], object]] = [
        stock.jobs.ping,
        stock.jobs.find,
        lambda: stock.jobs.get(spec.id),
        lambda: stock.jobs.metrics(spec.id),
        lambda: stock.jobs.request_cancel(spec.id),
        lambda: stock.jobs.delete(spec.id),
        lambda: stock.meshes.get(MESH_ID),
        stock.meshes.find,
        lambda: stock.meshes.delete(MESH_ID),
        lambda: submit(stock.jobs, stock.blobs, stock.queue, spec),  # once more, under an Idempotency-Key
        lambda: submit(stock.jobs, stock.blobs, stock.queue, job_spec()),  # its mesh is not there
    ]
    for ask in asked:
        with pytest.raises(StoreUnavailableError):
            ask()
    rebuild(stock)
    for ask in (asked[0], asked[1], asked[2], asked[3], asked[6], asked[7]):
        ask()
    assert asked[4]() is CancelOutcome.FINISHED
    assert submit(stock.jobs, stock.blobs, stock.queue, spec).status is JobStatus.SUCCESSFUL
    assert client.exists(keys.EPOCH)


def test_a_job_that_a_client_was_refused_never_comes_back(stock: Stock, lose: Callable[[], object]) -> None:
    lose()  # the mesh is not there, for now
    spec = job_spec()
    with pytest.raises(StoreUnavailableError):
        submit(stock.jobs, stock.blobs, stock.queue, spec)
    rebuild(stock)
    with pytest.raises(JobNotFoundError):
        stock.jobs.get(spec.id)
    assert (
        submit(stock.jobs, stock.blobs, stock.queue, spec).status is JobStatus.ACCEPTED
    )  # the client insists
    lose()
    rebuild(stock)
    assert stock.jobs.get(spec.id).status is JobStatus.ACCEPTED


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b'{"id": 1}'])
def test_files_of_another_form_are_not_in_the_way(
    stock: Stock, lose: Callable[[], object], content: bytes
) -> None:
    spoilt, whole = job_spec(), job_spec()
    stock.blobs.create(layout.spec(spoilt.id), content)
    stock.blobs.create("meshes/mesh_spoilt/record.json", content)
    for name in ("no-job", job_spec().id):
        stock.blobs.create(layout.spec(name), dump_record(whole).encode())
    submit(stock.jobs, stock.blobs, stock.queue, whole)
    lose()
    assert rebuild(stock)
    assert [job.id for job in stock.jobs.find().items] == [whole.id]
    assert [mesh.id for mesh in stock.meshes.find().items] == [MESH_ID]


def test_files_of_others_beside_ours_are_not_in_the_way_of_a_job(
    stock: Stock, lose: Callable[[], object], tmp_path: Path
) -> None:
    spec = submitted(stock)
    write_account(stock.blobs, spec.id, replace(stock.jobs.claim(spec.id, "w"), losses=1))
    key = layout.numbered(layout.snapshots(spec.id), 1, 0)
    stock.blobs.create(key, dump_arrays({"vertices": np.zeros((3, 3)), rows.ROWS: np.zeros(3)}))
    stock.blobs.create(layout.cancel(spec.id), b"")
    for folder in (layout.snapshots(spec.id), layout.attempts(spec.id), layout.checkpoints(spec.id)):
        for name in ("notes.txt", ".nfs0001", "1.json", "x-1.npz"):
            path = tmp_path / "blobs" / folder / name
            path.parent.mkdir(exist_ok=True)
            path.write_bytes(b"")
    lose()
    rebuild(stock)
    job = stock.jobs.get(spec.id)
    assert (job.status, job.losses) == (JobStatus.CANCELLED, 1)
    assert [(snapshot.key, snapshot.metrics) for snapshot in job.snapshots] == [(key, {})]
    assert stock.blobs.stat(key) is not None, "it can be served"


# A server that lost some records and kept the others


def rounds(stock: Stock, number: int = 3, slice_: int = 2) -> list[str]:
    """Look until that many rounds are over; returns what was restored."""
    now = [0.0]
    look = Inventory(stock, slice_=slice_, clock=lambda: now[0])
    restored: list[str] = []
    for _ in range(number):
        now[0] += inventory.ROUND_S
        for _ in range(20):
            restored += look.look()
    return restored


def test_a_record_that_alone_is_lost_is_restored(stock: Stock, client: redis.Redis) -> None:
    specs = [submitted(stock) for _ in range(5)]
    client.delete(keys.job(specs[2].id), keys.mesh(MESH_ID))
    assert rounds(stock, 1) == []  # it may be on its way
    assert sorted(rounds(stock)) == sorted([specs[2].id, MESH_ID])
    assert stock.jobs.get(specs[2].id).status is JobStatus.ACCEPTED
    assert stock.meshes.get(MESH_ID) == mesh_record()
    assert rounds(stock) == []


def test_what_is_left_of_a_deleted_job_goes_though_the_server_forgot_that_it_was(
    stock: Stock, client: redis.Redis, caplog: pytest.LogCaptureFixture
) -> None:
    spec = ended(stock, Outcome(JobStatus.SUCCESSFUL))
    stock.blobs.create(layout.tombstone(spec.id), b"")
    stock.jobs.delete(spec.id)  # and then the process died, with all files in place
    client.delete(keys.gone(spec.id), keys.UNSETTLED)
    assert rounds(stock) == []
    assert list(stock.blobs.folders(layout.jobs())) == []
    with pytest.raises(JobGoneError):
        stock.jobs.get(spec.id)
    assert [record for record in caplog.records if record.exc_info] == []


def test_a_deleted_job_that_an_older_copy_of_the_records_brings_back_is_deleted_again(
    stock: Stock, keep_copy: Callable[[], Callable[[], object]]
) -> None:
    deleted, kept = (ended(stock, Outcome(JobStatus.SUCCESSFUL)) for _ in range(2))
    put_back = keep_copy()
    delete_job(stock.jobs, stock.blobs, deleted.id)
    put_back()
    rounds(stock, 1)
    assert len(stock.jobs.find().items) == 2, "whoever deletes it may not have come so far"
    rounds(stock)
    assert stock.jobs.find().items == (stock.jobs.get(kept.id),)
    with pytest.raises(JobGoneError):
        stock.jobs.get(deleted.id)


def test_a_job_whose_deletion_the_server_forgot_is_gone_and_not_unknown(
    stock: Stock, client: redis.Redis
) -> None:
    spec = ended(stock, Outcome(JobStatus.SUCCESSFUL), request=RequestKey("key", "f"))
    spoilt = job_spec()
    delete_job(stock.jobs, stock.blobs, spec.id)
    stock.blobs.create(layout.tombstone(spoilt.id), b"{")
    client.delete(keys.gone(spec.id), keys.repeat("key"))
    rounds(stock, 1)
    for job_id in (spec.id, spoilt.id):
        with pytest.raises(JobGoneError):
            stock.jobs.get(job_id)
    assert stock.repeats.begin("key", "f", "another") == Beginning(spec.id)


def test_files_that_cannot_be_read_are_told_of_once_kept_and_not_in_the_way(
    stock: Stock, client: redis.Redis, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    spoilt = job_spec()
    specs = [submitted(stock) for _ in range(2)]
    stock.blobs.create(layout.spec(spoilt.id), b"{")
    os.utime(tmp_path / "blobs" / layout.spec(spoilt.id), (1.0, 1.0))
    client.delete(*(keys.job(spec.id) for spec in specs))
    assert sorted(rounds(stock, 4, slice_=200)) == sorted(spec.id for spec in specs)
    assert stock.blobs.stat(layout.spec(spoilt.id)) is not None
    assert [record.__dict__["job_id"] for record in caplog.records if record.exc_info] == [spoilt.id]


def test_a_job_whose_result_is_damaged_comes_back_and_goes_on(
    stock: Stock, lose: Callable[[], object], tmp_path: Path
) -> None:
    spec = ended(stock, Outcome(JobStatus.SUCCESSFUL, "converged", None, 3, 3))
    stock.blobs.create(layout.withdrawn(spec.id), b"")  # an answer was lost, and it was taken all the same
    path = tmp_path / "blobs" / layout.result(spec.id)
    path.write_bytes(path.read_bytes()[:-9])
    lose()
    rebuild(stock)
    assert stock.jobs.get(spec.id).status is JobStatus.ACCEPTED
    assert stock.queue.pending() == [spec.id]


def test_files_that_belong_to_nothing_are_removed_when_they_are_old(stock: Stock, tmp_path: Path) -> None:
    spec, young = job_spec(at=1.0), job_spec()
    for made in (spec, young):
        stock.blobs.create(layout.spec(made.id), dump_record(made).encode())
        stock.blobs.create(layout.withdrawn(made.id), b"")
    stock.blobs.create(layout.mesh_arrays("mesh_half"), b"")
    stock.blobs.create(layout.tombstone("job_of_long_ago"), b"")
    stock.blobs.create(layout.spec("job_of_long_ago"), b"its deletion was broken off")
    for key in (
        layout.spec(spec.id),
        layout.withdrawn(spec.id),
        layout.mesh_arrays("mesh_half"),
        layout.tombstone("job_of_long_ago"),
    ):
        os.utime(tmp_path / "blobs" / key, (1.0, 1.0))
    assert rounds(stock) == []
    assert {stat.key for stat in stock.blobs.list("jobs")} == {
        layout.spec(young.id),
        layout.withdrawn(young.id),
    }
    assert {stat.key for stat in stock.blobs.list("meshes")} == {layout.mesh_record(MESH_ID)}
    assert list(stock.blobs.list("tombstones")) == []
