"""Job stores: the twin in memory and the real server, over two recorded meshes."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import redis

from spherify.jobs.ports import JobStore
from spherify.stores.memory import MemoryJobStore
from spherify.stores.redis_jobs import RedisJobStore
from spherify.stores.redis_meshes import RedisMeshStore
from tests.jobs.examples import MESH_ID, OTHER_MESH, mesh_record

MakeStore = Callable[..., JobStore]


@pytest.fixture(params=["memory", "redis"])
def make(request: pytest.FixtureRequest) -> MakeStore:
    """Return a maker of stores over the same records, with a lease and a cap of one's own."""
    if request.param == "redis":
        client: redis.Redis = request.getfixturevalue("client")
        for mesh_id in (MESH_ID, OTHER_MESH):
            RedisMeshStore(client).add(mesh_record(mesh_id))
        return lambda **options: RedisJobStore(client, **options)
    first = MemoryJobStore()
    first.meshes.update({mesh_id: mesh_record(mesh_id) for mesh_id in (MESH_ID, OTHER_MESH)})

    def twin(lease_s: float = 30.0, max_losses: int = 3) -> JobStore:
        store = MemoryJobStore(lease_s=lease_s, max_losses=max_losses)
        store._entries, store._gone, store._unsettled = first._entries, first._gone, first._unsettled
        store.meshes = first.meshes
        return store

    return twin


@pytest.fixture
def jobs(make: MakeStore) -> JobStore:
    return make()


@pytest.fixture
def forgetful(make: MakeStore) -> JobStore:
    """A store over the same records whose leases have run out when they are given."""
    return make(lease_s=-1.0, max_losses=1)
