"""One child program: started tethered to us, its lines passed on under its name, started again when it dies."""

from __future__ import annotations

import os
import signal
import subprocess
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

from spherify.stores.tether import tethered

LEAST_PAUSE_S: Final = 0.5
MOST_PAUSE_S: Final = 30.0
PROVEN_S: Final = 60.0  # who ran this long is started again without delay
LAST_LINES: Final = 15

Say = Callable[[str, str], None]


class Program:
    """A child process and what to do when it ends. Use it from one thread, which lives as long as the program."""

    def __init__(
        self,
        name: str,
        command: Sequence[str],
        environment: Mapping[str, str],
        say: Say,
        *,
        folder: Path,
        keep_open: Sequence[int] = (),
    ) -> None:
        self.name = name
        self.last_lines: deque[str] = deque(maxlen=LAST_LINES)
        self._command = list(command)
        self._environment = dict(environment)
        self._say = say
        self._folder = folder
        self._keep_open = tuple(keep_open)
        self._process: subprocess.Popen[str] | None = None
        self._pump: threading.Thread | None = None
        self._began = 0.0
        self._pause_s = LEAST_PAUSE_S
        self._start_at: float | None = None

    @property
    def pid(self) -> int | None:
        """Process id, None before the first start."""
        return self._process.pid if self._process is not None else None

    def start(self) -> None:
        """Start the process."""
        self._process = subprocess.Popen(  # noqa: S603 (our own command line)
            tethered(self._command),
            env=self._environment,
            cwd=self._folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            start_new_session=True,  # Ctrl-C is for us, who stop the programs in order
            pass_fds=self._keep_open,
        )
        self._began, self._start_at = time.monotonic(), None
        self._pump = threading.Thread(target=self._pass_on, args=(self._process,), daemon=True)
        self._pump.start()

    def exit_code(self) -> int | None:
        """Return the exit code of a process that has ended, None while it runs."""
        return self._process.poll() if self._process is not None else None

    def tend(self) -> None:
        """Start the process again if it ended, after a pause that doubles while it keeps ending early."""
        now = time.monotonic()
        if self._start_at is not None:
            if now >= self._start_at:
                self.start()
            return
        code = self.exit_code()
        if code is None:
            return
        if now - self._began >= PROVEN_S:
            self._pause_s = LEAST_PAUSE_S
        self._say(self.name, f"ended with {describe(code)}; starting it again in {self._pause_s:g} s")
        self._start_at = now + self._pause_s
        self._pause_s = min(2 * self._pause_s, MOST_PAUSE_S)

    def terminate(self) -> None:
        """Ask the process to end."""
        if self._process is not None and self._process.poll() is None:
            self._process.send_signal(signal.SIGTERM)

    def reap(self, deadline: float) -> None:
        """Wait for the process until a moment of the monotonic clock, then end it and its session by force."""
        if self._process is None:
            return
        try:
            self._process.wait(max(deadline - time.monotonic(), 0))
        except subprocess.TimeoutExpired:
            self._say(self.name, "does not end; killed")
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
        if self._pump is not None:
            self._pump.join(1.0)

    def _pass_on(self, process: subprocess.Popen[str]) -> None:
        if process.stdout is None:
            raise AssertionError("it was started with a pipe")
        heard = True
        with process.stdout as lines:
            for line in lines:  # to the end, whatever happens: a full pipe would hold the program up
                self.last_lines.append(line.rstrip())
                try:
                    if heard:
                        self._say(self.name, line.rstrip())
                except OSError:  # nobody reads our output any more, as after `| head`
                    heard = False


def describe(code: int) -> str:
    """Return an exit code in words."""
    if code >= 0:
        return f"code {code}"
    try:
        return f"signal {signal.Signals(-code).name}"
    except ValueError:
        return f"signal {-code}"
