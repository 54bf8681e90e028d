"""Real workers, real runners, a real server, and jobs that lose everything they can lose."""

from __future__ import annotations

import json
import os
import signal
import time
from dataclasses import replace

from spherify.jobs import layout
from spherify.jobs.cancel import cancel
from spherify.jobs.codec import dump_record
from spherify.jobs.model import JobStatus
from spherify.jobs.results import read_result, write_result
from spherify.stores import keys
from tests.jobs.examples import ENDLESS, job_spec
from tests.processes import await_gone, below
from tests.stack import Stack, wait_for
from tests.worker.observation import (
    LONG,
    actions,
    check_whole,
    finished,
    finished_after_all,
    hashes,
    is_running,
    log_lines,
    parent_of,
    runner_of,
    submitted,
    under_way,
)


def test_a_worker_that_cannot_say_that_it_is_done_goes_on_consuming(stack: Stack) -> None:
    first = submitted(stack, job_spec(**ENDLESS, snapshots="2"))
    under_way(stack, first, 2)
    worker = stack.workers["0"].pid
    os.kill(worker, signal.SIGSTOP)  # the process that would acknowledge, not the one that ends the job
    cancel(stack.stores.jobs, stack.stores.blobs, first)
    finished(stack, first)
    assert stack.server.pid is not None
    os.kill(stack.server.pid, signal.SIGKILL)
    wait_for(lambda: not stack.server.alive)
    os.kill(worker, signal.SIGCONT)
    wait_for(lambda: "Couldn't ack" in stack.log("worker-0").read_text())
    stack.server.start()
    assert finished(stack, submitted(stack, job_spec(iterations=2))).status is JobStatus.SUCCESSFUL
    assert stack.workers["0"].pid == worker
    stack.stores.client.delete(keys.UNACKED, keys.UNACKED_INDEX)  # or it is delivered again in two minutes


def test_a_job_whose_message_died_with_its_consumer_is_sent_again(stack: Stack) -> None:
    stack.stop_worker("0")
    job_id = submitted(stack, job_spec(iterations=2))
    message = stack.stores.client.rpop(keys.QUEUE_USUAL)  # as kombu takes one, and books it as delivered
    stack.stores.client.hset(keys.UNACKED, "lost", json.dumps([json.loads(str(message)), "", keys.QUEUE]))
    stack.stores.client.zadd(keys.UNACKED_INDEX, {"lost": time.time()})
    stack.start_worker("0")
    assert finished(stack, job_id).status is JobStatus.SUCCESSFUL
    assert stack.stores.client.hexists(keys.UNACKED, "lost")  # long before the visibility timeout
    stack.stores.client.delete(keys.UNACKED, keys.UNACKED_INDEX)


def test_a_job_recorded_but_never_sent_is_found(stack: Stack) -> None:
    spec = job_spec(iterations=2)
    stack.stores.blobs.create(layout.spec(spec.id), dump_record(spec).encode())
    stack.stores.jobs.add(spec)
    check_whole(stack, finished(stack, spec.id))


def test_a_killed_runner_costs_one_loss_and_no_bytes(stack: Stack, undisturbed: dict[int, str]) -> None:
    job_id = submitted(stack, job_spec(**LONG))
    under_way(stack, job_id, 400)
    os.kill(runner_of(stack, job_id), signal.SIGKILL)
    job = finished(stack, job_id)
    check_whole(stack, job)
    assert (job.attempt, job.losses) == (2, 1)
    assert hashes(job) == undisturbed


def test_a_job_that_kills_its_runner_every_time_fails_after_its_cap(stack: Stack) -> None:
    job_id = submitted(stack, job_spec(**ENDLESS))
    killed: set[int] = set()

    def poisoned() -> bool:
        job = stack.stores.jobs.get(job_id)
        if job.status is JobStatus.RUNNING and "start" in actions(stack, job_id):
            runner = runner_of(stack, job_id)
            if runner not in killed:
                killed.add(runner)
                os.kill(runner, signal.SIGKILL)
        return job.status.done

    wait_for(poisoned, limit_s=60)
    job = stack.stores.jobs.get(job_id)
    assert (job.status, job.losses, job.attempt) == (JobStatus.FAILED, 4, 4)
    assert job.error is not None
    assert job.error.code == "worker-lost"
    result = wait_for(lambda: read_result(stack.stores.blobs, job_id))  # by the reconciler
    assert result is not None
    assert (result.outcome.status, result.outcome.error) == (JobStatus.FAILED, job.error)
    assert tuple(result.snapshots) == job.snapshots


def test_a_killed_worker_leaves_nothing_and_another_ends_its_job_with_the_same_bytes(
    stack: Stack, undisturbed: dict[int, str]
) -> None:
    job_id = submitted(stack, job_spec(**LONG))
    under_way(stack, job_id, 400)
    family = below(stack.workers["0"].pid, "worker")
    assert runner_of(stack, job_id) in {seen.pid for seen in family}
    stack.stop_worker("0", signal.SIGKILL)
    await_gone(family)
    stack.start_worker("0")
    job = finished(stack, job_id)
    check_whole(stack, job)
    assert (job.attempt, job.losses) == (2, 1)
    assert hashes(job) == undisturbed


def test_a_worker_that_is_stopped_hands_its_job_on(stack: Stack, undisturbed: dict[int, str]) -> None:
    job_id = submitted(stack, job_spec(**LONG))
    under_way(stack, job_id, 400)
    assert stack.stop_worker("0") == 0
    job = stack.stores.jobs.get(job_id)
    assert (job.status, job.losses) == (JobStatus.ACCEPTED, 0)
    assert job_id in stack.stores.queue.pending()
    stack.start_worker("0")
    job = finished(stack, job_id)
    check_whole(stack, job)
    assert (job.attempt, job.losses) == (2, 0)
    assert hashes(job) == undisturbed


def test_a_worker_whose_runner_is_deaf_is_stopped_in_time_and_hands_its_job_on(
    stack: Stack, undisturbed: dict[int, str]
) -> None:
    job_id = submitted(stack, job_spec(**LONG))
    under_way(stack, job_id, 200)
    os.kill(runner_of(stack, job_id), signal.SIGSTOP)  # as in a long call of a library
    worker = stack.workers.pop("0")
    worker.send_signal(signal.SIGTERM)
    assert worker.wait(10) == 0
    job = stack.stores.jobs.get(job_id)
    assert (job.status, job.losses) == (JobStatus.ACCEPTED, 0)
    stack.start_worker("0")
    job = finished(stack, job_id)
    check_whole(stack, job)
    assert (job.attempt, job.losses) == (2, 0)
    assert hashes(job) == undisturbed


def test_everything_comes_back_after_the_server_forgot_it(stack: Stack, undisturbed: dict[int, str]) -> None:
    done = finished(stack, submitted(stack, job_spec(iterations=4)))
    wait_for(lambda: not stack.stores.jobs.unsettled())
    running = submitted(stack, job_spec(**LONG))
    waiting = submitted(stack, job_spec(iterations=2))
    under_way(stack, running, 200)
    stack.stores.client.flushall()
    for job_id in (running, waiting):
        job = finished_after_all(stack, job_id)
        check_whole(stack, job)
        assert job.losses == 0
        assert job.token > 10**12
    assert hashes(stack.stores.jobs.get(running)) == undisturbed
    again = stack.stores.jobs.get(done.id)
    assert (again.status, again.snapshots, again.progress) == (done.status, done.snapshots, done.progress)


def test_a_worker_that_sleeps_through_its_lease_is_fenced(stack: Stack, undisturbed: dict[int, str]) -> None:
    job_id = submitted(stack, job_spec(**LONG))
    under_way(stack, job_id, 200)
    sleeper = runner_of(stack, job_id)
    supervisor = parent_of(parent_of(sleeper))
    os.kill(supervisor, signal.SIGSTOP)
    try:
        stack.start_worker("other")
        job = finished(stack, job_id)
    finally:
        os.kill(supervisor, signal.SIGCONT)
    wait_for(lambda: any(line["action"] == "fenced" for line in log_lines(stack, job_id)))
    wait_for(lambda: not is_running(sleeper))
    check_whole(stack, job)
    assert (job.attempt, job.losses) == (2, 1)
    assert hashes(job) == undisturbed
    assert stack.stores.jobs.get(job_id) == job  # the sleeper wrote nothing
    stack.stop_worker("other")


def test_a_worker_that_died_between_file_and_record_is_made_up_for(stack: Stack) -> None:
    first = finished(stack, submitted(stack, job_spec(iterations=4)))
    spec = job_spec(iterations=4)
    write_result(stack.stores.blobs, replace(check_whole(stack, first), job_id=spec.id))
    job = finished(stack, submitted(stack, spec))
    assert (job.status, job.attempt) == (JobStatus.SUCCESSFUL, 1)
    assert hashes(job) == hashes(first)
    wait_for(lambda: actions(stack, job.id) == ["claim", "adopt", "commit"])


def test_a_damaged_result_is_passed_over_by_whoever_takes_the_job_up(stack: Stack) -> None:
    first = finished(stack, submitted(stack, job_spec(iterations=4)))
    spec = job_spec(iterations=4)
    stack.stores.blobs.create(layout.result(spec.id), stack.stores.blobs.read(layout.result(first.id))[:-9])
    job = finished(stack, submitted(stack, spec))
    check_whole(stack, job)
    assert (job.attempt, job.losses) == (1, 0)
    assert hashes(job) == hashes(first)
    wait_for(lambda: actions(stack, job.id) == ["claim", "start", "result", "commit"])


def test_a_cancelled_job_with_a_damaged_result_is_settled_once(stack: Stack) -> None:
    spec = job_spec()
    stack.stores.blobs.create(layout.spec(spec.id), dump_record(spec).encode())
    stack.stores.blobs.create(layout.result(spec.id), b'{"job_id":')
    stack.stores.jobs.add(spec)
    stack.stores.jobs.request_cancel(spec.id)  # and whoever did so died before it wrote the end
    wait_for(lambda: spec.id not in stack.stores.jobs.unsettled())
    result = read_result(stack.stores.blobs, spec.id)
    assert result is not None
    assert result.outcome.status is JobStatus.CANCELLED
    told = wait_for(
        lambda: [line["message"] for line in log_lines(stack, spec.id) if line["action"] == "result"]
    )
    assert len(told) == 1
    assert layout.result_again(spec.id) in str(told[0])
