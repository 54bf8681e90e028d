"""A client that costs next to nothing, so that the server is what is measured: GET over connections kept open."""

from __future__ import annotations

import socket
import time
from typing import Final, Self

_HEAD_END: Final = b"\r\n\r\n"
_LENGTH: Final = b"content-length:"


class Connections:
    """Some connections to one server on this machine; a context manager."""

    def __init__(self, port: int, count: int) -> None:
        self._sockets = [socket.create_connection(("127.0.0.1", port), timeout=30) for _ in range(count)]
        for connection in self._sockets:
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def per_second(self, path: str, requests: int) -> float:
        """Ask so often, on all connections at once again and again, and return the requests a second."""
        request = f"GET {path} HTTP/1.1\r\nHost: localhost\r\nAccept: application/json\r\n\r\n".encode()
        rounds = requests // len(self._sockets)
        began = time.perf_counter()
        for _ in range(rounds):
            for connection in self._sockets:
                connection.sendall(request)
            for connection in self._sockets:
                _answer(connection)
        return rounds * len(self._sockets) / (time.perf_counter() - began)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for connection in self._sockets:
            connection.close()


def _answer(connection: socket.socket) -> bytes:
    """Read one answer; raises `AssertionError` unless it is 200."""
    data = b""
    while _HEAD_END not in data:
        data += _received(connection)
    head, _, body = data.partition(_HEAD_END)
    if not head.startswith(b"HTTP/1.1 200"):
        raise AssertionError(head.splitlines()[0].decode())
    lines = (line for line in head.lower().split(b"\r\n") if line.startswith(_LENGTH))
    length = int(next(lines).removeprefix(_LENGTH))
    while len(body) < length:
        body += _received(connection)
    return body


def _received(connection: socket.socket) -> bytes:
    data = connection.recv(1 << 16)
    if not data:
        raise AssertionError("the server closed the connection")
    return data
