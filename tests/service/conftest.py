"""The service as it runs: uvicorn over a real Redis-protocol server and a folder; a worker's part is played by hand."""

from __future__ import annotations

import hashlib
import json
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import httpx
import numpy as np
import pytest
import uvicorn

from service.app import create_app
from service.server import configuration
from spherify.jobs import layout
from spherify.jobs.model import Job, JobStatus, MeshRecord, Outcome, Progress, Snapshot
from spherify.jobs.rebuild import rebuild
from spherify.settings import Settings
from spherify.stores import keys
from spherify.stores.arrays import dump_arrays, load_arrays
from spherify.stores.connect import Stores, open_stores
from spherify.stores.embedded import EmbeddedServer

OCTAHEDRON = b"""v 1 0 0
v -1 0 0
v 0 1 0
v 0 -1 0
v 0 0 1
v 0 0 -1
f 1 3 5
f 3 2 5
f 2 4 5
f 4 1 5
f 3 1 6
f 2 3 6
f 4 2 6
f 1 4 6
"""
OPEN = OCTAHEDRON.replace(b"f 1 4 6\n", b"")


def stretched(factor: float) -> bytes:
    """The octahedron as another file."""
    return OCTAHEDRON.replace(b"v 1 0 0", f"v {factor} 0 0".encode())


@contextmanager
def serve(
    settings: Settings, stores: object, *, loopback: str | None = None, **options: object
) -> Iterator[str]:
    """Run the service in a thread and yield its URL; options are those of `service.server.configuration`.

    It goes by any name, as one that listens for other machines too; with `loopback`, as one for this machine alone.
    """
    app = create_app(settings, stores, loopback=loopback)  # type: ignore[arg-type]
    config = configuration(
        app, port=0, log_config=None, lifespan="off", timeout_graceful_shutdown=2, **options
    )
    server = uvicorn.Server(config)
    started = threading.Event()
    startup = server.startup

    async def tell(sockets: object = None) -> None:
        await startup(sockets)  # type: ignore[arg-type]
        started.set()

    server.startup = tell  # type: ignore[method-assign]
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        assert started.wait(20)
        port = server.servers[0].sockets[0].getsockname()[1]
        yield f"http://127.0.0.1:{port}"
    finally:
        server.should_exit = True
        thread.join(20)
        assert not thread.is_alive()


@pytest.fixture(scope="session")
def server_url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with EmbeddedServer(tmp_path_factory.mktemp("redis")) as server:
        yield server.url


@pytest.fixture(scope="session")
def shared_settings(server_url: str, tmp_path_factory: pytest.TempPathFactory) -> Settings:
    return Settings(
        redis_url=server_url, data_dir=tmp_path_factory.mktemp("data"), max_upload_bytes=2_000_000
    )


@pytest.fixture(scope="session")
def shared_stores(shared_settings: Settings) -> Iterator[Stores]:
    stores = open_stores(shared_settings)
    rebuild(stores.stock)
    yield stores
    stores.close()


@pytest.fixture(scope="session")
def base_url(shared_settings: Settings, shared_stores: Stores) -> Iterator[str]:
    with serve(shared_settings, shared_stores) as url:
        yield url


@pytest.fixture
def settings(shared_settings: Settings) -> Settings:
    return shared_settings


@pytest.fixture
def stores(shared_settings: Settings, shared_stores: Stores) -> Iterator[Stores]:
    """The stores, emptied afterwards."""
    yield shared_stores
    leftovers = list(shared_stores.blobs.scratch().iterdir())
    shared_stores.client.flushdb()
    shared_stores.client.set(keys.EPOCH, "test")  # nothing is missing
    for folder in ("blobs/meshes", "blobs/jobs", "blobs/tombstones", "cache"):
        shutil.rmtree(shared_settings.data_dir / folder, ignore_errors=True)
    assert leftovers == [], "every scratch file is removed"


@pytest.fixture(scope="session")
def shared_client(base_url: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=base_url, timeout=30) as client:
        yield client


@pytest.fixture
def client(shared_client: httpx.Client, stores: Stores) -> httpx.Client:
    return shared_client


@dataclass
class Hand:
    """Plays the worker of one job through the ports, one move at a time."""

    stores: Stores
    job_id: str
    token: int = 0
    snapshots: list[Snapshot] = field(default_factory=list)

    def job(self) -> Job:
        return self.stores.jobs.get(self.job_id)

    def claim(self) -> Hand:
        self.token = self.stores.jobs.claim(self.job_id, "hand").token
        return self

    def reach(self, iteration: int, *, keep: bool = True) -> Hand:
        job = self.job()
        metrics = {"sphericity": 0.9 + iteration / 1e6, "area": 1.0, "inward_faces": 0}
        progress = Progress(iteration, job.spec.parameters["iterations"], 50.0, 12.5, iteration / 50)
        if keep:
            mesh = load_arrays(self.stores.blobs.read(layout.mesh_arrays(job.spec.mesh_id)))
            data = dump_arrays({"vertices": np.asarray(mesh["vertices"]) * (1 + iteration)})
            key = layout.numbered(layout.snapshots(self.job_id), self.token, iteration)
            stat = self.stores.blobs.create(key, data)
            sha256 = hashlib.sha256(data).hexdigest()
            snapshot = Snapshot(iteration, key, sha256, stat.size, metrics, stat.created_at)
            assert self.stores.jobs.add_snapshot(self.job_id, self.token, snapshot)
        assert self.stores.jobs.report(
            self.job_id, self.token, progress, [{"iteration": iteration, **metrics}]
        )
        return self

    def end(self, status: JobStatus = JobStatus.SUCCESSFUL, **changes: object) -> Hand:
        last = max((s.iteration for s in self.job().snapshots), default=None)
        outcome = Outcome(status, "iterations", None, last, last)
        assert self.stores.jobs.commit(self.job_id, self.token, replace(outcome, **changes))  # type: ignore[arg-type]
        return self


@pytest.fixture(scope="session")
def octahedron(base_url: str, shared_stores: Stores) -> tuple[MeshRecord, dict[str, bytes]]:
    """The octahedron as the service keeps it: read once, since a reading starts a process."""
    answer = httpx.put(f"{base_url}/v1/meshes?name=octahedron.obj", content=OCTAHEDRON, timeout=30)
    record = shared_stores.meshes.get(answer.json()["id"])
    blobs = shared_stores.blobs
    return record, {blob.key: blobs.read(blob.key) for blob in blobs.list(layout.mesh_folder(record.id))}


@pytest.fixture
def known(octahedron: tuple[MeshRecord, dict[str, bytes]], stores: Stores) -> str:
    """The id of the octahedron, kept already."""
    record, files = octahedron
    for key, data in files.items():
        if stores.blobs.stat(key) is None:
            stores.blobs.create(key, data)
    stores.meshes.add(record)
    return record.id


@pytest.fixture
def submitted(client: httpx.Client, stores: Stores, known: str) -> Callable[..., Hand]:
    """Submit a job on the octahedron by HTTP; the answer's worker is ours to play."""

    def submit(**fields: str) -> Hand:
        fields = {"iterations": "1000", "snapshots": "100,500", "name": "bunny", "mesh_id": known} | fields
        answer = client.post("/v1/jobs", files={name: (None, value) for name, value in fields.items()})
        assert answer.status_code == 201, answer.text
        return Hand(stores, answer.json()["id"])

    return submit


def problem(answer: httpx.Response, status: int, slug: str) -> dict[str, object]:
    """Check that an answer is a whole problem document of one type, and return it."""
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    document: dict[str, object] = json.loads(answer.text)
    assert document["type"] == f"/problems/{slug}"
    assert document["status"] == status
    assert document["request_id"] == answer.headers["x-request-id"]
    assert document["title"]
    assert document["detail"]
    assert document["instance"]
    return document


def until(holds: Callable[[], bool], limit_s: float = 20) -> None:
    """Wait for a condition."""
    pause, deadline = threading.Event(), time.monotonic() + limit_s
    while not holds():
        assert time.monotonic() < deadline, "the condition never came to hold"
        pause.wait(0.01)


def data_files(root: Path) -> set[str]:
    return {str(path.relative_to(root)) for path in root.rglob("*") if path.is_file()}
