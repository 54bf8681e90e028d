"""The watchdog: what it takes for dead and what not, and real workers that stop working."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

import pytest

from spherify.jobs.model import JobStatus
from spherify.jobs.submit import submit
from tests.jobs.examples import ENDLESS, job_spec, stone, store_mesh
from tests.stack import QUICK, started_stack, wait_for
from tests.worker.sabotage import FETCH_NOTHING, STAND_STILL
from worker.watchdog import Patience, Vitals

HEALTHY = Vitals(turns=0, fetched=0, idle=True, queued=0)


def judged(*looks: dict[str, Any], limit_s: float = 3.0, passed_s: float = 1.0) -> str | None:
    """Return the last verdict on looks at a loop that turns and an empty queue, but for what they say otherwise."""
    patience = Patience(limit_s)
    verdict = patience.judge(HEALTHY, passed_s)
    for number, look in enumerate(looks, 1):
        usual: dict[str, Any] = {"turns": number, "fetched": 0, "idle": True, "queued": 0}
        verdict = patience.judge(Vitals(**usual | look), passed_s)
    return verdict


def test_a_worker_that_does_what_it_can_is_left_alone() -> None:
    assert judged(*[{}] * 50) is None  # nothing to do
    assert judged(*[{"queued": 7, "idle": False}] * 50) is None  # every slot is taken
    assert judged(*({"queued": 7, "fetched": number // 2} for number in range(50))) is None


def test_what_lies_in_the_queue_beside_a_free_slot_is_a_reason() -> None:
    assert judged(*[{"queued": 7}] * 3) is None
    assert "nothing was fetched" in str(judged(*[{"queued": 7}] * 4))
    assert judged(*[{"queued": 7}] * 3, {}, {"queued": 7}) is None  # somebody fetched it


def test_a_loop_that_stands_still_is_a_reason() -> None:
    assert judged(*[{"turns": 0}] * 3) is None
    assert "stood still" in str(judged(*[{"turns": 0}] * 4))


def test_a_process_that_slept_is_not_blamed_for_it() -> None:
    assert judged({"turns": 0}, limit_s=20.0, passed_s=3600.0) is None


def test_time_without_a_server_does_not_count() -> None:
    patience = Patience(3.0)
    for _ in range(50):
        assert [patience.judge(HEALTHY, 1.0) for _ in range(3)] == [None] * 3
        patience.forgive()


@pytest.mark.parametrize(("number", "code"), [(FETCH_NOTHING, 0), (STAND_STILL, -signal.SIGKILL)])
def test_a_worker_that_consumes_nothing_ends_and_its_job_goes_on(
    tmp_path: Path, number: int, code: int
) -> None:
    environment = {**QUICK, "SPHERIFY_WATCHDOG_S": "5", "SPHERIFY_CANCEL_GRACE_S": "1"}
    with started_stack(tmp_path, workers=0, api=False, environment=environment) as stack:
        jobs, blobs, queue = stack.stores.jobs, stack.stores.blobs, stack.stores.queue
        store_mesh(stack.stores.meshes, blobs, stone())
        broken = stack.start_worker("broken", concurrency=2, program="tests.worker.sabotage")
        running = submit(jobs, blobs, queue, job_spec(**ENDLESS)).id
        wait_for(lambda: jobs.get(running).snapshots)
        os.kill(broken.pid, number)
        waiting = submit(jobs, blobs, queue, job_spec()).id
        assert broken.wait(60) == code
        del stack.workers["broken"]
        assert '"action": "watchdog"' in stack.log("worker-broken").read_text()
        stack.start_worker("whole", concurrency=2)
        wait_for(lambda: jobs.get(waiting).status is JobStatus.SUCCESSFUL)
        again = wait_for(lambda: job if (job := jobs.get(running)).attempt == 2 else None)
        assert again.losses == 0  # it was handed on


def test_a_worker_whose_slots_are_all_taken_is_left_alone(tmp_path: Path) -> None:
    limit_s = 5.0
    with started_stack(
        tmp_path, workers=1, api=False, environment={**QUICK, "SPHERIFY_WATCHDOG_S": str(limit_s)}
    ) as stack:
        jobs, blobs, queue = stack.stores.jobs, stack.stores.blobs, stack.stores.queue
        store_mesh(stack.stores.meshes, blobs, stone())
        running = submit(jobs, blobs, queue, job_spec(**ENDLESS)).id
        wait_for(lambda: jobs.get(running).snapshots)
        waiting = submit(jobs, blobs, queue, job_spec()).id
        since = jobs.get(running).progress.elapsed_s
        wait_for(lambda: jobs.get(running).progress.elapsed_s > since + 2 * limit_s)
        assert (jobs.get(running).status, jobs.get(running).attempt) == (JobStatus.RUNNING, 1)
        assert jobs.get(waiting).status is JobStatus.ACCEPTED
        assert "watchdog" not in stack.log("worker-0").read_text()


def test_a_worker_that_cannot_start_runners_ends_and_another_does_its_job(tmp_path: Path) -> None:
    with started_stack(tmp_path, workers=0, api=False) as stack:
        jobs, blobs, queue = stack.stores.jobs, stack.stores.blobs, stack.stores.queue
        store_mesh(stack.stores.meshes, blobs, stone())
        job_id = submit(jobs, blobs, queue, job_spec()).id
        broken = stack.start_worker(
            "broken", program="tests.worker.sabotage", environment={"NO_RUNNERS": "1"}, until_ready=False
        )
        assert broken.wait(60) == 0
        del stack.workers["broken"]
        assert '"action": "runners"' in stack.log("worker-broken").read_text()
        job = jobs.get(job_id)
        assert (job.status, job.losses) == (JobStatus.ACCEPTED, 0)
        stack.start_worker("whole")
        wait_for(lambda: jobs.get(job_id).status is JobStatus.SUCCESSFUL)
