"""Runner processes as the supervisor has them: an order goes down a pipe, events come up another."""

from __future__ import annotations

import json
import os
import selectors
import signal
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Final

from worker.orders import Order
from worker.processes import ForkServer, Process, can_fork, spawn

_READ: Final = 1 << 16


class Runner:
    """One runner process, and the events that come up its pipe.

    Args:
        start: starts the process, given where its order comes from and where its events go.

    """

    def __init__(self, start: Callable[[int, int], Process]) -> None:
        order, stdin = os.pipe()
        stdout, events = os.pipe()
        self._stdin, self._stdout = os.fdopen(stdin, "wb", buffering=0), os.fdopen(stdout, "rb", buffering=0)
        try:
            self._process = start(order, events)
        except BaseException:
            self._stdin.close()
            self._stdout.close()
            raise
        finally:
            os.close(order)
            os.close(events)
        os.set_blocking(stdout, False)
        self._selector = selectors.DefaultSelector()
        self._selector.register(stdout, selectors.EVENT_READ)
        self._partial = b""
        self._ready = False
        self._pending: signal.Signals | None = None
        self.ended = False

    @property
    def pid(self) -> int:
        """Process id; there may be a wait for it before the ``ready`` event."""
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
        return events

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
    """Hands out runners, so that a job need not wait for Python and its imports.

    They are forked; where they cannot be, one is kept in reserve, and the supervisor says when the next is started.
    """

    def __init__(self, *, forked: bool | None = None) -> None:
        self._forked = can_fork() if forked is None else forked
        self._server: ForkServer | None = None
        self._spare: Runner | None = None
        self._lock = threading.Lock()

    @property
    def server_pid(self) -> int | None:
        """Process id of the fork server, if there is one."""
        return None if self._server is None else self._server.pid

    def prepare(self) -> None:
        """Start the fork server, or a spare, unless there is one; if that cannot be, `take` will say so."""
        with self._lock, suppress(OSError):
            if self._forked:
                self._living_server()
            elif self._spare is None or not self._spare.alive:
                self._discard_spare()
                self._spare = Runner(spawn)

    def take(self) -> Runner:
        """Return a runner that waits for its order, or will when it has started."""
        with self._lock:
            if self._forked:
                return Runner(self._living_server().fork)
            if self._spare is None or not self._spare.alive:
                self._discard_spare()
                return Runner(spawn)
            runner, self._spare = self._spare, None
            return runner

    def close(self) -> None:
        """End the fork server, with all it forked, and the spare."""
        with self._lock:
            if self._server is not None:
                self._server.close()
                self._server = None
            self._discard_spare()

    def _living_server(self) -> ForkServer:
        if self._server is None or not self._server.alive:
            if self._server is not None:
                self._server.close()
            self._server = ForkServer()
        return self._server

    def _discard_spare(self) -> None:
        if self._spare is not None:
            self._spare.kill()
            self._spare.wait()
            self._spare = None
