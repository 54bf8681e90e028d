"""Uploads that are not what they say: cut off, of another length, of another digest; a hundred, from a seed."""

from __future__ import annotations

import base64
import hashlib
import random

import httpx
import pytest

from spherify.stores.connect import Stores
from tests.service.conftest import OCTAHEDRON, data_files, problem, until
from tests.service.test_uploads import connect

WAYS = ("cut", "too-short", "digest")
FORM = (
    b'--b\r\nContent-Disposition: form-data; name="file"; filename="o.obj"\r\n\r\n'
    + OCTAHEDRON
    + b"\r\n--b--\r\n"
)
KINDS = {
    "/v1/meshes": ("PUT", "/v1/meshes?name=o.obj", b"application/octet-stream", OCTAHEDRON),
    "form": ("POST", "/v1/jobs", b"multipart/form-data; boundary=b", FORM),
}


def digest(content: bytes) -> bytes:
    return b"sha-256=:" + base64.b64encode(hashlib.sha256(content).digest()) + b":"


def test_a_hundred_uploads_that_are_not_what_they_say_leave_nothing(
    client: httpx.Client, stores: Stores
) -> None:
    rng = random.Random(13)
    for _ in range(100):
        method, path, kind, content = KINDS[rng.choice(sorted(KINDS))]
        way, cut = rng.choice(WAYS), rng.randrange(1, len(content))
        sent = content if way == "digest" else content[:cut]
        length = cut + rng.randrange(1, 100) if way == "too-short" else len(content)
        announced = digest(content[:-1]) if way == "digest" else digest(content)
        head = b"%s %s HTTP/1.1\r\nHost: x\r\nContent-Type: %s\r\nContent-Length: %d\r\nContent-Digest: %s\r\n\r\n"
        with connect(str(client.base_url)) as connection:
            connection.sendall(head % (method.encode(), path.encode(), kind, length, announced) + sent)
            if way == "digest":
                answer = connection.recv(65536)
                assert answer.startswith(b"HTTP/1.1 400 "), answer
    until(lambda: not any(stores.blobs.scratch().iterdir()))
    assert data_files(stores.blobs.root) == set()
    assert client.get("/v1/jobs").json()["items"] == []
    assert client.get("/v1/meshes").json()["items"] == []


def test_a_length_that_ends_too_soon_is_a_damaged_file(client: httpx.Client, stores: Stores) -> None:
    with connect(str(client.base_url)) as connection:
        head = b"PUT /v1/meshes?name=o.obj HTTP/1.1\r\nHost: x\r\nContent-Length: 60\r\nConnection: close\r\n\r\n"
        connection.sendall(head + OCTAHEDRON)
        answer = connection.recv(65536)
    assert answer.startswith(b"HTTP/1.1 422 ")
    assert data_files(stores.blobs.root) == set()


@pytest.mark.parametrize("more", [b"", b"sha-512=:xyz:, "])
def test_the_right_digest_is_taken(client: httpx.Client, more: bytes) -> None:
    headers = {"Content-Digest": (more + digest(OCTAHEDRON)).decode()}
    answer = client.put("/v1/meshes?name=o.obj", content=OCTAHEDRON, headers=headers)
    assert answer.status_code == 201, answer.text


@pytest.mark.parametrize("bad", ["sha-256=:AAAA:", "sha-256=:%%%:"])
def test_another_digest_is_refused(client: httpx.Client, stores: Stores, bad: str) -> None:
    answer = client.put("/v1/meshes?name=o.obj", content=OCTAHEDRON, headers={"Content-Digest": bad})
    problem(answer, 400, "digest-mismatch")
    assert data_files(stores.blobs.root) == set()
