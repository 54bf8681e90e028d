"""Ways to start a runner process: forked from one that is ready for it, or, where that is not safe, anew."""

from __future__ import annotations

import os
import select
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from functools import cache
from typing import Final, Protocol

from worker.fork_server import FILES

_FATE_S: Final = 2.0  # the fork server has nothing else to do than to tell the end of a runner
_THREAD_VARIABLES: Final = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)


class Process(Protocol):
    """What a supervisor needs of a runner's process; `subprocess.Popen` has it."""

    @property
    def pid(self) -> int:
        """Process id."""

    def poll(self) -> int | None:
        """Return the exit code, negative for a signal; None while it runs."""

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the exit code; raises `subprocess.TimeoutExpired`."""

    def send_signal(self, sig: int) -> None:
        """Send a signal; harmless when it has ended."""

    def kill(self) -> None:
        """End it at once, without waiting; harmless when it has ended."""


@cache
def can_fork() -> bool:
    """Whether runners can be forked: on Linux 5.3 or newer, unless a sandbox forbids handles on processes.

    Elsewhere a process that has not called ``exec`` may not use all of the system's libraries (macOS), or there is
    no tether.
    """
    if not hasattr(os, "pidfd_open"):
        return False
    try:
        os.close(os.pidfd_open(os.getpid()))
    except OSError:
        return False
    return True


def spawn(order: int, events: int) -> Process:
    """Start a runner of its own, which will be ready in a second or two."""
    return _python("worker.runner", order, events)


class ForkServer:
    """The process of `worker.fork_server`, which ends with the thread that started it."""

    def __init__(self) -> None:
        self._requests, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self._process = _python("worker.fork_server", theirs.fileno())
        self._killed = False

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def alive(self) -> bool:
        """Whether it runs, and will go on: one that was killed closes its files before the system says it has ended."""
        return not self._killed and self._process.poll() is None

    def fork(self, order: int, events: int) -> Process:
        """Ask for a runner, and do not wait for it: a server that is starting has other things to do first."""
        fate, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs, suppress(BrokenPipeError, ConnectionResetError):  # it has died: the fate will tell
            files = [order, events, theirs.fileno()]
            assert len(files) == FILES  # noqa: S101 (what the other side reads)
            socket.send_fds(self._requests, [b"f"], files)
        return _Forked(self, fate)

    def kill(self) -> None:
        """End it, and with it the runners that it forked; harmless when it has ended."""
        self._killed = True
        self._process.kill()

    def close(self) -> None:
        """End it, and wait for that."""
        self.kill()
        self._process.wait()
        self._requests.close()


class _Forked:
    """A runner as the server tells of it; see `Process`."""

    def __init__(self, server: ForkServer, fate: socket.socket) -> None:
        self._server = server
        self._fate = fate
        self._pid: int | None = None
        self._handle = -1
        self._code: int | None = None

    @property
    def pid(self) -> int:
        """Process id; waits until there is one, raises `ProcessLookupError` if there never will be."""
        while self._pid is None and self._code is None:
            self._hear(None)
        if self._pid is None:
            raise ProcessLookupError("the fork server ended before it forked")
        return self._pid

    def poll(self) -> int | None:
        """See `Process.poll`."""
        while self._code is None and self._hear(0):
            pass
        return self._code

    def wait(self, timeout: float | None = None) -> int:
        """See `Process.wait`."""
        till = None if timeout is None else time.monotonic() + timeout
        while self._code is None:
            left = None if till is None else max(till - time.monotonic(), 0)
            if not self._hear(left) and timeout is not None:
                raise subprocess.TimeoutExpired("a forked runner", timeout)
        return self._code

    def send_signal(self, sig: int) -> None:
        """See `Process.send_signal`, for one that has said that it is there: its server may tell so a moment later."""
        while self.poll() is None and self._handle < 0:
            if not self._hear(_FATE_S):
                self._server.kill()  # it stands still, and what it forked ends with it
        self._signal(sig)

    def kill(self) -> None:
        """See `Process.kill`; one that is not there yet is ended with the server that would make it."""
        if self.poll() is None and self._handle < 0:
            self._server.kill()
        self._signal(signal.SIGKILL)

    def _signal(self, sig: int) -> None:
        if self._code is None and self._handle >= 0:
            with suppress(ProcessLookupError):
                signal.pidfd_send_signal(self._handle, sig)

    def _hear(self, timeout_s: float | None) -> bool:
        """Take in one message, waiting that long; whether one came."""
        ready = _readable([self._fate.fileno(), self._handle], timeout_s)
        if not ready:
            return False
        if self._fate.fileno() not in ready and not _readable([self._fate.fileno()], _FATE_S):
            self._server.kill()  # the runner has ended and it does not say so: it stands still
        message, handles, _, _ = socket.recv_fds(self._fate, 32, 1)
        if handles:
            self._pid, self._handle = int(message), handles[0]
            return True
        # Without a code the server has ended, and the runner with it.
        self._code = int(message) if message else -signal.SIGKILL
        self._fate.close()
        if self._handle >= 0:
            os.close(self._handle)
        return True


def _readable(files: list[int], timeout_s: float | None) -> set[int]:
    """Return which of these can be read (a process's handle: when it has ended), waiting that long for the first."""
    look = select.poll()
    for number in files:
        if number >= 0:
            look.register(number, select.POLLIN)
    return {number for number, _ in look.poll(None if timeout_s is None else timeout_s * 1e3)}


def _python(module: str, stdin: int, stdout: int | None = None) -> subprocess.Popen[bytes]:
    """Start a module, tethered; its libraries compute with one thread, the kernels' own come on top."""
    environment = {**os.environ, **dict.fromkeys(_THREAD_VARIABLES, "1")}
    command = [sys.executable, "-m", module, str(os.getpid())]
    return subprocess.Popen(command, stdin=stdin, stdout=stdout, env=environment)  # noqa: S603 (our own command line)
