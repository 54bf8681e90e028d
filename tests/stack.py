"""A started stack for tests: a real server, real workers, and the API, all on this machine and gone at the end."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from spherify.jobs.rebuild import rebuild
from spherify.settings import Settings
from spherify.stores import keys
from spherify.stores.connect import Stores, open_stores
from spherify.stores.embedded import EmbeddedServer
from spherify.stores.tether import tethered

ROOT = Path(__file__).resolve().parents[1]
READY_S = 60.0
QUICK = {
    "SPHERIFY_LEASE_S": "1.5",
    "SPHERIFY_HEARTBEAT_S": "0.3",
    "SPHERIFY_RECONCILE_S": "0.3",
    "SPHERIFY_ORPHAN_S": "2",
    "SPHERIFY_CANCEL_GRACE_S": "2",
}
"""Settings with which lost jobs are found again in a moment."""

T = TypeVar("T")


def wait_for(look: Callable[[], T], *, limit_s: float = 30.0, what: str = "") -> T:
    """Return the first true answer; fails after the limit."""
    deadline = time.monotonic() + limit_s
    while not (answer := look()):
        if time.monotonic() > deadline:
            raise AssertionError(f"not within {limit_s:g} s: {what or look}")
        time.sleep(0.01)
    return answer


@dataclass
class Stack:
    """What runs, and how to reach it."""

    data_dir: Path
    environment: dict[str, str]
    settings: Settings
    stores: Stores
    server: EmbeddedServer
    url: str = ""
    workers: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)
    _processes: list[subprocess.Popen[bytes]] = field(default_factory=list)

    def start_worker(
        self,
        name: str = "one",
        *,
        concurrency: int = 1,
        environment: Mapping[str, str] | None = None,
        program: str = "worker",
        until_ready: bool = True,
    ) -> subprocess.Popen[bytes]:
        """Start a worker, and wait until it takes jobs; `environment` is added to that of the stack."""
        command = [sys.executable, "-m", program, f"--concurrency={concurrency}", f"--hostname={name}@test"]
        process = self.workers[name] = self._start(f"worker-{name}", command, environment)
        if until_ready:
            wait_for(
                lambda: self._running(process) and self.stores.client.exists(keys.WORKER + f"{name}@test"),
                limit_s=READY_S,
                what=f"worker {name}, see {self.log(f'worker-{name}')}",
            )
        return process

    def stop_worker(self, name: str, number: int = signal.SIGTERM) -> int:
        """Signal a worker and wait for its end; returns its exit code."""
        process = self.workers.pop(name)
        process.send_signal(number)
        return process.wait(30)

    def start_api(self, port: int | None = None) -> subprocess.Popen[bytes]:
        """Start the API on a port, a free one by default, and wait until it answers."""
        if port is None:
            with socket.socket() as probe:
                probe.bind(("127.0.0.1", 0))
                port = probe.getsockname()[1]
        process = self._start("api", [sys.executable, "-m", "service", f"--port={port}"])
        self.url = f"http://127.0.0.1:{port}"
        wait_for(
            lambda: self._running(process) and _answers(f"{self.url}/healthz"),
            limit_s=READY_S,
            what=f"the API, see {self.log('api')}",
        )
        return process

    def log(self, name: str) -> Path:
        """Return the file with everything a process wrote."""
        return self.data_dir / f"{name}.log"

    def stop(self) -> None:
        """End everything, politely first."""
        for process in reversed(self._processes):
            if process.poll() is None:
                process.send_signal(signal.SIGTERM)
        for process in self._processes:
            try:
                process.wait(15)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        self.stores.close()
        self.server.stop()

    def _start(
        self, name: str, command: list[str], environment: Mapping[str, str] | None = None
    ) -> subprocess.Popen[bytes]:
        with self.log(name).open("ab") as log:
            process = subprocess.Popen(
                tethered(command),
                cwd=ROOT,
                env={**self.environment, **(environment or {})},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )
        self._processes.append(process)
        return process

    @staticmethod
    def _running(process: subprocess.Popen[bytes]) -> bool:
        assert process.poll() is None, f"ended with {process.returncode}"
        return True


@contextmanager
def started_stack(
    data_dir: Path,
    *,
    workers: int = 1,
    api: bool = True,
    environment: Mapping[str, str] = QUICK,
) -> Iterator[Stack]:
    """Start a server, workers (named "0", "1", …) and the API on a folder, and stop them all at the end."""
    server = EmbeddedServer(data_dir / "server")
    server.start()
    (data_dir / "tmp").mkdir(exist_ok=True)  # what a killed process leaves goes with the test's folder
    variables = {
        "REDIS_URL": server.url,
        "SPHERIFY_DATA_DIR": str(data_dir),
        "TMPDIR": str(data_dir / "tmp"),
        **environment,
    }
    settings = _settings(variables)
    stack = Stack(data_dir, {**os.environ, **variables}, settings, open_stores(settings), server)
    try:
        rebuild(stack.stores.stock)  # of nothing: no test need wait for a process to do it
        for number in range(workers):
            stack.start_worker(str(number))
        if api:
            stack.start_api()
        yield stack
    finally:
        stack.stop()


def _settings(variables: Mapping[str, str]) -> Settings:
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        return Settings()
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _answers(url: str) -> bool:
    try:
        with urllib.request.urlopen(url, timeout=2) as answer:
            return bool(answer.status == 200)
    except (urllib.error.URLError, OSError):
        return False
