"""Bodies that are too large, too slow, cut off, or no forms at all; curl and bare sockets against the real server."""

from __future__ import annotations

import shutil
import socket
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import pytest

from spherify.settings import Settings
from spherify.stores.connect import Stores
from tests.service.conftest import OCTAHEDRON, data_files, problem, serve, until

MB = 1_000_000


def connect(url: str) -> socket.socket:
    parts = urlsplit(url)
    return socket.create_connection((parts.hostname, parts.port), timeout=20)


def everything(connection: socket.socket) -> bytes:
    return b"".join(iter(lambda: connection.recv(65536), b""))


@pytest.fixture(scope="session")
def impatient_url(shared_settings: Settings, shared_stores: Stores) -> Iterator[str]:
    with serve(shared_settings.model_copy(update={"upload_timeout_s": 0.2}), shared_stores) as url:
        yield url


@pytest.fixture
def large(tmp_path: Path) -> Path:
    path = tmp_path / "large.obj"
    with path.open("wb") as file:
        file.truncate(40 * MB)
    return path


WAYS = {
    "form": ["-F", "file=@{}", "/v1/jobs"],
    "raw": ["-T", "{}", "/v1/meshes?name=large.obj"],
    "raw without asking": ["-H", "Expect:", "-T", "{}", "/v1/meshes?name=large.obj"],
    "form without asking": ["-H", "Expect:", "-F", "file=@{}", "/v1/meshes"],
    "of unknown length": ["-H", "Transfer-Encoding: chunked", "-T", "{}", "/v1/meshes?name=large.obj"],
}


@pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed")
@pytest.mark.parametrize("way", WAYS)
def test_curl_is_told_that_a_file_is_too_large(base_url: str, stores: Stores, large: Path, way: str) -> None:
    *options, path = WAYS[way]
    command = ["curl", "-sS", "-w", "\n%{http_code} %{size_upload}", *(o.format(large) for o in options)]
    done = subprocess.run(
        [*command, base_url + path], capture_output=True, text=True, timeout=30, check=False
    )
    assert done.returncode == 0, done.stderr
    document, _, figures = done.stdout.rpartition("\n")
    status, sent = map(int, figures.split())
    assert status == 413
    assert '"type": "/problems/upload-too-large"' in document
    if way in {"form", "raw"}:
        assert sent == 0, "curl asked with Expect: 100-continue and was told before it sent anything"
    assert data_files(stores.blobs.root) == set()


def test_an_announced_length_is_refused_before_anything_is_read(base_url: str, stores: Stores) -> None:
    with connect(base_url) as connection:
        connection.sendall(
            b"PUT /v1/meshes?name=a.obj HTTP/1.1\r\nHost: x\r\nContent-Length: 2000001\r\n\r\n"
        )
        answer = connection.recv(65536)
    assert answer.startswith(b"HTTP/1.1 413 ")
    assert b"connection: close" in answer.lower()


@pytest.mark.parametrize("hang_up", ["raw", "form"])
def test_a_client_that_hangs_up_leaves_nothing(base_url: str, stores: Stores, hang_up: str) -> None:
    head = {
        "raw": b"PUT /v1/meshes?name=a.obj HTTP/1.1\r\nHost: x\r\nContent-Length: 1900000\r\n\r\n",
        "form": b"POST /v1/jobs HTTP/1.1\r\nHost: x\r\nContent-Type: multipart/form-data; boundary=b\r\n"
        b"Content-Length: 1900000\r\n\r\n"
        b'--b\r\nContent-Disposition: form-data; name="file"; filename="a.obj"\r\n\r\n',
    }[hang_up]
    scratch = stores.blobs.scratch()
    connection = connect(base_url)
    connection.sendall(head + b"#" * (3 * MB // 2))
    until(lambda: any(scratch.iterdir()))
    connection.close()
    until(lambda: not any(scratch.iterdir()))
    assert data_files(stores.blobs.root) == set()


@pytest.mark.parametrize("start", [b"", b"v 1 0 0\n"])
def test_an_upload_that_stalls_is_dropped(impatient_url: str, stores: Stores, start: bytes) -> None:
    with connect(impatient_url) as connection:
        connection.sendall(
            b"PUT /v1/meshes?name=a.obj HTTP/1.1\r\nHost: x\r\nContent-Length: 100\r\n\r\n" + start
        )
        answer = everything(connection)
    assert answer.startswith(b"HTTP/1.1 408 ")
    assert b"/problems/request-timeout" in answer
    assert data_files(stores.blobs.root) == set()


def test_an_upload_that_trickles_is_dropped(impatient_url: str, stores: Stores) -> None:
    """Never silent for long, and yet below the least rate."""
    stop = threading.Event()
    with connect(impatient_url) as connection:
        connection.sendall(
            b"PUT /v1/meshes?name=a.obj HTTP/1.1\r\nHost: x\r\nContent-Length: 1000000\r\n\r\n"
        )

        def trickle() -> None:
            while not stop.wait(0.02):
                try:
                    connection.sendall(b"#")
                except OSError:
                    return

        thread = threading.Thread(target=trickle)
        thread.start()
        try:
            answer = connection.recv(65536)
        finally:
            stop.set()
            thread.join()
    assert answer.startswith(b"HTTP/1.1 408 ")


def test_no_upload_begins_when_the_disk_is_full(settings: Settings, stores: Stores) -> None:
    with serve(settings.model_copy(update={"min_free_bytes": 2**62}), stores) as url:
        problem(httpx.put(f"{url}/v1/meshes?name=a.obj", content=OCTAHEDRON), 507, "storage-full")
        problem(httpx.get(f"{url}/readyz"), 503, "not-ready")


def form(*parts: bytes, end: bytes = b"--b--\r\n") -> bytes:
    return b"".join(b"--b\r\n" + part + b"\r\n" for part in parts) + end


FILE = b'Content-Disposition: form-data; name="file"; filename="o.obj"\r\n\r\n' + OCTAHEDRON


@pytest.mark.parametrize(
    ("kind", "body"),
    [
        ("multipart/form-data", form(FILE)),
        ("multipart/form-data; boundary=" + "b" * 300, form(FILE)),
        ("multipart/form-data; boundary=b", b""),
        ("multipart/form-data; boundary=b", b"nothing of the kind"),
        ("multipart/form-data; boundary=b", form(FILE, end=b"")),
        ("multipart/form-data; boundary=b", form(FILE)[:-40]),
        ("multipart/form-data; boundary=b", form(b"Content-Type: text/plain\r\n\r\nx")),
        ("multipart/form-data; boundary=b", form(b"Content-Disposition: attachment\r\n\r\nx")),
        ("multipart/form-data; boundary=b", form(b"X: " + b"y" * 10_000 + b"\r\n\r\nx")),
        (
            "multipart/form-data; boundary=b",
            form(*[b'Content-Disposition: form-data; name="tags"\r\n\r\nx'] * 201),
        ),
    ],
)
@pytest.mark.parametrize("path", ["/v1/jobs", "/v1/meshes"])
def test_what_is_no_form_is_said_so(
    client: httpx.Client, stores: Stores, path: str, kind: str, body: bytes
) -> None:
    answer = client.post(path, content=body, headers={"Content-Type": kind})
    problem(answer, 400, "malformed-multipart")
    assert data_files(stores.blobs.root) == set()


@pytest.mark.parametrize(
    ("part", "pointer"),
    [
        (b'Content-Disposition: form-data; name="mesh"; filename="o.obj"\r\n\r\nx', "form/mesh"),
        (b'Content-Disposition: form-data; name="name"\r\n\r\n\xff\xfe', "form/name"),
        (b'Content-Disposition: form-data; name="name"\r\n\r\n' + b"x" * 70_000, "form/name"),
        (FILE, "form/file"),
        (b'Content-Disposition: form-data; name=""\r\n\r\nx', "form/"),
    ],
)
def test_odd_parts_are_named(client: httpx.Client, stores: Stores, part: bytes, pointer: str) -> None:
    headers = {"Content-Type": "multipart/form-data; boundary=b"}
    document = problem(
        client.post("/v1/jobs", content=form(FILE, part), headers=headers), 422, "invalid-parameters"
    )
    errors = document["errors"]
    assert isinstance(errors, list)
    assert errors[0]["pointer"] == pointer
    assert data_files(stores.blobs.root) == set()


@pytest.mark.parametrize("path", ["/v1/jobs", "/v1/meshes"])
@pytest.mark.parametrize("kind", [None, "text/plain", "application/x-www-form-urlencoded", "\xff"])
def test_other_kinds_of_bodies_are_refused(client: httpx.Client, path: str, kind: str | None) -> None:
    headers = {} if kind is None else {"Content-Type": kind.encode("latin-1")}
    problem(client.post(path, content=b"x", headers=headers), 415, "unsupported-media-type")


@pytest.mark.parametrize("coding", ["gzip", "identity, BR", "x-gzip"])
def test_a_compressed_body_is_refused_as_such(client: httpx.Client, known: str, coding: str) -> None:
    """And not as a mesh or JSON that cannot be read."""
    headers = {"Content-Encoding": coding}
    for answer in (
        client.put("/v1/meshes?name=o.obj", content=b"\x1f\x8b", headers=headers),
        client.post("/v1/jobs", files={"file": ("o.obj", OCTAHEDRON)}, headers=headers),
        client.post("/v1/jobs", content=b"\x1f", headers=headers | {"Content-Type": "application/json"}),
    ):
        assert coding.lower() in str(problem(answer, 415, "unsupported-media-type")["detail"])
        assert answer.headers["accept-encoding"] == "identity"
    plain = client.post("/v1/jobs", json={"mesh_id": known}, headers={"Content-Encoding": "identity"})
    assert plain.status_code == 201
