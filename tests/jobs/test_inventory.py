"""Records of meshes that have no files: over a real server and folder."""

from __future__ import annotations

from dataclasses import replace

import pytest
import redis

from spherify.jobs import layout
from spherify.jobs.codec import dump_record
from spherify.jobs.stock import Stock
from spherify.stores.redis_meshes import RedisMeshStore
from tests.jobs.examples import MESH_ID, OTHER_MESH, mesh_record
from tests.jobs.test_rebuild import rounds
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
