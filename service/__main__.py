"""``python -m service``: the API until SIGTERM."""

from __future__ import annotations

import argparse
import socket
from contextlib import suppress
from functools import partial

import uvicorn

from service.app import create_app
from service.gate import is_loopback
from service.server import configuration


def main() -> None:
    """Serve on an address, or on a listening socket that the parent process holds."""
    parser = argparse.ArgumentParser(prog="python -m service", description=main.__doc__)
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--port", type=int, default=8000)
    parser.add_argument("--fd", type=int, help="descriptor of a socket that listens on host and port already")
    parser.add_argument("--grace", type=int, default=5, help="seconds that open requests have at the end")
    given = parser.parse_args()
    sockets = None if given.fd is None else [socket.socket(fileno=given.fd)]
    address = sockets[0].getsockname() if sockets else (given.host,)
    on_loopback = isinstance(address, tuple) and is_loopback(
        address[0]
    )  # else text: the path of a Unix socket
    app = partial(create_app, loopback=given.host if on_loopback else None)
    config = configuration(
        app, factory=True, host=given.host, port=given.port, timeout_graceful_shutdown=given.grace
    )
    with suppress(KeyboardInterrupt):  # uvicorn stops in good order and then passes the signal on
        uvicorn.Server(config).run(sockets=sockets)


if __name__ == "__main__":
    main()
