"""A delivery that is none of ours costs one question to the server: no file is looked at, and no process is started."""

from __future__ import annotations

import pytest

from spherify.jobs.model import JobStatus, Outcome
from spherify.settings import Settings
from spherify.stores.blobs import FolderBlobStore
from spherify.stores.connect import Stores
from tests.worker.supervised import endless
from worker.runners import Runner, Runners
from worker.supervisor import Supervisor


class Untouched(FolderBlobStore):
    def __getattribute__(self, name: str) -> object:
        raise AssertionError(f"{name} is asked of the files")


class Unwanted(Runners):
    def take(self) -> Runner:
        raise AssertionError("a runner is asked for")


@pytest.mark.parametrize("ended", [False, True], ids=["held-by-another", "ended"])
def test_a_message_that_comes_again_is_dropped_with_one_question(
    stores: Stores, settings: Settings, ended: bool
) -> None:
    job_id = endless(stores)
    token = stores.jobs.claim(job_id, "another").token
    if ended:
        stores.jobs.commit(job_id, token, Outcome(JobStatus.FAILED))
    before = stores.jobs.get(job_id)
    boss = Supervisor(stores.jobs, Untouched(stores.blobs.root), stores.queue, settings, Unwanted())
    boss.run(job_id, "w")
    asked = questions(stores)
    for _ in range(10):
        boss.run(job_id, "w")
    assert questions(stores) - asked == 10
    assert stores.jobs.get(job_id) == before


def questions(stores: Stores) -> int:
    """Return how many scripts were run: all that a supervisor asks of the server is one."""
    return int(stores.client.info("commandstats")["cmdstat_evalsha"]["calls"])
