"""Runners without a supervisor, forked and spawned: several from one server, and what is left when something dies."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from spherify.jobs import layout
from spherify.jobs.codec import dump_record
from spherify.stores.arrays import dump_arrays
from spherify.stores.blobs import FolderBlobStore
from tests.jobs.examples import ENDLESS, job_spec, stone
from tests.stack import ROOT, wait_for
from tests.worker.observation import is_running, parent_of
from worker.orders import CANCEL_SIGNAL, Order
from worker.processes import ForkServer, Process, _Forked, can_fork, spawn
from worker.runners import Runner, Runners

AMPLE = 8 << 30
forking = pytest.mark.skipif(not can_fork(), reason="this system has no process handles")


@pytest.fixture
def blobs(tmp_path: Path) -> FolderBlobStore:
    return FolderBlobStore(tmp_path)


class Remembered(Runners):
    """Runners of which all that were handed out are seen off."""

    def take(self) -> Runner:
        self.taken = [*getattr(self, "taken", []), super().take()]
        return self.taken[-1]

    def see_off(self) -> None:
        for runner in self.taken:
            runner.kill()
            runner.wait(5)
        self.close()


@pytest.fixture(params=[pytest.param(True, id="forked", marks=forking), pytest.param(False, id="spawned")])
def runners(request: pytest.FixtureRequest) -> Iterator[Runners]:
    runners = Remembered(forked=request.param)
    yield runners
    runners.see_off()


@pytest.fixture
def forked() -> Iterator[Runners]:
    if not can_fork():
        pytest.skip("this system has no process handles")
    runners = Remembered(forked=True)
    yield runners
    runners.see_off()


def order(
    blobs: FolderBlobStore, *, vertices: int = 60, memory_bytes: int = AMPLE, **changes: object
) -> Order:
    """Return the order of a new job, with its files in place."""
    mesh = stone(vertices)
    mesh_id = f"mesh_{vertices:026d}"
    spec = job_spec(mesh_id=mesh_id, **changes)  # type: ignore[arg-type]
    if not (blobs.root / layout.mesh_arrays(mesh_id)).exists():
        blobs.create(
            layout.mesh_arrays(mesh_id), dump_arrays({"vertices": mesh.vertices, "faces": mesh.faces})
        )
    blobs.create(layout.spec(spec.id), dump_record(spec).encode())
    return Order(spec.id, 1, str(blobs.root), memory_bytes, deadline_s=60, limit_s=60, checkpoint_s=60)


def events_of(runner: Runner) -> list[dict[str, Any]]:
    """Return all that a runner says, till it ends."""
    heard: list[dict[str, Any]] = []
    # Where the server has only just been started, it imports everything first: long on a machine that is very busy.
    wait_for(lambda: heard.extend(runner.events(0.1)) or runner.ended, limit_s=90, what="the end of a runner")
    return heard


def ready(runner: Runner) -> Runner:
    """Wait until a runner is there, and its server has told who it is: killed before that, the server ends too."""
    wait_for(lambda: runner.events(0.1))
    assert is_running(runner.pid)
    return runner


def files_of(pid: int) -> set[str]:
    return {entry.name for entry in Path(f"/proc/{pid}/fd").iterdir()}


def test_each_job_has_a_process_of_its_own(runners: Runners, blobs: FolderBlobStore) -> None:
    runners.prepare()
    pids = set()
    for _ in range(2):
        runner = runners.take()
        runner.start(order(blobs))
        first, *_, last = events_of(runner)
        assert first == {"event": "ready", "pid": runner.pid}
        assert (last["event"], last["outcome"]["status"]) == ("end", "successful")
        assert runner.wait(5) == 0
        assert not runner.alive
        pids.add(runner.pid)
    assert len(pids) == 2


def test_two_forked_at_once_hear_signals_apart(forked: Runners, blobs: FolderBlobStore) -> None:
    one, other = forked.take(), forked.take()
    for runner in (one, other):
        runner.start(order(blobs, **ENDLESS))
        ready(runner)
        assert runner.alive
    assert parent_of(one.pid) == parent_of(other.pid) == forked.server_pid
    one.tell(CANCEL_SIGNAL)
    assert events_of(one)[-1]["outcome"]["status"] == "cancelled"
    assert one.wait(5) == 0
    assert other.alive
    other.kill()
    assert all(event["event"] != "end" for event in events_of(other))
    assert other.wait(5) == -signal.SIGKILL


def test_a_signal_sent_before_there_is_a_process_is_heard(forked: Runners, blobs: FolderBlobStore) -> None:
    runner = forked.take()  # the server has only just been started
    runner.tell(CANCEL_SIGNAL)
    runner.start(order(blobs, **ENDLESS))
    assert events_of(runner)[-1]["outcome"]["status"] == "cancelled"
    assert runner.wait(5) == 0


@forking
def test_a_signal_is_heard_by_a_runner_that_was_ready_before_its_server_told_of_it(
    blobs: FolderBlobStore,
) -> None:
    fate, servers_end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    child: list[Process] = []

    class ToldLate(_Forked):
        """A runner of which the server tells when somebody waits for it, and not before."""

        def _hear(self, timeout_s: float | None) -> bool:
            if timeout_s and self._handle < 0:
                handle = os.pidfd_open(child[0].pid)
                socket.send_fds(servers_end, [str(child[0].pid).encode()], [handle])
                os.close(handle)
            return super()._hear(timeout_s)

    server = ForkServer()

    def start(order: int, events: int) -> Process:
        child.append(spawn(order, events))
        return ToldLate(server, fate)

    with servers_end:
        runner = Runner(start)
        runner.tell(CANCEL_SIGNAL)
        runner.start(order(blobs, **ENDLESS))
        assert events_of(runner)[-1]["outcome"]["status"] == "cancelled"
        servers_end.send(str(child[0].wait(5)).encode())
    assert runner.wait(5) == 0
    server.close()


def test_one_killed_before_there_is_a_process_never_is(forked: Runners, blobs: FolderBlobStore) -> None:
    runner = forked.take()
    server = forked.server_pid
    runner.start(order(blobs))
    runner.kill()
    assert runner.wait(5) == -signal.SIGKILL
    after = ready(forked.take())
    assert forked.server_pid != server
    assert after.alive


def test_what_a_runner_has_of_the_server(forked: Runners) -> None:
    runner = ready(forked.take())
    assert forked.server_pid is not None
    assert len(list(Path(f"/proc/{forked.server_pid}/task").iterdir())) == 1  # else it could not be forked
    assert files_of(runner.pid) == {"0", "1", "2", "3"}
    assert Path(f"/proc/{runner.pid}/oom_score_adj").read_text().strip() == "1000"
    status = Path(f"/proc/{runner.pid}/status").read_text()
    blocked = next(line for line in status.splitlines() if line.startswith("SigBlk:"))
    assert int(blocked.split()[1], 16) == 0


def test_a_server_that_dies_takes_its_runner_along_and_is_replaced(
    forked: Runners, blobs: FolderBlobStore
) -> None:
    runner = forked.take()
    runner.start(order(blobs, **ENDLESS))
    ready(runner)
    server = forked.server_pid
    assert server is not None
    os.kill(server, signal.SIGKILL)
    assert all(event["event"] != "end" for event in events_of(runner))
    assert runner.wait(5) == -signal.SIGKILL
    wait_for(lambda: not is_running(runner.pid))
    runner = forked.take()
    runner.start(order(blobs))
    assert events_of(runner)[-1]["event"] == "end"
    assert forked.server_pid != server


@pytest.mark.parametrize("begun", [True, False], ids=["computing", "not-there-yet"])
def test_a_server_that_stands_still_does_not_keep_anybody_waiting(
    forked: Runners, blobs: FolderBlobStore, begun: bool
) -> None:
    ready(forked.take()).kill()
    server = forked.server_pid
    assert server is not None
    runner = forked.take()
    runner.start(order(blobs, **ENDLESS))
    if begun:
        ready(runner)
    else:
        runner.kill()
        runner = forked.take()
        server = forked.server_pid
        assert server is not None
    os.kill(server, signal.SIGSTOP)
    runner.kill()
    assert runner.wait(10) == -signal.SIGKILL
    wait_for(lambda: not is_running(server))
    after = forked.take()
    after.start(order(blobs))
    assert events_of(after)[-1]["event"] == "end"


def test_a_limit_of_memory_is_that_of_one_job(forked: Runners, blobs: FolderBlobStore) -> None:
    runner = ready(forked.take())
    size = int(Path(f"/proc/{runner.pid}/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    runner.start(order(blobs, vertices=40_000, memory_bytes=size + (16 << 20)))
    assert events_of(runner)[-1]["code"] == "out-of-memory"
    assert runner.wait(5) == 0
    after = forked.take()
    after.start(order(blobs, vertices=40_000, iterations=1))
    assert events_of(after)[-1]["outcome"]["status"] == "successful"


def test_nothing_is_left_open_after_fifty_runners(forked: Runners, blobs: FolderBlobStore) -> None:
    def one() -> None:
        runner = forked.take()
        runner.start(order(blobs, iterations=0))
        assert events_of(runner)[-1]["event"] == "end"
        assert runner.wait(5) == 0

    one()
    assert forked.server_pid is not None
    ours, its = files_of(os.getpid()), files_of(forked.server_pid)
    for _ in range(50):
        one()
    assert files_of(os.getpid()) == ours
    # It closes the files of one after it has told its end: of the first they may have been there still.
    wait_for(lambda: files_of(forked.server_pid or 0) <= its)
    assert Path(f"/proc/{forked.server_pid}/task/{forked.server_pid}/children").read_text() == ""


def test_a_runner_nobody_has_a_job_for_goes(forked: Runners) -> None:
    runner = ready(forked.take())
    runner._stdin.close()
    assert runner.wait(5) == 0


SUPERVISOR = """
import json, time
from worker.runners import Runners
runners = Runners()
runner = runners.take()
while not runner.events(0.1):
    pass
print(json.dumps([runners.server_pid, runner.pid]), flush=True)
time.sleep(600)
"""


@forking
def test_server_and_runner_end_with_a_supervisor_that_is_killed() -> None:
    supervisor = subprocess.Popen([sys.executable, "-c", SUPERVISOR], cwd=ROOT, stdout=subprocess.PIPE)
    with supervisor:
        assert supervisor.stdout is not None
        family = json.loads(supervisor.stdout.readline())
        assert all(map(is_running, family))
        supervisor.kill()
    wait_for(lambda: not any(map(is_running, family)))
