"""``python -m service``: the API until SIGTERM."""

from __future__ import annotations

import argparse
import socket
from contextlib import suppress

import uvicorn

from service.server import configuration


def main() -> None:
    """Serve on an address, or on a listening socket that the parent process holds."""
    parser = argparse.ArgumentParser(prog="python -m service", description=main.__doc__)
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--port", type=int, default=8000)
    parser.add_argument("--fd", type=int, help="descriptor of a listening socket, instead of host and port")
    parser.add_argument("--grace", type=int, default=5, help="seconds that open requests have at the end")
    given = parser.parse_args()
    config = configuration(
        "service.app:create_app", host=given.host, port=given.port, timeout_graceful_shutdown=given.grace
    )
    sockets = None if given.fd is None else [socket.socket(fileno=given.fd)]
    with suppress(KeyboardInterrupt):  # uvicorn stops in good order and then passes the signal on
        uvicorn.Server(config).run(sockets=sockets)


if __name__ == "__main__":
    main()
