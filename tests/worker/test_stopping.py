"""A worker that is told to end while the server of the records accepts, and never answers."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator

import pytest

from spherify.jobs.model import JobStatus
from tests.jobs.examples import ENDLESS, job_spec, stone, store_mesh
from tests.processes import await_gone, below
from tests.stack import QUICK, Stack, started_stack, wait_for
from tests.worker.observation import (
    LONG,
    check_whole,
    finished,
    hashes,
    runner_of,
    submitted,
    under_way,
)


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stack]:
    """With the grace that is delivered, and a lease that outlasts it: the worker ends before it would be fenced."""
    times = {"SPHERIFY_LEASE_S": "10", "SPHERIFY_CANCEL_GRACE_S": "5"}
    folder = tmp_path_factory.mktemp("stopping")
    with started_stack(folder, api=False, environment={**QUICK, **times}) as stack:
        store_mesh(stack.stores.meshes, stack.stores.blobs, stone())
        yield stack


@pytest.mark.parametrize("deaf", [False, True], ids=["heard", "deaf"])
def test_a_worker_ends_in_time_though_the_server_does_not_answer(stack: Stack, deaf: bool) -> None:
    """Nobody can be told that the job is free: its lease says so."""
    clean = hashes(finished(stack, submitted(stack, job_spec(**LONG))))
    job_id = submitted(stack, job_spec(**LONG))
    under_way(stack, job_id, 200)
    family = below(stack.workers["0"].pid, "worker")
    server = stack.server.pid
    assert server is not None
    if deaf:
        os.kill(runner_of(stack, job_id), signal.SIGSTOP)
    os.kill(server, signal.SIGSTOP)
    try:
        worker = stack.workers.pop("0")
        worker.send_signal(signal.SIGTERM)
        assert worker.wait(10) == 0
        await_gone(family)
    finally:
        os.kill(server, signal.SIGCONT)
    assert stack.stores.jobs.get(job_id).status is JobStatus.RUNNING
    stack.start_worker("0")
    job = finished(stack, job_id)
    check_whole(stack, job)
    assert (job.status, job.attempt) == (JobStatus.SUCCESSFUL, 2)
    assert hashes(job) == clean


def test_a_worker_that_ends_hands_on_as_soon_as_the_server_answers_again(stack: Stack) -> None:
    """As where both are restarted at once."""
    job_id = submitted(stack, job_spec(**ENDLESS, snapshots="2"))
    under_way(stack, job_id, 2)
    server = stack.server.pid
    assert server is not None
    log = stack.log("worker-0")
    told = len(log.read_text())
    os.kill(server, signal.SIGSTOP)
    try:
        worker = stack.workers.pop("0")
        worker.send_signal(signal.SIGTERM)
        wait_for(lambda: "does not answer" in log.read_text()[told:])
    finally:
        os.kill(server, signal.SIGCONT)
    assert worker.wait(10) == 0
    job = stack.stores.jobs.get(job_id)
    assert (job.status, job.losses, job.attempt) == (JobStatus.ACCEPTED, 0, 1)
    assert job_id in stack.stores.queue.pending()
