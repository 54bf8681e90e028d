"""A worker on a folder of its own for each file of tests, and what its long job yields when nothing happens to it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
import redis

from spherify.settings import Settings
from spherify.stores.connect import Stores, open_stores
from spherify.stores.embedded import EmbeddedServer
from tests.jobs.examples import job_spec, stone, store_mesh
from tests.processes import working_in
from tests.stack import Stack, started_stack
from tests.worker.observation import (
    LONG,
    finished,
    hashes,
    submitted,
)
from tests.worker.supervised import Watched


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stack]:
    folder = tmp_path_factory.mktemp("worker")
    with started_stack(folder, workers=1, api=False) as stack:
        store_mesh(stack.stores.meshes, stack.stores.blobs, stone())
        assert working_in(folder)
        yield stack
    assert working_in(folder) == []  # nothing is left behind


@pytest.fixture(scope="module")
def undisturbed(stack: Stack) -> dict[int, str]:
    """The sha256 of each snapshot of the long job, of a run that nothing happened to."""
    return hashes(finished(stack, submitted(stack, job_spec(**LONG))))


@pytest.fixture
def runners() -> Iterator[Watched]:
    runners = Watched()
    yield runners
    runners.close()


@pytest.fixture
def settings(server: EmbeddedServer, client: redis.Redis, tmp_path: Path) -> Settings:
    return Settings(redis_url=server.url, data_dir=tmp_path, cancel_grace_s=0.5)


@pytest.fixture
def stores(settings: Settings) -> Iterator[Stores]:
    stores = open_stores(settings)
    store_mesh(stores.meshes, stores.blobs, stone())
    yield stores
    stores.close()
