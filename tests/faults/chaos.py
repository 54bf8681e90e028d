"""A TCP proxy before a server's socket that can refuse, swallow and cut: a network that fails, without root."""

from __future__ import annotations

import socket
import threading
from types import TracebackType
from typing import Self
from urllib.parse import unquote, urlsplit


class ChaosProxy:
    """Passes bytes on between a port of the loopback and a unix socket, until it is told not to.

    `half_open` leaves every connection open and passes nothing more on either way, as a dropped NAT entry does;
    connections made afterwards work. `hung` does so with all, new ones included, until `heal`.
    """

    def __init__(self, target: str) -> None:
        """Begin; `target` is the address of the server, ``unix:///…``."""
        self._target = unquote(urlsplit(target).path)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._live: set[threading.Event] = set()  # one a connection: set while it passes bytes on
        self._sockets: list[socket.socket] = []
        self._hung = False
        self._lock = threading.Lock()
        threading.Thread(target=self._accept, daemon=True).start()

    @property
    def url(self) -> str:
        """Where clients connect."""
        return f"redis://127.0.0.1:{self._listener.getsockname()[1]}/0"

    def half_open(self) -> int:
        """Let every present connection fall silent; returns how many there were."""
        with self._lock:
            silenced, self._live = self._live, set()
        for passing in silenced:
            passing.clear()
        return len(silenced)

    def hang(self) -> None:
        """Accept everybody and answer nobody."""
        self._hung = True
        self.half_open()

    def heal(self) -> None:
        """Serve new connections again."""
        self._hung = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        for connection in self._sockets:
            try:
                connection.shutdown(socket.SHUT_RDWR)
            except OSError:  # closed by its peer already
                continue
            finally:
                connection.close()

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:  # closed: the end
                return
            passing = threading.Event()
            self._sockets.append(client)
            if self._hung:
                continue
            server = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            try:
                server.connect(self._target)
            except OSError:  # the server is down, and so is this connection
                client.close()
                server.close()
                continue
            self._sockets.append(server)
            passing.set()
            with self._lock:
                self._live.add(passing)
            for source, sink in ((client, server), (server, client)):
                threading.Thread(target=_pump, args=(source, sink, passing), daemon=True).start()


def _pump(source: socket.socket, sink: socket.socket, passing: threading.Event) -> None:
    try:
        while data := source.recv(65536):
            if passing.is_set():  # what falls silent stays open, and swallows
                sink.sendall(data)
        if passing.is_set():
            sink.shutdown(socket.SHUT_WR)
    except OSError:  # one side is gone
        return
