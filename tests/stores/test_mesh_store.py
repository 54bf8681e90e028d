from __future__ import annotations

from typing import cast

import pytest
import redis

from spherify.jobs.errors import InvalidCursorError, MeshInUseError, MeshNotFoundError
from spherify.jobs.ports import JobStore, MeshStore
from spherify.stores import keys, redis_meshes
from spherify.stores.memory import MemoryJobStore
from spherify.stores.memory_meshes import MemoryMeshStore
from spherify.stores.redis_jobs import RedisJobStore
from spherify.stores.redis_meshes import RedisMeshStore
from tests.jobs.examples import job_spec, mesh_record

Stores = tuple[MeshStore, JobStore]


@pytest.fixture(params=["memory", "redis"])
def stores(request: pytest.FixtureRequest) -> Stores:
    if request.param == "memory":
        jobs = MemoryJobStore()
        return MemoryMeshStore(jobs), jobs
    client: redis.Redis = request.getfixturevalue("client")
    return RedisMeshStore(client), RedisJobStore(client)


def mesh_id(number: int) -> str:
    return f"mesh_{number:026d}"


def test_a_mesh_is_known_once(stores: Stores) -> None:
    meshes, _ = stores
    record = mesh_record()
    assert meshes.add(record) is True
    assert meshes.add(record) is False
    assert meshes.add(mesh_record(created_at=2.0)) is False
    assert meshes.get(record.id) == record
    assert meshes.find().items == (record,)


def test_an_unknown_mesh(stores: Stores) -> None:
    meshes, _ = stores
    with pytest.raises(MeshNotFoundError):
        meshes.get(mesh_id(1))
    with pytest.raises(MeshNotFoundError):
        meshes.delete(mesh_id(1))


def test_pages_are_newest_first_and_complete_even_at_one_moment(stores: Stores) -> None:
    meshes, _ = stores
    for number in range(7):
        meshes.add(mesh_record(mesh_id(number), created_at=float(number // 3)))
    seen: list[str] = []
    cursor = None
    for _ in range(4):
        page = meshes.find(limit=2, cursor=cursor)
        seen += [record.id for record in page.items]
        cursor = page.next_cursor
    assert cursor is None
    assert seen == [mesh_id(number) for number in (6, 5, 4, 3, 2, 1, 0)]
    assert meshes.find(limit=7).next_cursor is None


def test_meshes_that_come_and_go_while_a_page_is_read_hide_no_other(
    client: redis.Redis, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(redis_meshes, "_CHUNK", 3)
    meshes = RedisMeshStore(client)
    for number in range(12):
        meshes.add(mesh_record(mesh_id(number), created_at=float(number)))
    below = meshes._below

    def busy(before: tuple[float, str]) -> tuple[list[tuple[float, str]], bool]:
        found = below(before)
        if not found[0]:
            return found
        newest = found[0][-1][1]
        client.zrem(keys.MESHES, newest)  # the last one read goes, and others come
        meshes.add(mesh_record(f"mesh_new{newest[-18:]}", created_at=before[0] if before[0] < 99 else 98.0))
        return found

    monkeypatch.setattr(meshes, "_below", busy)
    assert [mesh.id for mesh in meshes.find().items] == [mesh_id(number) for number in range(11, -1, -1)]


def test_a_mesh_goes_when_no_job_names_it(stores: Stores) -> None:
    meshes, jobs = stores
    record = mesh_record()
    meshes.add(record)
    job = jobs.add(job_spec(mesh_id=record.id))
    with pytest.raises(MeshInUseError):
        meshes.delete(record.id)
    jobs.request_cancel(job.id)
    with pytest.raises(MeshInUseError):
        meshes.delete(record.id)
    jobs.delete(job.id)
    meshes.delete(record.id)
    assert meshes.find().items == ()


def test_a_mesh_whose_record_was_lost_is_in_use_all_the_same(stores: Stores) -> None:
    """Whoever deletes it would take the files of those who name it."""
    meshes, jobs = stores
    meshes.add(mesh_record())
    job = jobs.add(job_spec(mesh_id=mesh_record().id))
    if isinstance(meshes, RedisMeshStore):
        meshes._client.delete(keys.mesh(mesh_record().id))
    else:
        cast("MemoryMeshStore", meshes)._records.clear()
    with pytest.raises(MeshInUseError):
        meshes.delete(mesh_record().id)
    jobs.request_cancel(job.id)
    jobs.delete(job.id)
    with pytest.raises(MeshNotFoundError):
        meshes.delete(mesh_record().id)


@pytest.mark.parametrize("cursor", ["", "x", "1.0", "1.0~", "nan~mesh_1", "~mesh_1"])
def test_a_cursor_must_be_one_of_ours(stores: Stores, cursor: str) -> None:
    with pytest.raises(InvalidCursorError):
        stores[0].find(cursor=cursor)
