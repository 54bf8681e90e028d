"""Clients that are slow, deaf, too many, or speak no HTTP: bare sockets against the real server."""

from __future__ import annotations

import json
import select
import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack

import httpx
import pytest

from service.server import Protocol, protocol
from spherify.formats import write_mesh
from spherify.geometry.samples import SAMPLES
from spherify.settings import Settings
from spherify.stores.connect import Stores
from tests.service.conftest import serve, until
from tests.service.test_uploads import connect, everything

GET = b"GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n"
MOST = 20


@pytest.fixture(scope="module")
def strict() -> type[Protocol]:
    """A connection class with little patience."""
    return protocol(headers_s=0.5, answer_s=0.5, most_connections=MOST)


@pytest.fixture(scope="module")
def url(shared_settings: Settings, shared_stores: Stores, strict: type[Protocol]) -> Iterator[str]:
    with serve(shared_settings, shared_stores, http=strict) as url:
        yield url


def document(answer: bytes, status: int, slug: str) -> dict[str, object]:
    """Check a raw answer that is a problem document."""
    head, _, body = answer.partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 %d " % status), answer
    assert b"content-type: application/problem+json" in head
    assert b"connection: close" in head.lower()
    found: dict[str, object] = json.loads(body)
    assert found["type"] == f"/problems/{slug}"
    return found


def test_a_connection_that_asks_nothing_is_closed(url: str) -> None:
    with connect(url) as connection:
        assert everything(connection) == b""


def trickle(connection: socket.socket, text: bytes, done: threading.Event) -> None:
    for byte in text:
        if done.wait(0.02):
            return
        try:
            connection.sendall(bytes([byte]))
        except OSError:
            return


@pytest.mark.parametrize("first", [b"", GET])
def test_headers_that_trickle_are_not_waited_for(url: str, first: bytes) -> None:
    """A byte every moment, so that no silence is ever long; on a new connection, and on one that was used."""
    done = threading.Event()
    with connect(url) as connection:
        if first:
            connection.sendall(first)
            answer = b""
            while not answer.endswith(b'{"status":"ok"}'):
                answer += connection.recv(65536)
        slow = threading.Thread(
            target=trickle, args=(connection, b"GET / HTTP/1.1\r\n" + b"x: y\r\n" * 1000, done)
        )
        slow.start()
        try:
            answer = connection.recv(65536)
        finally:
            done.set()
            slow.join()
    document(answer, 408, "request-timeout")


def test_slow_headers_do_not_keep_others_waiting(url: str) -> None:
    with ExitStack() as stack:
        for _ in range(MOST // 2):
            slow = stack.enter_context(connect(url))
            slow.sendall(b"GET / HTTP/1.1\r\nHo")
        assert httpx.get(f"{url}/v1/jobs", timeout=5).status_code == 200


def test_a_client_that_does_not_read_is_cut_off(url: str, stores: Stores) -> None:
    content = write_mesh(SAMPLES["stone"].build(40_000), "ply")
    path = httpx.put(f"{url}/v1/meshes?name=a.ply", content=content, timeout=60).json()["links"]["content"]
    with socket.socket() as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.connect((httpx.URL(url).host, httpx.URL(url).port))
        connection.sendall(f"GET {path} HTTP/1.1\r\nHost: x\r\n\r\n".encode() * 16)
        poller = select.poll()
        poller.register(connection, 0)  # asks for nothing, and is told of a reset all the same
        events = [event for _, event in poller.poll(20_000)]
    assert events
    assert events[0] & select.POLLERR


def test_too_many_connections_are_refused_and_probes_let_in(url: str) -> None:
    with ExitStack() as stack:
        for _ in range(MOST):
            kept = stack.enter_context(connect(url))
            kept.sendall(GET)
            assert kept.recv(65536).startswith(b"HTTP/1.1 200 ")
        with connect(url) as one_more:
            one_more.sendall(b"GET /v1/jobs HTTP/1.1\r\nHost: x\r\n\r\n")
            answer = everything(one_more)
        document(answer, 503, "not-ready")
        assert b"retry-after: " in answer.lower()
        for probe in ("/healthz", "/readyz"):
            assert httpx.get(url + probe).status_code == 200
    until(lambda: httpx.get(f"{url}/v1/jobs").status_code == 200)


@pytest.mark.parametrize(
    "text",
    [
        b"nonsense\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost : x\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: x\r\nContent-Length: many\r\n\r\n",
        b"GET / HTTP/1.1\r\n\r\n",
        b"PUT /v1/meshes?name=a.obj HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\n",
    ],
)
def test_broken_http_is_answered_like_everything_else(url: str, stores: Stores, text: bytes) -> None:
    with connect(url) as connection:
        connection.sendall(text)
        document(connection.recv(65536), 400, "malformed-request")


def test_a_request_with_two_lengths_is_refused_with_its_connection(url: str) -> None:
    """A proxy might take the second request for the first one's body, and let it pass unseen."""
    hidden = b"GET /healthz HTTP/1.1\r\nHost: x\r\nX: y\r\n\r\n"
    lengths = b"Content-Length: %d\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n" % (5 + len(hidden))
    with connect(url) as connection:
        connection.sendall(b"POST /v1/jobs HTTP/1.1\r\nHost: x\r\n" + lengths + hidden)
        found = document(everything(connection), 400, "malformed-request")
    assert "not both" in str(found["detail"])


@pytest.mark.parametrize("size", [10_000, 60_000, 500_000, 3_000_000])
def test_an_address_that_is_too_long_is_said_to_be(url: str, size: int) -> None:
    """However it is cut up on its way, and whatever of it is still coming when it is refused."""
    with connect(url) as connection:
        connection.sendall(b"GET /%s HTTP/1.1\r\nHost: x\r\n\r\n" % (b"a" * size))
        answer = everything(connection)
    found = document(answer, 414, "address-too-long")
    assert found["instance"] == "/" + "a" * 199 + "%E2%80%A6"
    assert f"X-Request-ID: {found['request_id']}".encode() in answer


@pytest.mark.parametrize("size", [66_000, 500_000, 3_000_000])
def test_headers_that_are_too_large_are_said_to_be(url: str, size: int) -> None:
    with connect(url) as connection:
        connection.sendall(b"GET /v1/jobs?limit=5 HTTP/1.1\r\nHost: x\r\nX: %s\r\n\r\n" % (b"a" * size))
        found = document(everything(connection), 431, "headers-too-large")
    assert found["instance"] == "/v1/jobs"


def test_long_addresses_and_large_headers_that_are_not_too_long_are_served(url: str, stores: Stores) -> None:
    answer = httpx.get(f"{url}/healthz?{'a' * 8000}", headers={"Cookie": "a" * 50_000})
    assert answer.status_code == 200


def test_a_refused_request_is_not_worked_at_any_more(url: str, stores: Stores) -> None:
    """Its body breaks off in the middle: what was there of it goes, and the connection ends once it was heard out."""
    with connect(url) as connection:
        head = b"PUT /v1/meshes?name=a.obj HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n"
        connection.sendall(head + b"5\r\nv 1 2\r\n")
        connection.sendall(b"nonsense\r\n" + b"x" * 1_000_000)
        document(everything(connection), 400, "malformed-request")
    until(lambda: list(stores.blobs.scratch().iterdir()) == [])


@pytest.mark.parametrize(
    ("target", "path"),
    [
        ("http://evil.example/v1/nothing?limit=1", "/v1/nothing"),
        ("HTTPS://evil.example:443/v1/nothing", "/v1/nothing"),
        ("http://evil.example?limit=1", "/"),
        ("http://evil.example", "/"),
        ("http:/v1/nothing", "http%3A/v1/nothing"),
    ],
)
def test_an_address_with_its_host_is_taken_as_a_proxy_sends_it(url: str, target: str, path: str) -> None:
    with connect(url) as connection:
        connection.sendall(f"POST {target} HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n".encode())
        body = everything(connection).partition(b"\r\n\r\n")[2]
    assert json.loads(body)["instance"] == path


def test_the_name_in_an_address_is_the_one_that_counts(settings: Settings, stores: Stores) -> None:
    with serve(settings, stores, loopback="127.0.0.1") as url, connect(url) as connection:
        connection.sendall(b"GET http://evil.example/v1/jobs HTTP/1.1\r\nHost: localhost\r\nX: y\r\n\r\n")
        assert connection.recv(65536).startswith(b"HTTP/1.1 421 ")
