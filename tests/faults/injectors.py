"""Faults, each a small object with one method; what they hit is chosen by the campaign's seed."""

from __future__ import annotations

import os
import random
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from spherify.jobs.errors import StoreUnavailableError
from spherify.jobs.model import Job, JobStatus
from tests.faults.chaos import ChaosProxy
from tests.faults.logs import Logs
from tests.processes import below
from tests.stack import Stack

DOWN_S: Final = 1.0  # how long a killed server stays away


@dataclass
class Hit:
    """A fault that struck: what, whom, and which job was being worked on, at seconds since the epoch."""

    fault: str
    pid: int
    job_id: str | None
    at: float


@dataclass
class Injectors:
    """Strikes at a started stack."""

    stack: Stack
    logs: Logs
    rng: random.Random
    proxy: ChaosProxy | None = None
    spared: str = ""  # name of a worker that nothing strikes
    hits: list[Hit] = field(default_factory=list)
    stopped: dict[int, float] = field(default_factory=dict)  # process told to end → when, by time.monotonic
    later: list[tuple[float, Callable[[], object]]] = field(default_factory=list)

    def strike(self, fault: str) -> bool:
        """Do it; False if there is nothing to hit at this moment."""
        struck: bool = getattr(self, f"_{fault}")()
        return struck

    def do_what_is_due(self) -> None:
        """Carry out the second halves: starting a server again, waking a worker."""
        now = time.monotonic()
        due = [action for at, action in self.later if at <= now]
        self.later = [(at, action) for at, action in self.later if at > now]
        for action in due:
            action()

    def _kill_worker(self) -> bool:
        return self._hit_worker("kill_worker", signal.SIGKILL)

    def _stop_worker(self) -> bool:
        return self._hit_worker("stop_worker", signal.SIGTERM)

    def _hit_worker(self, fault: str, number: int) -> bool:
        if (job := self._a_running_job()) is None or (name := _worker_of(job)) not in self.stack.workers:
            return False
        process = self.stack.workers[name]
        if number == signal.SIGTERM and process.pid in self.stopped:
            return False  # it is on its way
        if process.poll() is None:
            self._note(fault, process.pid, job)
            process.send_signal(number)
            if number == signal.SIGTERM:
                self.stopped[process.pid] = time.monotonic()
        return True

    def _kill_child(self) -> bool:
        """Kill the pool process that supervises a job, as a lack of memory would."""
        if (job := self._a_running_job()) is None or (name := _worker_of(job)) not in self.stack.workers:
            return False
        main = self.stack.workers[name].pid
        children = [
            seen for seen in below(main, "-m worker") if seen.parent == main and "runner" not in seen.command
        ]
        if not children:
            return False
        return self._kill("kill_child", children[0].pid, job)

    def _kill_runner(self) -> bool:
        job = self._a_running_job()
        runner = None if job is None else self.logs.runner_of(job.id)
        return False if job is None or runner is None else self._kill("kill_runner", runner, job)

    def _freeze_worker(self) -> bool:
        """Stop a whole worker for longer than its lease, then let it go on as if nothing had been."""
        if (job := self._a_running_job()) is None or (name := _worker_of(job)) not in self.stack.workers:
            return False
        main = self.stack.workers[name]
        family = [main.pid, *(seen.pid for seen in below(main.pid))]
        self._note("freeze_worker", main.pid, job)
        for pid in family:
            _signal(pid, signal.SIGSTOP)
        thaw_at = time.monotonic() + 2 * self.stack.settings.lease_s
        self.later.append((thaw_at, lambda: [_signal(pid, signal.SIGCONT) for pid in family]))
        return True

    def _kill_broker(self) -> bool:
        return self._hit_broker("kill_broker", signal.SIGKILL)

    def _stop_broker(self) -> bool:
        return self._hit_broker("stop_broker", signal.SIGTERM)

    def _hit_broker(self, fault: str, number: int) -> bool:
        if (pid := self.stack.server.pid) is None:
            return False
        self._note(fault, pid, None)
        os.kill(pid, number)
        self.later.append((time.monotonic() + DOWN_S, self.stack.server.start))
        return True

    def _half_open(self) -> bool:
        """Let the workers' connections fall silent without an end, as a dropped address translation does."""
        if self.proxy is None or self.proxy.half_open() == 0:
            return False
        self._note("half_open", 0, None)
        return True

    def _flush(self) -> bool:
        """Lose every key of the server."""
        if self.stack.server.pid is None:
            return False
        self._note("flush", self.stack.server.pid, None)
        self.stack.stores.client.flushall()
        return True

    def _a_running_job(self) -> Job | None:
        """Choose a victim among the jobs that may lose one more worker: what happens to poison is another test."""
        try:
            running = self.stack.stores.jobs.find(status=JobStatus.RUNNING, limit=10).items
        except StoreUnavailableError:
            return None
        spared = {job.worker for job in running if job.losses >= self.stack.settings.max_losses}
        victims = [job for job in running if job.worker not in spared and _worker_of(job) != self.spared]
        return self.rng.choice(victims) if victims else None

    def _kill(self, fault: str, pid: int, job: Job) -> bool:
        if not _signal(pid, signal.SIGKILL):
            return False
        self._note(fault, pid, job)
        return True

    def _note(self, fault: str, pid: int, job: Job | None) -> None:
        self.hits.append(Hit(fault, pid, None if job is None else job.id, time.time()))


def _worker_of(job: Job) -> str:
    return (job.worker or "").partition("@")[0]


def _signal(pid: int, number: int) -> bool:
    try:
        os.kill(pid, number)
    except ProcessLookupError:  # it was quicker
        return False
    return True
