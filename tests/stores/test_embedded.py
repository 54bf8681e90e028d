from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from spherify.stores import embedded
from spherify.stores.client import connect
from spherify.stores.embedded import (
    DataFolderBusyError,
    EmbeddedServer,
    EmbeddedServerError,
    ServerNotFoundError,
    find_program,
)
from tests.stack import wait_for

LAUNCHER = """
import sys, time
from pathlib import Path
from spherify.stores.embedded import EmbeddedServer
server = EmbeddedServer(Path(sys.argv[1]))
server.start()
print(server.pid, flush=True)
sys.stdin.read()
"""


def alive(pid: int) -> bool:
    """Whether a thread of a process is left, which holds its files: the first one may be gone before the others."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text("ascii").rpartition(")")[2].split()[0]
        threads = len(list(Path(f"/proc/{pid}/task").iterdir()))
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state != "Z" or threads > 1  # a zombie is reaped by whoever adopted it, in its own time


def write(server: EmbeddedServer, value: str) -> None:
    client = connect(server.url)
    client.set("key", value)
    client.close()


def read(server: EmbeddedServer) -> object:
    client = connect(server.url)
    value = client.get("key")
    client.close()
    return value


def test_data_is_kept_between_runs(tmp_path: Path) -> None:
    with EmbeddedServer(tmp_path) as server:
        write(server, "kept")
    assert not server.alive
    with EmbeddedServer(tmp_path) as server:
        assert read(server) == "kept"


def test_an_acknowledged_write_survives_kill_minus_9_and_the_server_starts_again(tmp_path: Path) -> None:
    with EmbeddedServer(tmp_path) as server:
        write(server, "acknowledged")
        pid = server.pid
        assert pid is not None
        os.kill(pid, signal.SIGKILL)
        wait_for(lambda: not server.alive)
        server.start()
        assert server.pid != pid
        assert read(server) == "acknowledged"


def test_one_folder_has_one_server(tmp_path: Path) -> None:
    with (
        EmbeddedServer(tmp_path) as server,
        pytest.raises(DataFolderBusyError, match=rf"process {os.getpid()}\) runs a server on .*DATA_DIR"),
    ):
        EmbeddedServer(tmp_path).start()
    assert not server.alive
    with EmbeddedServer(tmp_path) as again:
        assert again.alive


def test_a_launcher_that_is_killed_leaves_no_server_behind(tmp_path: Path) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", LAUNCHER, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as launcher:
        assert launcher.stdout is not None
        pid = int(launcher.stdout.readline())
        assert alive(pid)
        with pytest.raises(DataFolderBusyError, match=f"process {launcher.pid}"):
            EmbeddedServer(tmp_path).start()
        launcher.kill()
        wait_for(lambda: not alive(pid), what=f"the end of server {pid}")
    with EmbeddedServer(tmp_path) as server:
        assert server.alive


def test_only_its_owner_reaches_it(tmp_path: Path) -> None:
    with EmbeddedServer(tmp_path / "data") as server:
        assert (tmp_path / "data").stat().st_mode & 0o077 == 0
        assert (tmp_path / "data" / "server.sock").stat().st_mode & 0o077 == 0
        client = connect(server.url)
        assert client.config_get("port") == {"port": "0"}
        assert client.config_get("appendfsync") == {"appendfsync": "always"}
        client.close()


def test_a_folder_deeper_than_a_socket_path_may_be(tmp_path: Path) -> None:
    deep = tmp_path / ("a" * 60) / ("b c" * 20)
    with EmbeddedServer(deep) as server:
        assert str(deep) not in server.url
        write(server, "deep")
        assert read(server) == "deep"
        private = server._socket().parent
        assert private.stat().st_mode & 0o077 == 0
    assert not private.exists()


def test_quotes_in_the_folders_name(tmp_path: Path) -> None:
    with EmbeddedServer(tmp_path / 'a "b" \\c') as server:
        write(server, "quoted")
        assert read(server) == "quoted"


def test_a_server_that_cannot_start_says_why(tmp_path: Path) -> None:
    folder = tmp_path / "appendonlydir"
    folder.mkdir()
    (folder / "appendonly.aof.manifest").write_text("this is no manifest\n")
    with pytest.raises(EmbeddedServerError, match="ended while starting"):
        EmbeddedServer(tmp_path).start()
    (folder / "appendonly.aof.manifest").unlink()
    with EmbeddedServer(tmp_path) as server:  # the lock was let go
        assert server.alive


def test_no_program_at_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(embedded.importlib.util, "find_spec", lambda _: None)
    monkeypatch.setenv("PATH", "/nonexistent")
    with pytest.raises(ServerNotFoundError, match="REDIS_URL"):
        find_program()


def test_a_server_on_the_path_is_the_fallback(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    ours = find_program()
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "redis-server").symlink_to(ours)
    monkeypatch.setattr(embedded.importlib.util, "find_spec", lambda _: None)
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    assert find_program() == tmp_path / "bin" / "redis-server"
    with EmbeddedServer(tmp_path / "data") as server:
        assert server.alive
