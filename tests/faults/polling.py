"""Many clients that hold a connection each and ask now and then: what ten thousand open pages do.

One thread and bare sockets, so that the clients take little of the machine that the server is measured on.
"""

from __future__ import annotations

import random
import selectors
import socket
from contextlib import closing
from dataclasses import dataclass, field
from heapq import heapify, heappop, heappush
from os import strerror
from time import monotonic, process_time

_HEAD_END = b"\r\n\r\n"
_LENGTH = b"content-length: "


@dataclass
class Polled:
    """What came back: seconds of each answer, whatever was no 200, and what it took of the clients' processor."""

    seconds: list[float] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)
    took_s: float = 0.0
    cpu_s: float = 0.0

    def percentile(self, share: float) -> float:
        """Return the time within which this share of all answers came."""
        return sorted(self.seconds)[int(share * (len(self.seconds) - 1))]


@dataclass(eq=False, slots=True)
class _Client:
    """One of them; asking from `began_at` on, or idle."""

    rounds: int
    began_at: float | None = None
    connection: socket.socket | None = None
    received: bytes = b""


@dataclass(frozen=True)
class Clients:
    """So many clients ask for a path of a server, each every `period_s` seconds, so many times."""

    host: str
    port: int
    path: str
    clients: int
    period_s: float
    rounds: int

    def poll(self) -> Polled:
        """Let them ask, each on a connection of its own, evenly spread over the period."""
        began, cpu = monotonic(), process_time()
        with closing(_Crowd(self)) as crowd:
            crowd.run()
        crowd.polled.took_s, crowd.polled.cpu_s = monotonic() - began, process_time() - cpu
        return crowd.polled


class _Crowd:
    """All clients while they ask."""

    def __init__(self, how: Clients) -> None:
        self.polled = Polled()
        self._how = how
        self._request = f"GET {how.path} HTTP/1.1\r\nHost: x\r\n\r\n".encode()
        self._selector = selectors.DefaultSelector()
        self._asking = 0
        rng, now = random.Random(15), monotonic()
        self._everyone = [_Client(how.rounds) for _ in range(how.clients)]
        self._due = [
            (now + rng.uniform(0, how.period_s), number, client)
            for number, client in enumerate(self._everyone)
        ]
        heapify(self._due)

    def run(self) -> None:
        """Return when all have asked as often as they were to."""
        while self._due or self._asking:
            pause = max(0.0, self._due[0][0] - monotonic()) if self._due else None
            for key, events in self._selector.select(pause):
                self._send(key.data) if events & selectors.EVENT_WRITE else self._receive(key.data)
            while self._due and self._due[0][0] <= monotonic():
                self._ask(heappop(self._due)[2])

    def close(self) -> None:
        """Close what is open."""
        for client in self._everyone:
            self._hang_up(client)
        self._selector.close()

    def _ask(self, client: _Client) -> None:
        client.began_at = monotonic()
        client.rounds -= 1
        self._asking += 1
        if client.connection is not None:
            self._send(client)
            return
        client.connection = socket.socket()
        client.connection.setblocking(False)
        client.connection.connect_ex((self._how.host, self._how.port))
        self._selector.register(client.connection, selectors.EVENT_WRITE, client)

    def _send(self, client: _Client) -> None:
        assert client.connection is not None
        if error := client.connection.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
            self._failed(client, strerror(error))
            return
        self._selector.modify(client.connection, selectors.EVENT_READ, client)
        try:
            client.connection.send(self._request)  # a few bytes: they fit
        except OSError as e:
            self._failed(client, repr(e))

    def _receive(self, client: _Client) -> None:
        assert client.connection is not None
        try:
            data = client.connection.recv(1 << 16)
        except OSError as e:
            data, told = b"", repr(e)
        else:
            told = "closed within an answer"
        client.received += data
        if not data and client.began_at is None:  # closed, as idle ones are: it will call again
            self._hang_up(client)
        elif not data:
            self._failed(client, told)
        else:
            head, end, body = client.received.partition(_HEAD_END)
            if end and len(body) >= int(head.lower().partition(_LENGTH)[2].partition(b"\r\n")[0]):
                self._answered(client, head)

    def _answered(self, client: _Client, head: bytes) -> None:
        assert client.began_at is not None
        self.polled.seconds.append(monotonic() - client.began_at)
        if not head.startswith(b"HTTP/1.1 200 "):
            self.polled.errors.append(head.decode("latin-1").splitlines()[0])
        self._rest(client)

    def _failed(self, client: _Client, what: str) -> None:
        self.polled.errors.append(what)
        self._hang_up(client)
        self._rest(client)

    def _rest(self, client: _Client) -> None:
        assert client.began_at is not None
        if client.rounds:
            heappush(self._due, (client.began_at + self._how.period_s, id(client), client))
        client.began_at, client.received = None, b""
        self._asking -= 1

    def _hang_up(self, client: _Client) -> None:
        if client.connection is not None:
            self._selector.unregister(client.connection)
            client.connection.close()
            client.connection = None
