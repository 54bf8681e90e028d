"""Fixtures of the session: a real server, and a started stack."""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterator
from pathlib import Path

import hypothesis
import pytest
import redis

from spherify.geometry.kernels import default_engine
from spherify.stores import keys
from spherify.stores.client import connect
from spherify.stores.embedded import EmbeddedServer
from tests.s3 import BUCKET, S3Server
from tests.stack import Stack, started_stack

# Tests decide on their settings themselves; a developer's own environment must not reach them.
for _name in [name for name in os.environ if name.startswith(("SPHERIFY_", "AWS_")) or name == "REDIS_URL"]:
    del os.environ[_name]

# No test fails because the machine has something else to do.
hypothesis.settings.register_profile("untimed", deadline=None)
hypothesis.settings.load_profile("untimed")


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
def s3_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[S3Server]:
    """One real S3 server, which tests leave running; each works below a prefix of its own."""
    with S3Server(tmp_path_factory.mktemp("s3")) as server:
        yield server


@pytest.fixture
def s3_url(s3_server: S3Server, monkeypatch: pytest.MonkeyPatch) -> str:
    """An empty place in its bucket, with what is needed to reach it in the environment."""
    for name, value in s3_server.environment.items():
        monkeypatch.setenv(name, value)
    return f"s3://{BUCKET}/{uuid.uuid4().hex}"


@pytest.fixture(scope="session")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stack]:
    """One started stack of server, API and worker, for tests that leave it as they found it."""
    with started_stack(Path(tmp_path_factory.mktemp("stack"))) as stack:
        yield stack
