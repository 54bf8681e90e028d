from __future__ import annotations

import csv
import gc
import hashlib
import io
import json
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, BinaryIO

import httpx
import pytest

from service import archive, conversion
from service.delivery import PIECE
from service.routes import snapshots
from service.schemas import metrics_out
from spherify.formats import write_mesh
from spherify.geometry.mesh import TriangleMesh
from spherify.settings import Settings
from spherify.stores.connect import Stores
from tests.service.conftest import Hand, problem
from tests.stack import wait_for

MIB = 2**20


@pytest.fixture
def path(submitted: Callable[..., Hand]) -> str:
    hand = submitted().claim().reach(0).reach(100).reach(1000).end()
    return f"/v1/jobs/{hand.job_id}/archive.zip"


@pytest.mark.parametrize("form", ["ply", "obj", "glb"])
def test_an_archive_holds_everything_and_says_what(client: httpx.Client, path: str, form: str) -> None:
    job = path.removesuffix("/archive.zip")
    assert client.get(job).json()["links"]["archive"] == path
    answer = client.get(path, params={"format": form})
    assert answer.headers["content-type"] == "application/zip"
    assert answer.headers["content-disposition"] == 'attachment; filename="bunny.zip"'
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        assert archive.testzip() is None
        files = {name: archive.read(name) for name in archive.namelist()}
    states = [f"bunny_it{iteration:05d}.{form}" for iteration in (0, 100, 1000)]
    assert list(files) == [*states, "metrics.csv", "manifest.json"]
    manifest = json.loads(files["manifest.json"])
    assert [state["name"] for state in manifest["snapshots"]] == states
    for entry in (*manifest["snapshots"], manifest["metrics"]):
        assert hashlib.sha256(files[entry["name"]]).hexdigest() == entry["sha256"]
        assert len(files[entry["name"]]) == entry["bytes"]
    for state in manifest["snapshots"]:
        assert files[state["name"]] == client.get(f"{job}/snapshots/{state['iteration']}.{form}").content
    assert files["metrics.csv"] == client.get(f"{job}/metrics.csv").content
    assert [row["iteration"] for row in csv.DictReader(io.StringIO(files["metrics.csv"].decode()))] == [
        "0",
        "100",
        "1000",
    ]
    whole = client.get(job).json()
    assert manifest["job"]["parameters"] == whole["parameters"]
    assert manifest["mesh"]["sha256"] == client.get(whole["links"]["mesh"]).json()["sha256"]


def test_the_same_bytes_every_time(client: httpx.Client, path: str, settings: Settings) -> None:
    first = client.get(path)
    kept = [file for file in (settings.data_dir / "cache").iterdir() if not file.name.endswith(".part")]
    for file in kept:
        file.unlink()
    again = client.get(path)
    assert again.content == first.content
    assert again.headers["etag"] == first.headers["etag"]
    known = client.get(path, headers={"If-None-Match": first.headers["etag"]})
    assert (known.status_code, known.content) == (304, b"")


def test_a_large_archive_is_the_same_sent_as_it_is_written(
    client: httpx.Client, path: str, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = client.get(path).content
    for file in (settings.data_dir / "cache").iterdir():
        file.unlink()
    monkeypatch.setattr(archive, "STREAMED_BYTES", 0)
    streamed = client.get(path)
    assert streamed.content == kept
    assert streamed.headers["transfer-encoding"] == "chunked"
    assert streamed.headers["content-disposition"] == 'attachment; filename="bunny.zip"'
    head = client.head(path)
    assert (head.status_code, head.headers.get("content-length")) == (200, None), "nobody knows it yet"
    assert head.headers["content-disposition"] == streamed.headers["content-disposition"]
    assert len(list((settings.data_dir / "cache").iterdir())) == 3, "its states are kept, not the whole"


def test_a_large_archive_takes_what_was_converted_already(
    client: httpx.Client, path: str, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = client.get(path).content
    monkeypatch.setattr(archive, "STREAMED_BYTES", 0)
    made: list[str] = []

    def counted(state: TriangleMesh, form: str, **options: Any) -> bytes:
        made.append(form)
        return write_mesh(state, form, **options)

    monkeypatch.setattr(conversion, "write_mesh", counted)
    client.get(path.replace("archive.zip", "snapshots/100.ply"))
    assert len(made) == 1
    for _ in range(2):
        assert client.get(path).content == whole
    assert made == ["ply"] * 3
    monkeypatch.setattr(snapshots, "_KEPT_SHARE", 1e9)  # as if all others had to make room for it
    client.get(path, params={"format": "obj"})
    assert client.get(path, params={"format": "obj"}).status_code == 200
    assert made == ["ply"] * 3 + ["obj"] * 6


def test_a_large_archive_that_cannot_be_ended_is_not_taken_for_a_whole_one(
    client: httpx.Client, path: str, stores: Stores, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(archive, "STREAMED_BYTES", 0)
    snapshots = stores.jobs.get(path.split("/")[3]).snapshots
    stores.blobs.delete(snapshots[-1].key)
    with pytest.raises(httpx.RemoteProtocolError):
        client.get(path)


def test_a_large_archive_that_cannot_be_begun_is_refused(
    client: httpx.Client, path: str, stores: Stores, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(archive, "STREAMED_BYTES", 0)
    stores.blobs.delete(stores.jobs.get(path.split("/")[3]).snapshots[0].key)
    problem(client.get(path), 500, "stored-file-damaged")


def test_an_entry_that_waits_for_a_slow_client_takes_no_memory(path: str, stores: Stores) -> None:
    job = stores.jobs.get(path.split("/")[3])
    mesh = stores.meshes.get(job.spec.mesh_id)
    metrics = metrics_out(job.id, stores.jobs.metrics(job.id))
    matter = archive.Matter(job, mesh, metrics, "ply", lambda _: bytes(8 * MIB))
    parts = archive.archive_parts(stores.blobs.scratch(), matter)
    tracemalloc.start()
    try:
        entry = next(parts)
        assert len(next(entry)) == PIECE
        assert tracemalloc.get_traced_memory()[0] < MIB
    finally:
        tracemalloc.stop()
    parts.close()


def test_a_client_that_leaves_a_large_archive_leaves_nothing_open(
    client: httpx.Client, path: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[BinaryIO] = []

    def temporary(dir: Path) -> BinaryIO:  # noqa: A002 (its name there)
        made.append(TemporaryFile(dir=dir))  # noqa: SIM115 (the archive closes it)
        return made[-1]

    monkeypatch.setattr(archive, "STREAMED_BYTES", 0)
    monkeypatch.setattr(conversion, "write_mesh", lambda *_, **__: bytes(64 * MIB))  # no pipe holds that
    monkeypatch.setattr(archive, "TemporaryFile", temporary)
    gc.disable()  # which would close it too, one day
    try:
        with client.stream("GET", path) as answer:
            next(answer.iter_raw())
            (file,) = made
            assert not file.closed
        wait_for(lambda: file.closed)
    finally:
        gc.enable()


def test_a_broken_download_goes_on(client: httpx.Client, path: str) -> None:
    whole = client.get(path)
    half = len(whole.content) // 2
    rest = client.get(path, headers={"Range": f"bytes={half}-", "If-Range": whole.headers["etag"]})
    assert rest.status_code == 206
    assert whole.content[:half] + rest.content == whole.content
    assert client.head(path).headers["content-length"] == str(len(whole.content))


def test_no_archive(client: httpx.Client, submitted: Callable[..., Hand], path: str) -> None:
    running = f"/v1/jobs/{submitted().claim().reach(0).job_id}"
    assert "archive" not in client.get(running).json()["links"]
    problem(client.get(f"{running}/archive.zip"), 409, "job-not-finished")
    problem(client.get(path, params={"format": "3mf"}), 422, "invalid-parameters")
    problem(client.get("/v1/jobs/job_01K5Z9Q8M4T6V2X0Y7R3N1W5BC/archive.zip"), 404, "not-found")


def test_the_archive_of_a_damaged_job_is_refused_whole(
    client: httpx.Client, path: str, settings: Settings
) -> None:
    folder = settings.data_dir / "blobs" / "jobs" / path.split("/")[3] / "snapshots"
    damaged = sorted(folder.iterdir())[1]
    damaged.write_bytes(b"damaged")
    problem(client.get(path), 500, "stored-file-damaged")
    assert list(Path(settings.data_dir / "cache").glob("*.part")) == []
