"""What comes of a job whose runner is started, or left, at an awkward moment."""

from __future__ import annotations

import errno
import os
import resource
import signal
import time

import pytest

from spherify.jobs import layout
from spherify.jobs.cancel import cancel
from spherify.jobs.model import JobStatus
from spherify.jobs.ports import CancelOutcome
from spherify.jobs.results import read_result
from spherify.settings import Settings
from spherify.stores.connect import Stores
from tests.worker.supervised import Watched, endless
from tests.worker.test_supervisor import supervise
from worker.processes import Process


def test_a_run_is_handed_on_also_where_a_checkpoint_is_due(
    stores: Stores, settings: Settings, runners: Watched
) -> None:
    """That state is kept already when the run is left, and nothing is written twice."""
    job_id = endless(stores)
    at_each_iteration = settings.model_copy(update={"checkpoint_s": 1e-9})
    job = supervise(
        stores,
        at_each_iteration,
        runners,
        job_id,
        each_tick=lambda: len(stores.jobs.get(job_id).snapshots) > 1,
    )
    assert (job.status, job.losses, job.error) == (JobStatus.ACCEPTED, 0, None)
    assert len(list(stores.blobs.list(layout.checkpoints(job_id)))) == 2


def test_no_attempt_is_lost_because_the_next_runner_cannot_be_started(
    stores: Stores, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where runners cannot be forked a spare is started beside the one that computes."""

    def exhausted(order: int, events: int) -> Process:
        asked.append(order)
        raise OSError(errno.EAGAIN, "no further process")

    asked: list[int] = []
    runners = Watched(forked=False)
    job_id = endless(stores)

    def tick() -> bool:
        monkeypatch.setattr("worker.runners.spawn", exhausted)
        return len(asked) > 1

    job = supervise(stores, settings, runners, job_id, each_tick=tick)
    assert (job.status, job.losses) == (JobStatus.ACCEPTED, 0)
    assert not runners.last.alive
    runners.close()


def test_a_runner_that_takes_long_to_start_has_its_time_and_keeps_the_state_it_comes_to(
    stores: Stores, settings: Settings, runners: Watched, caplog: pytest.LogCaptureFixture
) -> None:
    """Here a start takes more than the grace time, as on a busy machine."""
    brief = settings.model_copy(update={"wall_limit_s": 1.0, "cancel_grace_s": 2.0})
    job_id = endless(stores)
    runners.prepare()
    server = runners.server_pid
    assert server is not None
    os.kill(server, signal.SIGSTOP)
    waits_since = time.monotonic()

    def tick() -> bool:
        if time.monotonic() - waits_since > 5.5:  # the least time of an attempt, and the grace
            os.kill(server, signal.SIGCONT)
        return False

    job = supervise(stores, brief, runners, job_id, each_tick=tick)
    assert (job.status, job.stop_reason, job.losses) == (JobStatus.FAILED, "deadline", 0)
    assert job.progress is not None
    assert job.result_iteration == job.progress.iteration > 2
    assert "did not stop" not in caplog.text


@pytest.mark.parametrize("cancelled", [True, False], ids=["cancelled", "handed-on"])
def test_a_runner_that_is_told_to_end_on_a_full_disk_ends_as_it_was_told(
    stores: Stores, settings: Settings, runners: Watched, cancelled: bool
) -> None:
    """Only the state it is at is lost, and that is made again, or nobody asks for it any more."""
    job_id = endless(stores)
    full: list[int] = []

    def fill() -> bool:
        if not full and len(stores.jobs.get(job_id).snapshots) > 1:
            full.append(runners.last.pid)
            resource.prlimit(full[0], resource.RLIMIT_FSIZE, (64, 64))
            if cancelled:
                assert cancel(stores.jobs, stores.blobs, job_id) is CancelOutcome.CANCELLING
        return bool(full) and not cancelled

    job = supervise(stores, settings, runners, job_id, each_tick=fill)
    assert full
    expected = (JobStatus.CANCELLED, "cancelled") if cancelled else (JobStatus.ACCEPTED, None)
    assert (job.status, job.stop_reason) == expected
    assert (job.losses, job.error) == (0, None)
    assert [snapshot.iteration for snapshot in job.snapshots] == [0, 2]
    assert (read_result(stores.blobs, job_id) is not None) is cancelled
