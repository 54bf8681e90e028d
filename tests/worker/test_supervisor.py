"""A supervisor in this process, with a real server and real runners: what it does when something does not answer."""

from __future__ import annotations

import dataclasses
import logging
import os
import signal
from collections.abc import Callable, Iterable

import pytest

from spherify.jobs import layout
from spherify.jobs.cancel import cancel
from spherify.jobs.delete import delete_job
from spherify.jobs.errors import StorageFullError, StoreUnavailableError
from spherify.jobs.model import Job, JobError, JobStatus, Outcome
from spherify.jobs.ports import BlobStat, CancelOutcome, Claim
from spherify.jobs.reconcile import Reconciler
from spherify.jobs.results import read_result
from spherify.jobs.settle import settle
from spherify.jobs.submit import submit
from spherify.settings import Settings
from spherify.stores import keys
from spherify.stores.blobs import FolderBlobStore
from spherify.stores.connect import Stores
from spherify.stores.embedded import EmbeddedServer
from spherify.stores.redis_jobs import RedisJobStore
from tests.jobs.examples import job_spec
from tests.worker.supervised import Watched, endless
from worker.runners import Runner
from worker.supervisor import Supervisor


def supervise(
    stores: Stores,
    settings: Settings,
    runners: Watched,
    job_id: str,
    *,
    each_tick: Callable[[], bool] = lambda: False,
    blobs: FolderBlobStore | None = None,
) -> Job:
    """Take a job to the end of one delivery; `each_tick` also says whether the worker is to stop."""
    boss = Supervisor(stores.jobs, blobs or stores.blobs, stores.queue, settings, runners, stopping=each_tick)
    boss.run(job_id, "w")
    return stores.jobs.get(job_id)


def when_computing(stores: Stores, job_id: str, do: Callable[[], object]) -> Callable[[], bool]:
    """Return what does something once, as soon as a snapshot besides the first is known."""
    done: list[bool] = []

    def tick() -> bool:
        if not done and len(stores.jobs.get(job_id).snapshots) > 1:
            done.append(True)
            do()
        return False

    return tick


def test_a_runner_that_is_deaf_to_a_cancel_is_killed(
    stores: Stores, settings: Settings, runners: Watched
) -> None:
    job_id = endless(stores)

    def deafen() -> None:
        os.kill(runners.last.pid, signal.SIGSTOP)
        assert cancel(stores.jobs, stores.blobs, job_id) is CancelOutcome.CANCELLING

    tick = when_computing(stores, job_id, deafen)
    job = supervise(stores, settings, runners, job_id, each_tick=tick)
    assert (job.status, job.stop_reason, job.losses) == (JobStatus.CANCELLED, "cancelled", 0)
    assert job.best_iteration in {snapshot.iteration for snapshot in job.snapshots}
    assert not runners.last.alive
    result = read_result(stores.blobs, job_id)
    assert result is not None
    assert result.outcome.status is JobStatus.CANCELLED
    assert tuple(result.snapshots) == job.snapshots
    assert result.progress is not None
    assert result.progress == job.progress
    assert result.progress.iteration >= job.snapshots[-1].iteration


def test_a_runner_that_outruns_its_limit_fails_with_the_last_state_it_kept(
    stores: Stores, settings: Settings, runners: Watched
) -> None:
    job_id = endless(stores)
    stopped: list[int] = []

    def tick() -> bool:
        if not stopped and len(stores.jobs.get(job_id).snapshots) > 1:
            stopped.append(runners.last.pid)
            os.kill(runners.last.pid, signal.SIGSTOP)
        return False

    runners.warm_up()
    brief = settings.model_copy(update={"wall_limit_s": 3.0})
    job = supervise(stores, brief, runners, job_id, each_tick=tick)
    assert stopped
    assert (job.status, job.stop_reason, job.losses) == (JobStatus.FAILED, "deadline", 0)
    assert job.error is not None
    assert job.error.code == "deadline"
    assert job.error.detail.startswith(
        "the limit of 3 s, all attempts together, was up, and the runner was stopped"
    )
    assert job.result_iteration == job.snapshots[-1].iteration == 2
    assert not runners.last.alive


def test_a_worker_that_stops_hands_on_even_with_a_deaf_runner(
    stores: Stores, settings: Settings, runners: Watched
) -> None:
    job_id = endless(stores)
    stopping: list[bool] = []

    def deafen() -> None:
        os.kill(runners.last.pid, signal.SIGSTOP)
        stopping.append(True)

    tick = when_computing(stores, job_id, deafen)
    job = supervise(stores, settings, runners, job_id, each_tick=lambda: tick() or bool(stopping))
    assert (job.status, job.losses, job.attempt) == (JobStatus.ACCEPTED, 0, 1)
    assert job_id in stores.queue.pending()


def test_a_server_that_was_away_longer_than_the_lease_costs_no_loss(
    stores: Stores,
    settings: Settings,
    runners: Watched,
    server: EmbeddedServer,
) -> None:
    job_id = endless(stores)
    pid = server.pid
    assert pid is not None

    class Waking(logging.Handler):
        """Wakes the server when the supervisor has given the job up."""

        def emit(self, record: logging.LogRecord) -> None:
            if getattr(record, "action", "") == "fenced":
                os.kill(pid, signal.SIGCONT)

    waking = Waking()
    logging.getLogger("worker.ending").addHandler(waking)
    asleep: list[bool] = []

    def tick() -> bool:
        if not asleep and len(stores.jobs.get(job_id).snapshots) > 1:
            asleep.append(True)
            os.kill(pid, signal.SIGSTOP)
        return False

    try:
        brief = settings.model_copy(update={"lease_s": 1.0})
        job = supervise(stores, brief, runners, job_id, each_tick=tick)
    finally:
        os.kill(pid, signal.SIGCONT)
        logging.getLogger("worker.ending").removeHandler(waking)
    assert (job.status, job.losses, job.attempt) == (JobStatus.ACCEPTED, 0, 1)
    assert not runners.last.alive


def test_an_attempt_that_was_overtaken_writes_no_result(
    stores: Stores, settings: Settings, runners: Watched
) -> None:
    job_id = endless(stores)

    def overtake() -> None:
        token = stores.jobs.get(job_id).token
        stores.jobs.lose(job_id, token)
        stores.jobs.claim(job_id, "other")

    tick = when_computing(stores, job_id, overtake)
    job = supervise(stores, settings, runners, job_id, each_tick=tick)
    assert (job.status, job.worker, job.attempt) == (JobStatus.RUNNING, "other", 2)
    assert read_result(stores.blobs, job_id) is None
    assert not runners.last.alive


@pytest.mark.parametrize("deleted", [False, True])
def test_an_attempt_that_slept_through_the_end_of_its_job_leaves_no_file(
    stores: Stores, settings: Settings, runners: Watched, deleted: bool
) -> None:
    job_id = endless(stores)

    def sleep_through() -> None:
        stores.jobs.lose(job_id, stores.jobs.get(job_id).token)
        other = stores.jobs.claim(job_id, "other").token
        outcome = Outcome(JobStatus.FAILED, error=JobError("collapsed", "as it may"))
        assert stores.jobs.commit(job_id, other, outcome)
        settle(stores.jobs, stores.blobs, job_id)
        if deleted:
            delete_job(stores.jobs, stores.blobs, job_id)
        stores.blobs.create(layout.numbered(layout.checkpoints(job_id), 1, 10**6), b"written since")

    tick = when_computing(stores, job_id, sleep_through)
    Supervisor(stores.jobs, stores.blobs, stores.queue, settings, runners, stopping=tick).run(job_id, "w")
    assert not runners.last.alive
    left = {stat.key for stat in stores.blobs.list(layout.job_folder(job_id))}
    if deleted:
        assert left == set()
    else:
        kept = {snapshot.key for snapshot in stores.jobs.get(job_id).snapshots}
        assert left == {layout.spec(job_id), layout.result(job_id), *kept}


class Mute(Watched):
    """Runners that do not understand their order, and end without a word."""

    def take(self) -> Runner:
        runner = super().take()
        runner.start = lambda _: runner._stdin.write(b"no order\n")  # type: ignore[method-assign,assignment,return-value]
        return runner


def test_a_fault_of_ours_is_named_and_not_tried_again(
    stores: Stores, settings: Settings, runners: Watched
) -> None:
    spec = dataclasses.replace(job_spec(), parameters={"step": "sideways"})  # the API would not let it in
    submit(stores.jobs, stores.blobs, stores.queue, spec)
    job = supervise(stores, settings, runners, spec.id)
    assert (job.status, job.attempt, job.losses) == (JobStatus.FAILED, 1, 0)
    assert job.error is not None
    assert job.error.code == "internal-error"
    assert "ValidationError" in job.error.detail
    assert spec.id in job.error.detail


@pytest.mark.parametrize(
    ("fault", "status", "losses"),
    [(ZeroDivisionError, JobStatus.FAILED, 0), (BlockingIOError, JobStatus.ACCEPTED, 1)],
)
def test_a_fault_of_the_supervisor_itself_does_not_wait_for_the_lease(
    stores: Stores, settings: Settings, fault: type[Exception], status: JobStatus, losses: int
) -> None:
    def fail(_: object) -> None:
        raise fault

    class Faulty(Watched):
        def take(self) -> Runner:
            runner = super().take()
            runner.start = fail  # type: ignore[method-assign]
            return runner

    job_id = endless(stores)
    faulty = Faulty()
    with pytest.raises(fault):
        Supervisor(stores.jobs, stores.blobs, stores.queue, settings, faulty).run(job_id, "w")
    faulty.close()
    job = stores.jobs.get(job_id)
    assert (job.status, job.losses) == (status, losses)
    assert (job.error is not None and job.error.code == "internal-error") == (status is JobStatus.FAILED)


def test_a_runner_that_ends_by_itself_without_a_word_is_a_fault_of_ours(
    stores: Stores, settings: Settings
) -> None:
    runners = Mute()
    job = supervise(stores, settings, runners, endless(stores))
    runners.close()
    assert (job.status, job.losses) == (JobStatus.FAILED, 0)
    assert job.error is not None
    assert job.error.code == "internal-error"
    assert "exit code 1" in job.error.detail


def test_the_time_limit_is_that_of_all_attempts_together(
    stores: Stores, settings: Settings, runners: Watched
) -> None:
    job_id = endless(stores)
    token = stores.jobs.claim(job_id, "earlier").token
    stores.client.hincrby(keys.job(job_id), "claimed_at", -3_600_000)  # an hour ago
    assert stores.jobs.release(job_id, token)
    runners.warm_up()
    hour = settings.model_copy(update={"wall_limit_s": 3600.0})
    job = supervise(stores, hour, runners, job_id)
    assert (job.status, job.stop_reason, job.attempt) == (JobStatus.FAILED, "deadline", 2)
    assert job.error is not None
    assert job.error.code == "deadline"
    assert job.error.detail.startswith("the limit of 3600 s, all attempts together, was up after iteration")
    assert job.result_iteration is not None


def test_a_claim_whose_answer_is_lost_costs_nothing(
    stores: Stores, settings: Settings, runners: Watched
) -> None:
    class Lossy(RedisJobStore):
        asked = 0

        def claim(self, job_id: str, worker: str, claimant: str = "") -> Claim:
            answer = super().claim(job_id, worker, claimant)
            self.asked += 1
            if self.asked < 3:
                raise StoreUnavailableError
            return answer

    job_id = submit(stores.jobs, stores.blobs, stores.queue, job_spec()).id
    lossy = Lossy(stores.client)
    Supervisor(lossy, stores.blobs, stores.queue, settings, runners).run(job_id, "w")
    job = stores.jobs.get(job_id)
    assert (job.status, job.attempt, job.losses) == (JobStatus.SUCCESSFUL, 1, 0)
    assert lossy.asked == 3


def test_an_attempt_whose_records_are_flushed_ends_and_leaves_every_file(
    stores: Stores, settings: Settings, runners: Watched
) -> None:
    job_id = endless(stores)
    tick = when_computing(stores, job_id, stores.client.flushall)
    boss = Supervisor(stores.jobs, stores.blobs, stores.queue, settings, runners, stopping=tick)
    boss.run(job_id, "w")
    assert not runners.last.alive
    assert stores.client.keys("spherify:*") == []  # no half of a record is written after it
    kept = {blob.key for blob in stores.blobs.list(layout.job_folder(job_id))}
    assert {layout.spec(job_id), layout.numbered(layout.snapshots(job_id), 1, 2)} <= kept
    assert layout.result(job_id) not in kept


class Unreachable(FolderBlobStore):
    """A blob store that cannot tell how anything ended."""

    def read(self, key: str) -> bytes:
        raise StoreUnavailableError


def test_a_job_whose_files_cannot_be_reached_does_not_keep_the_others_waiting(
    stores: Stores, settings: Settings, runners: Watched
) -> None:
    far = submit(stores.jobs, stores.blobs, stores.queue, job_spec()).id
    stores.client.delete(keys.QUEUE_USUAL)  # it is delivered
    near = submit(stores.jobs, stores.blobs, stores.queue, job_spec()).id
    blobs = Unreachable(stores.blobs.root)
    job = supervise(stores, settings, runners, far, each_tick=lambda: True, blobs=blobs)
    assert (job.status, job.losses) == (JobStatus.ACCEPTED, 0)
    assert stores.queue.pending() == [far, near]


class Hooked(FolderBlobStore):
    """A blob store that does something before a result is written."""

    before: Callable[[], object]

    def create(self, key: str, chunks: bytes | Iterable[bytes]) -> BlobStat:
        if key.endswith("result.json"):
            self.before()
        return super().create(key, chunks)


def test_a_cancel_while_the_end_is_written_comes_too_late(
    stores: Stores, settings: Settings, runners: Watched
) -> None:
    job_id = submit(stores.jobs, stores.blobs, stores.queue, job_spec()).id
    answers: list[CancelOutcome] = []
    blobs = Hooked(stores.blobs.root)
    blobs.before = lambda: answers.append(cancel(stores.jobs, stores.blobs, job_id))
    job = supervise(stores, settings, runners, job_id, blobs=blobs)
    assert answers == [CancelOutcome.FINISHED]
    result = read_result(stores.blobs, job_id)
    assert result is not None
    assert job.status is result.outcome.status is JobStatus.SUCCESSFUL


def test_a_disk_that_is_full_at_the_end_is_named_and_written_down_later(
    stores: Stores, settings: Settings, runners: Watched
) -> None:
    def full() -> None:
        raise StorageFullError("there is no space left to store this")

    job_id = submit(stores.jobs, stores.blobs, stores.queue, job_spec()).id
    blobs = Hooked(stores.blobs.root)
    blobs.before = full
    job = supervise(stores, settings, runners, job_id, blobs=blobs)
    assert job.status is JobStatus.FAILED
    assert job.error is not None
    assert job.error.code == "storage-full"
    assert read_result(stores.blobs, job_id) is None
    scan = Reconciler(stores.stock, orphan_s=15).scan()
    assert scan.settled == (job_id,)
    result = read_result(stores.blobs, job_id)
    assert result is not None
    assert result.outcome.error == job.error


def test_all_is_settled_at_the_end(stores: Stores, settings: Settings, runners: Watched) -> None:
    job_id = submit(stores.jobs, stores.blobs, stores.queue, job_spec(iterations=30)).id
    often = settings.model_copy(update={"checkpoint_s": 0.001})
    job = supervise(stores, often, runners, job_id)
    assert job.status is JobStatus.SUCCESSFUL
    assert list(stores.blobs.list(layout.checkpoints(job_id))) == []
    assert stores.jobs.unsettled() == []
