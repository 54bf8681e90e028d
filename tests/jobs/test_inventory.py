"""Records of meshes that have no files, and files that are nobody's: over a real server and folder."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import redis

from spherify.jobs import layout
from spherify.jobs.codec import dump_record
from spherify.jobs.ids import new_job_id
from spherify.jobs.model import JobStatus, MeshRecord, Outcome
from spherify.jobs.ports import BlobStat
from spherify.jobs.rebuild import rebuild
from spherify.jobs.restore import restore_job
from spherify.jobs.stock import Stock
from spherify.stores import keys
from spherify.stores.redis_jobs import RedisJobStore
from spherify.stores.redis_meshes import RedisMeshStore
from tests.jobs.examples import MESH_ID, OTHER_MESH, mesh_record
from tests.jobs.test_rebuild import ended, rounds
from tests.jobs.world import submitted

EMPTY = "mesh_" + "2" * 26


def recorded(stock: Stock) -> set[str]:
    return {record.id for record in stock.meshes.find().items}


@pytest.mark.parametrize("slice_", [1, 2, 200])
def test_a_mesh_without_files_is_forgotten_unless_a_job_names_it(stock: Stock, slice_: int) -> None:
    """As of a rebuilder that slept over a deletion, or in an older copy of the records."""
    for mesh_id in (OTHER_MESH, EMPTY):
        stock.meshes.add(mesh_record(mesh_id))
    spec = submitted(stock, mesh_id=OTHER_MESH)
    rounds(stock, 1, slice_)
    assert recorded(stock) == {MESH_ID, OTHER_MESH, EMPTY}, "it may be being deleted"
    assert rounds(stock, 2, slice_) == []
    assert recorded(stock) == {MESH_ID, OTHER_MESH}
    assert stock.jobs.get(spec.id).spec.mesh_id == OTHER_MESH
    assert stock.meshes.add(mesh_record(EMPTY)), "it can be uploaded again"


def test_a_mesh_that_is_uploaded_as_its_record_is_found_empty_stays(
    stock: Stock, client: redis.Redis
) -> None:
    class Uploading(RedisMeshStore):
        uploads = 0

        def delete(self, mesh_id: str) -> None:
            self.uploads += 1
            stock.blobs.create(layout.mesh_record(mesh_id), dump_record(mesh_record(mesh_id)).encode())
            assert not self.add(mesh_record(mesh_id)), "whoever uploads it is told that it is known"
            super().delete(mesh_id)

    meshes = Uploading(client)
    meshes.add(mesh_record(EMPTY))
    assert rounds(replace(stock, meshes=meshes), 2) == []
    assert meshes.uploads == 1
    assert recorded(stock) == {MESH_ID, EMPTY}


# What is removed because it is old and nobody's


def aged(stock: Stock, tmp_path: Path, prefix: str) -> list[BlobStat]:
    """Let the files below a prefix be older than any that is removed, and return what is known of them."""
    for stat in list(stock.blobs.list(prefix)):
        os.utime(tmp_path / "blobs" / stat.key, (1.0, 1.0))
    return list(stock.blobs.list(prefix))


@pytest.mark.parametrize("meanwhile", ["restored", "lost"])
def test_an_old_job_that_is_known_again_when_it_is_to_be_restored_keeps_its_files(
    stock: Stock, client: redis.Redis, lose: Callable[[], object], tmp_path: Path, meanwhile: str
) -> None:
    """Who looks slept, and another who leads now restored it, or everything was lost and is being rebuilt."""

    class Late(RedisJobStore):
        def restore(self, *args: Any, **more: Any) -> bool:
            if meanwhile == "lost":
                lose()
                rebuild(replace(stock, blobs=type(stock.blobs)(tmp_path / "none")))
            else:
                assert restore_job(stock, spec.id)
            return super().restore(*args, **more)

    spec = ended(stock, Outcome(JobStatus.SUCCESSFUL))
    files = aged(stock, tmp_path, layout.job_folder(spec.id))
    client.delete(keys.job(spec.id))
    assert rounds(replace(stock, jobs=Late(client)), 2) == []
    assert list(stock.blobs.list(layout.job_folder(spec.id))) == files
    rounds(stock, 2)
    assert stock.jobs.get(spec.id).status is JobStatus.SUCCESSFUL


def test_an_old_mesh_that_is_uploaded_as_it_is_to_be_restored_keeps_its_files(
    stock: Stock, client: redis.Redis, tmp_path: Path
) -> None:
    class Late(RedisMeshStore):
        def add(self, record: MeshRecord) -> bool:
            assert stock.meshes.add(record), "the upload, which found all files, is told that it is new"
            return super().add(record)

    stock.blobs.create(layout.mesh_arrays(MESH_ID), b"")
    files = aged(stock, tmp_path, layout.mesh_folder(MESH_ID))
    client.delete(keys.mesh(MESH_ID))
    assert rounds(replace(stock, meshes=Late(client)), 2) == []
    assert list(stock.blobs.list(layout.mesh_folder(MESH_ID))) == files


def test_the_states_of_an_old_job_that_a_young_one_goes_on_from_stay(stock: Stock, tmp_path: Path) -> None:
    """They are links, as old as what they are copies of; who copies them may take longer than two rounds."""
    parent, child = layout.numbered(layout.snapshots("job_old"), 1, 0), new_job_id()[0]
    stock.blobs.create(parent, b"")
    aged(stock, tmp_path, layout.job_folder("job_old"))
    stock.blobs.copy(parent, layout.numbered(layout.snapshots(child), 0, 0))
    rounds(stock)
    assert {stat.key for stat in stock.blobs.list("jobs")} == {layout.numbered(layout.snapshots(child), 0, 0)}
