"""What does not answer for a moment, files or server, is not gone: over a real server and folder."""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pytest
import redis

from spherify.jobs import layout
from spherify.jobs.accounts import write_account
from spherify.jobs.errors import StoreUnavailableError
from spherify.jobs.ids import new_job_id
from spherify.jobs.model import Job, JobSpec
from spherify.jobs.ports import Claim, ClaimOutcome
from spherify.jobs.rebuild import rebuild
from spherify.jobs.stock import Stock
from spherify.jobs.submit import submit
from spherify.stores import keys
from spherify.stores.arrays import dump_arrays
from spherify.stores.blobs import FolderBlobStore
from tests.jobs.examples import MESH_ID, job_spec
from tests.jobs.test_rebuild import rounds
from tests.jobs.world import submitted


@pytest.mark.parametrize("step", ["list", "open"])
def test_a_cancelled_job_keeps_snapshots_that_could_not_be_read_when_its_record_was_made_anew(
    stock: Stock, lose: Callable[[], object], monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    spec = submitted(stock)
    kept = [layout.numbered(layout.snapshots(spec.id), 1, iteration) for iteration in (0, 2)]
    for key in kept:
        stock.blobs.create(key, dump_arrays({"vertices": np.zeros((3, 3))}))
    stock.blobs.create(layout.cancel(spec.id), b"")
    lose()
    scandir, read = os.scandir, FolderBlobStore.open

    def scan(path: Any) -> Any:
        if step == "list" and Path(path).name == "snapshots":
            raise OSError(errno.EMFILE, "too many open files")
        return scandir(path)

    def open_(store: FolderBlobStore, key: str) -> BinaryIO:
        if step == "open" and key == kept[0]:
            raise OSError(errno.EMFILE, "too many open files")
        return read(store, key)

    with monkeypatch.context() as patch:
        patch.setattr(os, "scandir", scan)
        patch.setattr(FolderBlobStore, "open", open_)
        assert rebuild(stock)
    assert rounds(stock) == [spec.id]
    assert [snapshot.key for snapshot in stock.jobs.get(spec.id).snapshots] == kept
    assert {stat.key for stat in stock.blobs.list(layout.snapshots(spec.id))} == set(kept)


def test_a_folder_that_cannot_be_read_is_not_in_the_way_of_others(
    stock: Stock, client: redis.Redis, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It holds what belongs to nothing, or is what is left of a deleted job, or of one deleted long ago."""
    nothing, deleted, forgotten, other = sorted(new_job_id()[0] for _ in range(4))
    for job_id in (nothing, deleted, forgotten, other):
        stock.blobs.create(layout.numbered(layout.snapshots(job_id), 1, 0), b"")
    for job_id in (deleted, forgotten, other):
        stock.blobs.create(layout.tombstone(job_id), b"")
    now = time.time()
    monkeypatch.setattr(time, "time", lambda: now + layout.TOMBSTONE_S / 2)
    os.utime(stock.blobs.scratch().parent / layout.tombstone(forgotten), (1.0, 1.0))
    spec = submitted(stock)
    client.delete(keys.job(spec.id))
    scandir = os.scandir

    def scan(path: Any) -> Any:
        if Path(path).name == "snapshots" and Path(path).parent.name in {nothing, deleted, forgotten}:
            raise OSError(errno.EIO, "input/output error")
        return scandir(path)

    with monkeypatch.context() as patch:
        patch.setattr(os, "scandir", scan)
        assert rounds(stock, 3, 200) == [spec.id]
    assert not list(stock.blobs.list(layout.job_folder(other)))
    assert [stat.key for stat in stock.blobs.list(layout.tombstones())] == [
        layout.tombstone(job_id) for job_id in (deleted, forgotten, other)
    ]


def test_nothing_is_taken_for_gone_while_the_disk_is_not_mounted(
    stock: Stock, lose: Callable[[], object], tmp_path: Path
) -> None:
    blobs = tmp_path / "blobs"
    blobs.rename(tmp_path / "disk")
    blobs.mkdir()
    for _ in range(2):
        with pytest.raises(StoreUnavailableError):
            rounds(stock)
    for look in (stock.blobs.open, stock.blobs.delete):
        with pytest.raises(StoreUnavailableError):
            look(layout.mesh_record(MESH_ID))
    assert stock.meshes.get(MESH_ID)
    with pytest.raises(
        StoreUnavailableError
    ):  # so that whoever claimed a job hands it on, and counts no loss
        write_account(stock.blobs, "job", Claim(ClaimOutcome.CLAIMED, 1))
    lose()
    with pytest.raises(StoreUnavailableError):
        rebuild(stock)
    assert not stock.jobs.complete()
    blobs.rmdir()
    (tmp_path / "disk").rename(blobs)
    assert rebuild(stock)
    assert stock.meshes.get(MESH_ID)


def test_a_job_that_was_taken_though_its_client_was_refused_comes_back_once_an_attempt_has_begun(
    stock: Stock, lose: Callable[[], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The client is told to look before it sends the job again, and may have found it."""

    def unheard(spec: JobSpec) -> Job:
        add(spec)
        raise StoreUnavailableError("the answer was lost on the way")

    spec, add = job_spec(), stock.jobs.add
    with monkeypatch.context() as patch:
        patch.setattr(stock.jobs, "add", unheard)
        with pytest.raises(StoreUnavailableError):
            submit(stock.jobs, stock.blobs, stock.queue, spec)
    write_account(stock.blobs, spec.id, stock.jobs.claim(spec.id, "w"))
    lose()
    rebuild(stock)
    assert stock.jobs.get(spec.id).attempt == 1
