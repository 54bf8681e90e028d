"""The whole service on this machine: server, API and workers as children of this process, gone when it goes."""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import socket
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from ipaddress import ip_address
from pathlib import Path
from types import TracebackType
from typing import Final, Self

import httpx

from spherify.cli.programs import Program, Say, describe
from spherify.settings import Settings
from spherify.stores.embedded import EmbeddedServer

READY_S: Final = 60.0
HANDING_ON_S: Final = 8.0  # beyond the grace time, in which a worker hands its job on, or gives up at last
LOOK_S: Final = 0.1
_EVERYWHERE: Final = {"0.0.0.0", "::", ""}  # noqa: S104 (recognised, not bound)


class StackError(Exception):
    """The stack cannot be started; the message says why and what to do."""


@dataclass(frozen=True, slots=True)
class Address:
    """Where the API listens; port 0 is any free one."""

    host: str
    port: int


DEFAULT: Final = Address("127.0.0.1", 8000)


class Stack:
    """Server, API and workers; a context manager. Start it from a thread that lives as long as it shall."""

    def __init__(
        self, address: Address, data_dir: Path, workers: int, say: Say, *, redis_url: str | None
    ) -> None:
        self.data_dir = data_dir.resolve()
        self._redis_url = redis_url  # None: a server of our own
        self._host = address.host
        self._listener = _listen(address)
        self._workers = workers
        self._say = say
        settings = Settings()
        self._stop_s = settings.cancel_grace_s + HANDING_ON_S
        self._reserve = settings.min_free_bytes
        self._server: EmbeddedServer | None = None
        self._programs: list[Program] = []

    @property
    def port(self) -> int:
        """Where the API listens."""
        return int(self._listener.getsockname()[1])

    @property
    def on_loopback(self) -> bool:
        """Whether only programs of this machine can reach the API."""
        return ip_address(self._listener.getsockname()[0]).is_loopback

    @property
    def url(self) -> str:
        """Where a browser or curl on this machine finds the API."""
        host = "localhost" if self._host in _EVERYWHERE else self._host
        return f"http://[{host}]:{self.port}" if ":" in host else f"http://{host}:{self.port}"

    @property
    def is_full(self) -> bool:
        """Whether the data folder has no room for an upload; all else goes on, deleting in particular."""
        return shutil.disk_usage(self.data_dir).free < self._reserve

    def start(self, leave: Callable[[], bool] = lambda: False) -> None:
        """Start everything and return when the API is ready, all but for room on the disk, or when `leave` says so.

        Raises:
            StackError: something ended while starting, or was not ready in time.
            EmbeddedServerError: so for the server.

        """
        self.data_dir.mkdir(parents=True, exist_ok=True)
        environment = {**os.environ, "SPHERIFY_DATA_DIR": str(self.data_dir), "PYTHONUNBUFFERED": "1"}
        environment["PYTHONSAFEPATH"] = "1"  # a folder `worker` where the user stands is none of ours
        environment["REDIS_URL"] = self._redis_url or self._start_server()
        fd = self._listener.fileno()
        api = [sys.executable, "-m", "service", f"--fd={fd}", f"--host={self._host}"]
        self._programs = [Program("api", api, environment, self._say, folder=self.data_dir, keep_open=[fd])]
        for number in range(1, self._workers + 1):
            name = f"worker-{number}"
            command = [
                sys.executable,
                "-m",
                "worker",
                "--concurrency=1",
                f"--hostname={name}-{os.getpid()}@{socket.gethostname()}",  # a server may be shared
            ]
            self._programs.append(Program(name, command, environment, self._say, folder=self.data_dir))
        for program in self._programs:
            program.start()
        self._await_ready(leave)

    def tend(self) -> None:
        """Start again what has ended; call it every moment. Raises `EmbeddedServerError`: the server cannot be."""
        if self._server is not None and not self._server.alive:
            self._say("server", "ended; starting it again")
            self._server.start()
        for program in self._programs:
            program.tend()

    def stop(self) -> None:
        """Stop everything: the API takes no more, workers hand their jobs on, the server last."""
        for program in self._programs:
            program.terminate()
        deadline = time.monotonic() + self._stop_s
        for program in self._programs:
            program.reap(deadline)
        self._programs = []
        if self._server is not None:
            self._server.stop()
        self._listener.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def _start_server(self) -> str:
        self._server = EmbeddedServer(self.data_dir / "server")
        self._server.start()
        return self._server.url

    def _await_ready(self, leave: Callable[[], bool]) -> None:
        deadline, state = time.monotonic() + READY_S, ""
        with httpx.Client(base_url=self.url, timeout=2.0, trust_env=False) as http:
            while not leave():
                for program in self._programs:
                    if (code := program.exit_code()) is not None:
                        raise StackError(
                            f"the {program.name} ended with {describe(code)} while starting{_last(program)}"
                        )
                with contextlib.suppress(httpx.TransportError):  # not yet
                    answer = http.get("/readyz")
                    if answer.is_success:
                        return
                    problem = answer.json()
                    missing = [name for name, check in problem.get("checks", {}).items() if check != "ok"]
                    if missing == ["files"] and self.is_full:
                        return
                    state = f": {problem['detail']}"
                if time.monotonic() > deadline:
                    raise StackError(
                        f"the API is not ready after {READY_S:.0f} s{state}{_last(self._programs[0])}"
                    )
                time.sleep(LOOK_S)


def _last(program: Program) -> str:
    return "".join(f"\n  {line}" for line in program.last_lines)


def _listen(address: Address) -> socket.socket:
    """Return a listening socket, held by this process for good: the API may be restarted behind it."""
    host, port = address.host, address.port
    try:
        family, kind, protocol, _, where = socket.getaddrinfo(
            host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listener = socket.socket(family, kind, protocol)
        try:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind(where)
            listener.listen(1024)
        except OSError:
            listener.close()
            raise
    except OSError as e:
        if e.errno == errno.EADDRINUSE:
            raise StackError(
                f"port {port} on {host} is in use by another program: choose another with --port {port + 1}, "
                f"or see who has it with `ss -ltnp sport = :{port}`"
            ) from e
        if e.errno == errno.EACCES:
            raise StackError(f"port {port} needs privileges: choose one from 1024 on with --port 8000") from e
        raise StackError(f"cannot listen on {host}, port {port}: {e.strerror}") from e
    return listener
