"""Fixtures of the session: a real server, and a started stack."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
import redis

from spherify.geometry.kernels import default_engine
from spherify.stores import keys
from spherify.stores.client import connect
from spherify.stores.embedded import EmbeddedServer
from tests.stack import Stack, started_stack

# Tests decide on their settings themselves; a developer's own environment must not reach them.
for _name in [name for name in os.environ if name.startswith("SPHERIFY_") or name == "REDIS_URL"]:
    del os.environ[_name]


@pytest.hookimpl(tryfirst=True)
def pytest_sessionstart(session: pytest.Session) -> None:
    """Make the machine code of the kernels once, before the processes that run the tests are started."""
    if not hasattr(session.config, "workerinput"):
        default_engine().warm()


@pytest.fixture(scope="session")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EmbeddedServer]:
    """One real server for all tests that clear it themselves; see `client`."""
    with EmbeddedServer(tmp_path_factory.mktemp("server")) as server:
        yield server


@pytest.fixture
def client(server: EmbeddedServer) -> Iterator[redis.Redis]:
    """An empty database on the real server."""
    client = connect(server.url)
    client.flushall()
    client.set(keys.EPOCH, "test")  # nothing is missing
    yield client
    client.close()


@pytest.fixture(scope="session")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stack]:
    """One started stack of server, API and worker, for tests that leave it as they found it."""
    with started_stack(Path(tmp_path_factory.mktemp("stack"))) as stack:
        yield stack
