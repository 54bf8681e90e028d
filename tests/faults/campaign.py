"""A campaign: jobs are submitted, faults strike, processes are started again, until every promise is kept.

The faults are spread over the jobs, not over time: the k-th strikes once a certain number of jobs is done, so that
a slow machine sees the same campaign as a quick one. Their order and their victims come from a seed.
"""

from __future__ import annotations

import random
import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Final

from spherify.jobs.errors import JobsError, StoreUnavailableError
from spherify.jobs.layout import numbers
from tests.faults.chaos import ChaosProxy
from tests.faults.injectors import Injectors
from tests.faults.ledger import Ledger, Verdict, assert_no_zombies, judge
from tests.faults.logs import Logs
from tests.faults.specimens import Specimen
from tests.stack import Stack, started_stack, wait_for

SHORT: Final = {
    "SPHERIFY_LEASE_S": "3",
    "SPHERIFY_HEARTBEAT_S": "0.5",
    "SPHERIFY_RECONCILE_S": "1",
    "SPHERIFY_ORPHAN_S": "3",
    "SPHERIFY_CANCEL_GRACE_S": "2",
    "SPHERIFY_CHECKPOINT_S": "0.5",
}
OUTSTANDING: Final = 24  # jobs under way at a time
LAST_FAULT: Final = 0.8  # of the jobs: the rest is done in peace, so that the end is an end


@dataclass
class Campaign:
    """What runs, what was promised, and what struck."""

    stack: Stack
    ledger: Ledger
    injectors: Injectors
    logs: Logs
    rng: random.Random
    workers: int
    worker_environment: Mapping[str, str]
    figures: dict[str, float] = field(default_factory=dict)
    exits: list[float] = field(default_factory=list)  # seconds from SIGTERM to the end of each worker so told

    def run(
        self,
        specimens: list[Specimen],
        jobs: int,
        faults: Mapping[str, int],
        *,
        limit_s: float,
        every_s: float = 0.0,
    ) -> Verdict:
        """Submit so many jobs under so many faults of each kind, and judge what has become of them.

        Args:
            specimens: what is submitted, as the seed chooses.
            jobs: how many.
            faults: how many of each kind.
            limit_s: after which it is given up.
            every_s: least time between two jobs, for a campaign that is to last.

        """
        kinds = [kind for kind, times in faults.items() for _ in range(times)]
        self.rng.shuffle(kinds)
        due_at = sorted(self.rng.uniform(0, LAST_FAULT * jobs) for _ in kinds)
        orders = [(f"{self.rng.getrandbits(64):x}", self.rng.choice(specimens)) for _ in range(jobs)]
        earlier = len(self.ledger.acknowledged)
        plan = [(earlier + at, kind) for at, kind in zip(due_at, kinds, strict=True)]
        done: set[str] = set()
        began = monotonic()

        def all_done() -> bool:
            self._tend()
            if plan and len(done) >= plan[0][0] and self.injectors.strike(plan[0][1]):
                plan.pop(0)
            under_way = len(self.ledger.acknowledged) - len(done)
            due = monotonic() - began >= every_s * (jobs - len(orders))
            if (
                orders
                and due
                and under_way < OUTSTANDING
                and self.ledger.submit(orders[-1][1], orders[-1][0])
            ):
                orders.pop()
            done.update(filter(self._is_done, self.ledger.acknowledged.keys() - done))
            under_way_still = orders or plan or self.injectors.later or self.injectors.stopped
            return not under_way_still and len(done) == len(self.ledger.acknowledged)

        try:
            wait_for(all_done, limit_s=limit_s, what=f"{jobs} jobs, see {self.stack.data_dir}")
        finally:
            self._measure(jobs, len(done), monotonic() - began)
        for job_id in self.ledger.acknowledged:  # a job that was done may have lost its record since
            wait_for(partial(self._is_done, job_id), limit_s=60, what=f"the record of {job_id}")
        return judge(self.ledger, self.logs)

    def _tend(self) -> None:
        """Start again what has died, as whoever runs the service has it done."""
        self.injectors.do_what_is_due()
        for number in range(self.workers):
            process = self.stack.workers.get(str(number))
            if process is None or process.poll() is not None:
                if (
                    process is not None
                    and (told := self.injectors.stopped.pop(process.pid, None)) is not None
                ):
                    self.exits.append(monotonic() - told)
                self.stack.start_worker(str(number), environment=self.worker_environment, until_ready=False)

    def _is_done(self, job_id: str) -> bool:
        try:
            return self.stack.stores.jobs.get(job_id).status.done
        except (StoreUnavailableError, JobsError):  # away, or lost and not rebuilt yet
            return False

    def _measure(self, jobs: int, done: int, seconds: float) -> None:
        lines = self.logs.lines()
        starts = Counter(line.job_id for line in lines if line.action == "start")
        kills = [hit for hit in self.injectors.hits if hit.fault.startswith("kill_") and hit.job_id]
        recoveries = [r for hit in kills if (r := self.logs.recovery(str(hit.job_id), hit.at)) is not None]
        flushes = [hit.at for hit in self.injectors.hits if hit.fault == "flush"]
        rebuilds = [took for took in map(self.logs.rebuilt, flushes) if took is not None]
        self.figures = {
            "jobs": jobs,
            "done": done,
            "seconds": round(seconds, 1),
            "runs": sum(starts.values()),
            "run_again": sum(times > 1 for times in starts.values()),
            "resumed": sum(map(self._resumed, starts)),
            "unanswered": self.ledger.unanswered,
            "fenced": self.logs.count("fenced"),
            "found_by_reconciler": sum(line.action.startswith("reconcile-") for line in lines),
            "recoveries": len(recoveries),
            "slowest_found_s": round(max((r.found for r in recoveries), default=0.0), 1),
            "slowest_begun_s": round(max((r.begun for r in recoveries), default=0.0), 1),
            "slowest_recovery_s": round(max((r.ours for r in recoveries), default=0.0), 1),
            "longest_queued_s": round(max((r.queued for r in recoveries), default=0.0), 1),
            "rebuilds": len(rebuilds),
            "slowest_rebuild_s": round(max(rebuilds, default=0.0), 1),
            "slowest_exit_s": round(max(self.exits, default=0.0), 1),
            "most_losses": self.most_losses(),
            **{
                f"hits_{fault}": times
                for fault, times in Counter(h.fault for h in self.injectors.hits).items()
            },
        }

    def most_losses(self) -> int:
        """Return how often the unluckiest job lost its worker, as far as the records know."""
        losses = []
        for job_id in self.ledger.acknowledged:
            try:
                losses.append(self.stack.stores.jobs.get(job_id).losses)
            except JobsError:  # away, or lost and not rebuilt yet
                continue
        return max(losses, default=0)

    def _resumed(self, job_id: str) -> bool:
        """Whether a later attempt went on from what an earlier one had left."""
        try:
            job = self.stack.stores.jobs.get(job_id)
        except (StoreUnavailableError, JobsError):
            return False
        return len({numbers(snapshot.key)[0] for snapshot in job.snapshots}) > 1


def say(sentence: str) -> None:
    """Tell whoever watches a drill."""
    sys.stderr.write(f"{sentence}\n")


@contextmanager
def campaign(
    folder: Path,
    seed: int,
    *,
    workers: int = 2,
    environment: Mapping[str, str] = SHORT,
    through_proxy: bool = False,
) -> Iterator[Campaign]:
    """Start a stack for one campaign; at the end nothing of it may be left.

    Args:
        folder: for everything.
        seed: of the order of the faults, and of whom they hit.
        workers: kept running.
        environment: settings of all programs.
        through_proxy: lets the workers reach the server through a proxy, for the fault ``half_open``.

    """
    rng = random.Random(seed)
    with ExitStack() as exits:
        stack = exits.enter_context(started_stack(folder, workers=0, environment=environment))
        proxy = exits.enter_context(ChaosProxy(stack.server.url)) if through_proxy else None
        logs = Logs(folder)
        ledger = Ledger(stack.url)
        through = {"REDIS_URL": proxy.url} if proxy is not None else {}
        injectors = Injectors(stack, logs, rng, proxy)
        one = Campaign(stack, ledger, injectors, logs, rng, workers, through)
        try:
            yield one
        finally:
            say(f"campaign {seed}: {one.figures}")
            ledger.http.close()
        assert_no_zombies(stack)
