"""One world a test, of twins in memory or of what is real."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import redis

from spherify.jobs import layout
from spherify.jobs.codec import dump_record
from spherify.jobs.stock import Stock
from spherify.settings import Settings
from spherify.stores import keys
from spherify.stores.connect import open_stores
from spherify.stores.embedded import EmbeddedServer
from spherify.stores.memory import MemoryJobStore
from spherify.stores.memory_blobs import MemoryBlobStore
from spherify.stores.memory_meshes import MemoryJobQueue, MemoryMeshStore
from spherify.stores.memory_repeats import MemoryRepeatStore
from tests.jobs.examples import MESH_ID, mesh_record
from tests.jobs.world import World


@pytest.fixture
def world(tmp_path: Path) -> World:
    now = [1000.0]
    jobs = MemoryJobStore(lease_s=30, max_losses=1, clock=lambda: now[0])
    meshes = MemoryMeshStore(jobs)
    meshes.add(mesh_record())
    repeats = MemoryRepeatStore(lambda: now[0])
    return World(jobs, meshes, MemoryBlobStore(tmp_path), MemoryJobQueue(), repeats, now)


@pytest.fixture
def stock(server: EmbeddedServer, client: redis.Redis, tmp_path: Path) -> Stock:
    """Return what a started service has, over a real server and a folder, with one mesh."""
    stores = open_stores(Settings(redis_url=server.url, data_dir=tmp_path))
    stores.blobs.create(layout.mesh_record(MESH_ID), dump_record(mesh_record()).encode())
    stores.meshes.add(mesh_record())
    return stores.stock


@pytest.fixture
def lose(client: redis.Redis) -> Callable[[], object]:
    """Return what makes the server forget everything."""
    return client.flushall


@pytest.fixture
def keep_copy(client: redis.Redis) -> Callable[[], Callable[[], object]]:
    """Return what copies all records, and returns what puts that copy back in their place."""

    def keep() -> Callable[[], object]:
        for key in map(str, client.keys(keys.PREFIX + "*")):
            client.copy(key, f"older:{key}")
        return put_back

    def put_back() -> None:
        client.delete(*client.keys(keys.PREFIX + "*"))
        for key in map(str, client.keys("older:*")):
            client.rename(key, key.removeprefix("older:"))

    return keep
