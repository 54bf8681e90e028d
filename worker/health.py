"""``python -m worker.health [NODE]``: exit code 0 while the worker on this host works, for container health checks.

A server that does not answer is not the worker's fault: restarting the worker would not help, so it counts as healthy.
"""

from __future__ import annotations

import socket
import sys

from spherify.jobs.errors import StoreUnavailableError
from spherify.settings import Settings
from worker.liveness import is_alive


def main(arguments: list[str]) -> int:
    """Return the exit code for a node name, by default that of Celery on this host."""
    node = arguments[0] if arguments else f"celery@{socket.gethostname()}"
    try:
        alive = is_alive(Settings().redis_url, node)
    except StoreUnavailableError as e:
        sys.stderr.write(f"{e}\n")
        return 0
    sys.stderr.write(f"{node} {'works' if alive else 'gives no sign of life'}\n")
    return 0 if alive else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
