"""``python -m tests.faults.dying_api PORT POINT…``: the API, killed in the middle of a request, again and again.

The first process dies at the first point, the next one at the second, and after the last point nobody dies. A point
is ``before:STORE.METHOD`` or ``after:STORE.METHOD``: a call of a port, so that the code that is tested knows nothing
of it.
"""

from __future__ import annotations

import os
import signal
import socket
import sys
from typing import Any

import uvicorn

from service.app import create_app
from service.server import configuration
from spherify.settings import Settings
from spherify.stores.connect import open_stores


class Dying:
    """A store, or all of them, with one deadly method."""

    def __init__(self, target: object, path: str, point: str) -> None:
        self._target, self._path, self._point = target, path, point

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._target, name)
        path = f"{self._path}.{name}".lstrip(".")
        when, _, where = self._point.partition(":")
        if where.startswith(f"{path}."):
            return Dying(value, path, self._point)
        if path != where:
            return value

        def deadly(*args: object, **kwargs: object) -> object:
            if when == "before":
                os.kill(os.getpid(), signal.SIGKILL)
            answer = value(*args, **kwargs)
            os.kill(os.getpid(), signal.SIGKILL)
            return answer

        return deadly


def serve(listener: socket.socket, point: str) -> None:
    """Serve until death."""
    settings = Settings()
    stores = open_stores(settings)
    app = create_app(settings, Dying(stores, "", point) if point else stores)
    uvicorn.Server(configuration(app)).run(sockets=[listener])


def main(port: int, points: list[str]) -> None:
    """Fork one server after another, all on one listening socket: a request made meanwhile waits."""
    listener = socket.create_server(("127.0.0.1", port), backlog=100)
    for point in [*points, ""]:
        if (pid := os.fork()) == 0:
            serve(listener, point)
            os._exit(0)
        if not point:
            signal.signal(signal.SIGTERM, lambda *_, pid=pid: os.kill(pid, signal.SIGTERM))
        os.waitpid(pid, 0)


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2:])
