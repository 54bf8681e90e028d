"""``python -m spherify.cli.api_program FD``: the API on a listening socket that its parent holds."""

from __future__ import annotations

import socket
import sys

import uvicorn


def main(descriptor: int) -> None:
    """Serve until SIGTERM."""
    config = uvicorn.Config(
        "service.app:create_app",
        factory=True,
        log_level="info",
        timeout_graceful_shutdown=5,
        use_colors=False,
    )
    uvicorn.Server(config).run(sockets=[socket.socket(fileno=descriptor)])


if __name__ == "__main__":
    main(int(sys.argv[1]))
