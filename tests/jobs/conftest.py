"""One world a test."""

from __future__ import annotations

from pathlib import Path

import pytest

from spherify.stores.memory import MemoryJobStore
from spherify.stores.memory_blobs import MemoryBlobStore
from spherify.stores.memory_meshes import MemoryJobQueue, MemoryMeshStore
from spherify.stores.memory_repeats import MemoryRepeatStore
from tests.jobs.examples import mesh_record
from tests.jobs.world import World


@pytest.fixture
def world(tmp_path: Path) -> World:
    now = [1000.0]
    jobs = MemoryJobStore(lease_s=30, max_losses=1, clock=lambda: now[0])
    meshes = MemoryMeshStore(jobs)
    meshes.add(mesh_record())
    repeats = MemoryRepeatStore(lambda: now[0])
    return World(jobs, meshes, MemoryBlobStore(tmp_path), MemoryJobQueue(), repeats, now)
