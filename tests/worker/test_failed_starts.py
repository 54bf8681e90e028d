"""A worker that cannot start runners: whose fault it is, and what becomes of its jobs."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable

import pytest

import worker.processes
import worker.supervisor
from spherify.jobs.model import JobStatus
from spherify.settings import Settings
from spherify.stores.connect import Stores
from tests.worker.supervised import Watched, endless
from worker.runners import Runner
from worker.supervisor import FAILED_STARTS, Supervisor


def no_process(_: pytest.MonkeyPatch) -> type[Watched]:
    class Refused(Watched):
        def take(self) -> Runner:
            raise BlockingIOError

    return Refused


def no_fork_server(patch: pytest.MonkeyPatch) -> type[Watched]:
    def ends_at_once(_module: str, stdin: int, stdout: int | None = None) -> subprocess.Popen[bytes]:
        return subprocess.Popen([sys.executable, "-c", "raise SystemExit(1)"], stdin=stdin, stdout=stdout)

    patch.setattr(worker.processes, "_python", ends_at_once)
    return Watched


def frozen_fork_server(patch: pytest.MonkeyPatch) -> type[Watched]:
    class Frozen(Watched):
        def prepare(self) -> None:
            return

        def take(self) -> Runner:
            super().prepare()
            assert self.server_pid is not None
            os.kill(self.server_pid, signal.SIGSTOP)
            return super().take()

    patch.setattr(worker.supervisor, "START_S", 0.5)
    return Frozen


@pytest.mark.parametrize("how", [no_process, no_fork_server, frozen_fork_server])
def test_a_worker_that_cannot_start_runners_gives_up_and_no_job_pays_for_it(
    stores: Stores,
    settings: Settings,
    monkeypatch: pytest.MonkeyPatch,
    how: Callable[[pytest.MonkeyPatch], type[Watched]],
) -> None:
    given_up: list[int] = []
    job_id = endless(stores)
    with monkeypatch.context() as patch:
        runners = how(patch)()
        boss = Supervisor(
            stores.jobs, stores.blobs, stores.queue, settings, runners, give_up=lambda: given_up.append(1)
        )
        for attempt in range(1, FAILED_STARTS + 1):
            assert given_up == []
            boss.run(job_id, "w")
            job = stores.jobs.get(job_id)
            assert (job.status, job.losses, job.attempt) == (JobStatus.ACCEPTED, 0, attempt)
        runners.close()
    assert given_up == [1]
