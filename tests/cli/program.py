"""The command line as users have it: a process of its own."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import chdir, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from typer.testing import CliRunner

from spherify.cli.commands import app
from tests.processes import Seen, below, processes
from tests.stack import QUICK, wait_for

COMMAND = (sys.executable, "-m", "spherify.cli")
LIMIT_S = 100


@dataclass(frozen=True)
class Ended:
    """What a command left behind."""

    code: int
    out: str
    err: str


def spherify(*arguments: str | Path, cwd: Path, environment: Mapping[str, str] | None = None) -> Ended:
    """Run a command to its end."""
    done = subprocess.run(
        [*COMMAND, *map(str, arguments)],
        cwd=cwd,
        env={**os.environ, **(environment or {})},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=False,
    )
    return Ended(done.returncode, done.stdout, done.stderr)


def spherify_here(*arguments: str | Path, cwd: Path) -> Ended:
    """Run a command to its end in this process, which spares the second that its imports take."""
    with chdir(cwd):
        done = CliRunner().invoke(app, [str(argument) for argument in arguments])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception  # a user would have seen a trace
    return Ended(done.exit_code, done.stdout, done.stderr)


@dataclass
class Running:
    """A command that runs, and what it says."""

    process: subprocess.Popen[str]
    said: list[str] = field(default_factory=list)

    @property
    def text(self) -> str:
        """Everything it has said."""
        return "".join(self.said)

    def url(self) -> str:
        """Wait for the banner and return the address in it."""
        wait_for(lambda: self._alive() and "Ctrl-C stops" in self.text, limit_s=90, what="the banner")
        found = re.search(r"(http://\S+)/docs", self.text)
        assert found
        return found[1]

    def end(self, number: int) -> int:
        """Send a signal and wait for the end."""
        self.process.send_signal(number)
        return self.process.wait(30)

    def children(self, containing: str = "") -> list[Seen]:
        """Return its children whose command line contains a text."""
        everything = processes().values()
        return [seen for seen in everything if seen.parent == self.process.pid and containing in seen.command]

    def family(self) -> list[Seen]:
        """Return children, their children, and so on."""
        return below(self.process.pid)

    def _alive(self) -> bool:
        assert self.process.poll() is None, f"ended with {self.process.returncode}:\n{self.text}"
        return True


@contextmanager
def running(
    *arguments: str | Path, cwd: Path, environment: Mapping[str, str] | None = None
) -> Iterator[Running]:
    """Start a command; whatever is left of it at the end of the block is ended."""
    process = subprocess.Popen(
        [*COMMAND, *map(str, arguments)],
        cwd=cwd,
        env={**os.environ, **QUICK, **(environment or {})},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    command = Running(process)
    assert process.stdout is not None
    reader = threading.Thread(target=command.said.extend, args=(process.stdout,), daemon=True)
    reader.start()
    try:
        yield command
    finally:
        family = command.family()
        if process.poll() is None:
            process.terminate()
        try:
            process.wait(30)
        finally:
            for seen in family:
                if not seen.gone():
                    os.kill(seen.pid, signal.SIGKILL)
            process.kill()
            reader.join(10)
            process.stdout.close()
