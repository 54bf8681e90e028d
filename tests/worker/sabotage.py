"""``python -m tests.worker.sabotage``: a real worker that stops working on a signal, or never could.

FETCH_NOTHING: its channels believe that every slot is taken, so that it is connected, turns, and fetches nothing.
STAND_STILL: its event loop stands still, for good.
In an environment with NO_RUNNERS its fork server ends at once.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading

from worker import processes
from worker.transport import QoS

FETCH_NOTHING, STAND_STILL = signal.SIGRTMIN + 1, signal.SIGRTMIN + 2  # Celery has the others


def _fetch_nothing(*_: object) -> None:
    QoS.can_consume = lambda _: False


def _stand_still(*_: object) -> None:
    threading.Event().wait()


def _end_at_once(_module: str, stdin: int, stdout: int | None = None) -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, "-c", "raise SystemExit(1)"], stdin=stdin, stdout=stdout)


if __name__ == "__main__":
    from worker.__main__ import OPTIONS
    from worker.app import app

    if "NO_RUNNERS" in os.environ:
        processes._python = _end_at_once
    signal.signal(FETCH_NOTHING, _fetch_nothing)
    signal.signal(STAND_STILL, _stand_still)
    app.worker_main([*OPTIONS, *sys.argv[1:]])
