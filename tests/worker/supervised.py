"""What tests of a supervisor in this process need: runners that can be watched, and a job that does not end."""

from __future__ import annotations

import signal

from spherify.jobs.submit import submit
from spherify.stores.connect import Stores
from tests.jobs.examples import ENDLESS, job_spec
from tests.stack import wait_for
from worker.runners import Runner, Runners


class Watched(Runners):
    """Runners of which the last one handed out is known."""

    last: Runner

    def take(self) -> Runner:
        self.last = super().take()
        return self.last

    def warm_up(self) -> None:
        """Wait for the fork server, so that a time limit is not spent on its imports."""
        first = super().take()
        wait_for(lambda: first.events(0.1))
        first.kill()
        assert first.wait(5) == -signal.SIGKILL


def endless(stores: Stores) -> str:
    return submit(stores.jobs, stores.blobs, stores.queue, job_spec(**ENDLESS, snapshots="2")).id
