"""``python -m benchmarks.serve_bare_api FD``: the bare route, served as the service is."""

from __future__ import annotations

import socket
import sys

import uvicorn

from service.server import configuration

if __name__ == "__main__":
    config = configuration("benchmarks.bare_api:create_app")
    uvicorn.Server(config).run(sockets=[socket.socket(fileno=int(sys.argv[1]))])
