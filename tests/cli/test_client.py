"""The client of the REST interface against the real service."""

from __future__ import annotations

import os
import socket
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

import pytest

from spherify.client import Client, RefusedError, UnreachableError
from spherify.formats import read_mesh, write_mesh
from spherify.geometry.samples import SAMPLES
from tests.stack import Stack


@pytest.fixture(scope="module")
def mesh(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("client") / "stone.ply"
    path.write_bytes(write_mesh(SAMPLES["stone"].build(150), "ply"))
    return path


def test_a_job_is_followed_to_its_end(stack: Stack, mesh: Path, tmp_path: Path) -> None:
    with Client(stack.url + "/") as client:
        job = client.submit(mesh, {"iterations": "5", "snapshots": "2", "tags": ["a", "b"]})
        seen = list(client.follow(job["id"]))
        assert [state["done"] for state in seen] == [False] * (len(seen) - 1) + [True]
        assert [state["rev"] for state in seen] == sorted({state["rev"] for state in seen})
        assert seen[-1]["status"] == "successful"
        assert seen[-1]["tags"] == ["a", "b"]
        assert {0, 2, 5} <= {item["iteration"] for item in client.snapshots(job["id"])}
        client.download(job["id"], "final", "obj", tmp_path / "final.obj")
    final = read_mesh(tmp_path / "final.obj", "final.obj").mesh
    assert (final.faces == read_mesh(mesh, mesh.name).mesh.faces).all()


def test_who_sends_the_same_at_once_is_given_the_same_job(stack: Stack, mesh: Path) -> None:
    key = str(uuid4())

    def sent(_: int) -> str:
        with Client(stack.url) as client:  # which has not met the service yet
            return str(client.submit(mesh, {"iterations": "1"}, key=key)["id"])

    with ThreadPoolExecutor(8) as pool:
        assert len(set(pool.map(sent, range(8)))) == 1


def test_a_key_that_was_used_for_another_content_makes_a_new_job(stack: Stack, mesh: Path) -> None:
    key = str(uuid4())
    with Client(stack.url) as client:
        jobs = [client.submit(mesh, {"iterations": str(n)}, key=key)["id"] for n in (1, 2, 1)]
    assert jobs[0] == jobs[2] != jobs[1]


def test_a_refusal_carries_the_problem(stack: Stack, mesh: Path, tmp_path: Path) -> None:
    with Client(stack.url) as client:
        with pytest.raises(RefusedError, match="stride") as unknown:
            client.submit(mesh, {"stride": "1"})
        assert (unknown.value.status, unknown.value.slug) == (422, "invalid-parameters")
        assert unknown.value.errors[0]["pointer"] == "form/stride"
        job = client.submit(mesh, {"iterations": "1"})
        list(client.follow(job["id"]))
        with pytest.raises(RefusedError) as finished:
            client.cancel(job["id"])
        assert (finished.value.status, finished.value.slug) == (409, "job-already-finished")
        with pytest.raises(RefusedError) as missing:
            client.download(job["id"], 77, "ply", tmp_path / "no.ply")
        assert missing.value.status == 404
    assert os.listdir(tmp_path) == []


def test_nobody_at_the_address(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("spherify.client.PATIENCE_S", 0.0)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{probe.getsockname()[1]}"
        with Client(url) as client, pytest.raises(UnreachableError, match=url):
            client.job("job_01K5Z9Q8M4T6V2X0Y7R3N1W5BC")


def take_request(connection: socket.socket) -> bytes:
    """Read one request whole, and return its key: who hangs up on unread bytes resets the connection."""
    with connection.makefile("rb") as lines:
        length, key = 0, b""
        while (line := lines.readline().lower()) not in {b"\r\n", b""}:
            if line.startswith(b"content-length:"):
                length = int(line.split(b":")[1])
            elif line.startswith(b"idempotency-key:"):
                key = line.split(b":")[1].strip()
        lines.read(length)
    return key


@contextmanager
def answering(*answers: bytes, keys: list[bytes] | None = None) -> Iterator[str]:
    """Answer one request after the other with these bytes, hang up after each, and gather their keys."""
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def answer() -> None:
            for data in answers:
                connection, _ = listener.accept()
                with connection:
                    if (key := take_request(connection)) and keys is not None:
                        keys.append(key)
                    connection.sendall(data)

        thread = threading.Thread(target=answer, daemon=True)  # what fails must not wait for it
        thread.start()
        yield f"http://127.0.0.1:{listener.getsockname()[1]}"
        thread.join(10)
        assert not thread.is_alive(), "fewer requests than answers"


WHOLE = b"HTTP/1.1 200 OK\r\nContent-Length: 6\r\n\r\nply\nok"
CUT = b"HTTP/1.1 200 OK\r\nContent-Length: 1000000\r\n\r\n" + b"ply\n" * 1000
JOB = b'HTTP/1.1 200 OK\r\nContent-Length: 14\r\n\r\n{"id":"job_1"}'
IN_PROGRESS = (
    b'HTTP/1.1 409 Conflict\r\nContent-Length: 45\r\n\r\n{"type": "/problems/idempotency-in-progress"}'
)
NOT_READY = b"HTTP/1.1 503 Service Unavailable\r\nContent-Length: 2\r\n\r\n{}"


def test_a_download_that_breaks_off_leaves_what_was_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("spherify.client.PATIENCE_S", 0.0)
    target = tmp_path / "state.ply"
    target.write_text("an earlier one")
    with answering(CUT) as url, Client(url) as client, pytest.raises(UnreachableError, match="broke"):
        client.download("job_1", 5, "ply", target)
    assert os.listdir(tmp_path) == ["state.ply"]
    assert target.read_text() == "an earlier one"


def test_reading_is_tried_again_after_a_broken_connection_and_a_503(tmp_path: Path) -> None:
    with answering(CUT, NOT_READY, WHOLE) as url, Client(url) as client:
        client.download("job_1", 5, "ply", tmp_path / "state.ply")
    assert (tmp_path / "state.ply").read_bytes() == b"ply\nok"


def test_an_upload_that_broke_off_is_sent_again_under_its_key(mesh: Path) -> None:
    away = [CUT, NOT_READY, IN_PROGRESS]  # it was restarted, and its former self had begun
    keys: list[bytes] = []
    with answering(JOB, *away, JOB, keys=keys) as url, Client(url) as client:
        client.job("job_1")
        assert client.submit(mesh, {})["id"] == "job_1"
    assert len(keys) == 4
    assert len(set(keys)) == 1


def test_the_first_upload_is_not_sent_again(mesh: Path) -> None:
    # who named a wrong address is told at once
    with answering(NOT_READY) as url, Client(url) as client, pytest.raises(RefusedError) as refused:
        client.submit(mesh, {})
    assert refused.value.status == 503


def test_an_error_that_is_no_problem_document_is_told_by_its_number() -> None:
    answer = b"HTTP/1.1 502 Bad Gateway\r\nContent-Length: 6\r\n\r\n<html>"
    with answering(answer) as url, Client(url) as client, pytest.raises(RefusedError, match="502"):
        client.job("job_1")
