"""Runner processes: one kept ready, so that a job need not wait for Python and its imports."""

from __future__ import annotations

import json
import os
import selectors
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from typing import Any, Final

from worker.orders import Order

_THREAD_VARIABLES: Final = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)
_READ: Final = 1 << 16


class Runner:
    """One process of `worker.runner`, and the events that come up its pipe."""

    def __init__(self, threads: int) -> None:
        environment = {**os.environ, **dict.fromkeys(_THREAD_VARIABLES, str(threads))}
        self._process = subprocess.Popen(  # noqa: S603 (our own command line)
            [sys.executable, "-m", "worker.runner", str(os.getpid())],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            env=environment,
        )
        assert self._process.stdin is not None  # noqa: S101 (it is a pipe, above)
        assert self._process.stdout is not None  # noqa: S101 (as above)
        self._stdin, self._stdout = self._process.stdin, self._process.stdout
        os.set_blocking(self._stdout.fileno(), False)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._stdout, selectors.EVENT_READ)
        self._partial = b""
        self._ready = False
        self._pending: signal.Signals | None = None
        self.ended = False

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def alive(self) -> bool:
        """Whether the process runs."""
        return self._process.poll() is None

    def start(self, order: Order) -> None:
        """Hand over the one order; a runner that is dead already is found out by `events`."""
        with suppress(BrokenPipeError):
            self._stdin.write(order.line())

    def events(self, timeout_s: float) -> list[dict[str, Any]]:
        """Return the events that have come, waiting that long for the first; `ended` is set after the last."""
        if not self._selector.select(timeout_s):
            return []
        while True:
            try:
                chunk = os.read(self._stdout.fileno(), _READ)
            except BlockingIOError:
                break
            if not chunk:
                self.ended = True
                break
            self._partial += chunk
        *lines, self._partial = self._partial.split(b"\n")
        events = [json.loads(line) for line in lines]
        if any(event["event"] == "ready" for event in events):
            self._ready = True
            if self._pending is not None:
                self._process.send_signal(self._pending)
        return [event for event in events if event["event"] != "ready"]

    def tell(self, number: signal.Signals) -> None:
        """Send a signal, as soon as the runner hears it."""
        if self._ready:
            self._process.send_signal(number)
        else:
            self._pending = number

    def kill(self) -> None:
        """End it at once, without waiting: `events` tells when it has ended. Harmless when it has."""
        self._process.kill()

    def wait(self, timeout_s: float | None = None) -> int:
        """Wait for its end, close the pipes, and return its exit code, negative for a signal.

        Raises:
            subprocess.TimeoutExpired: it still runs.

        """
        code = self._process.wait(timeout_s)
        self._selector.close()
        self._stdout.close()
        self._stdin.close()
        return code


class Runners:
    """Hands out runners; the supervisor says when the next spare is started."""

    def __init__(self, threads: int) -> None:
        self._threads = threads
        self._spare: Runner | None = None
        self._lock = threading.Lock()

    def prepare(self) -> None:
        """Start a spare unless there is one."""
        with self._lock:
            if self._spare is None or not self._spare.alive:
                self._discard()
                self._spare = Runner(self._threads)

    def take(self) -> Runner:
        """Return a runner that waits for its order."""
        with self._lock:
            runner, self._spare = self._spare, None
        if runner is not None and runner.alive:
            return runner
        if runner is not None:
            runner.wait()
        return Runner(self._threads)

    def close(self) -> None:
        """End the spare."""
        with self._lock:
            self._discard()

    def _discard(self) -> None:
        if self._spare is not None:
            self._spare.kill()
            self._spare.wait()
            self._spare = None
