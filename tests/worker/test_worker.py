"""Real workers, real runners, a real server: jobs that finish, fail and are cancelled."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from spherify.geometry.flow import flow
from spherify.jobs import layout
from spherify.jobs.cancel import cancel
from spherify.jobs.model import JobStatus
from spherify.jobs.ports import CancelOutcome
from spherify.jobs.results import read_result
from spherify.parameters import resolve
from spherify.stores.arrays import load_arrays
from tests.jobs.examples import ENDLESS, job_spec, mesh_record, stone, store_mesh
from tests.stack import Stack, started_stack, wait_for
from tests.worker.observation import (
    actions,
    check_whole,
    finished,
    hashes,
    is_running,
    log_lines,
    runner_of,
    submitted,
    under_way,
)


def test_a_job_ends_with_what_the_flow_yields(stack: Stack) -> None:
    spec = job_spec(iterations=12, snapshots="5")
    job = finished(stack, submitted(stack, spec))
    check_whole(stack, job)
    assert (job.attempt, job.losses, job.stop_reason) == (1, 0, "iterations")
    assert job.result_iteration == 12
    assert {0, 5, 12, job.best_iteration} == set(hashes(job))
    states = {s.iteration: s for s in flow(stone(), resolve("robust", {"iterations": 12}).config())}
    for snapshot in job.snapshots:
        arrays = load_arrays(stack.stores.blobs.read(snapshot.key))
        assert arrays["vertices"].tobytes() == states[snapshot.iteration].vertices.tobytes()
    wait_for(lambda: actions(stack, job.id) == ["claim", "start", "commit"])  # the line follows the record


def test_a_collapse_fails_and_keeps_its_best_state(stack: Stack) -> None:
    spec = job_spec(iterations=300, preset="paper", step=0.1)
    job = finished(stack, submitted(stack, spec))
    assert (job.status, job.stop_reason) == (JobStatus.FAILED, "collapsed")
    assert job.error is not None
    assert job.error.code == "collapsed"
    assert job.result_iteration == job.best_iteration
    assert job.best_iteration in hashes(job)


@pytest.mark.parametrize(
    ("content", "what"),
    [(None, "is missing: upload it again"), (b"damaged", "is damaged: delete it, and before it the jobs")],
)
def test_a_job_that_cannot_be_computed_says_why_with_the_cure(
    stack: Stack, content: bytes | None, what: str
) -> None:
    mesh = mesh_record("mesh_" + ("0" if content is None else "1") * 26)
    if content is not None:
        stack.stores.blobs.create(layout.mesh_arrays(mesh.id), content)
    stack.stores.meshes.add(mesh)
    job = finished(stack, submitted(stack, job_spec(mesh_id=mesh.id)))
    assert job.status is JobStatus.FAILED
    assert job.error is not None
    assert job.error.code == "mesh-missing"
    assert f"the stored mesh {mesh.id} {what}" in job.error.detail
    assert job.losses == 0


def test_a_running_job_is_cancelled_and_keeps_its_state(stack: Stack) -> None:
    job_id = submitted(stack, job_spec(**ENDLESS, snapshots="2"))
    under_way(stack, job_id, 2)
    runner = runner_of(stack, job_id)
    assert cancel(stack.stores.jobs, stack.stores.blobs, job_id) is CancelOutcome.CANCELLING
    job = finished(stack, job_id)
    assert (job.status, job.stop_reason, job.result_iteration) == (JobStatus.CANCELLED, "cancelled", None)
    assert job.progress is not None
    assert job.snapshots[-1].iteration == job.progress.iteration > 2
    wait_for(lambda: not is_running(runner))
    assert read_result(stack.stores.blobs, job_id) is not None


def test_a_waiting_job_that_is_cancelled_never_runs(stack: Stack) -> None:
    blocker = submitted(stack, job_spec(**ENDLESS))
    under_way(stack, blocker)
    waiting = submitted(stack, job_spec())
    assert cancel(stack.stores.jobs, stack.stores.blobs, waiting) is CancelOutcome.CANCELLED
    cancel(stack.stores.jobs, stack.stores.blobs, blocker)
    finished(stack, blocker)
    wait_for(lambda: any(line["action"] == "drop" for line in log_lines(stack, waiting)))
    assert stack.stores.jobs.get(waiting).attempt == 0


def test_a_message_delivered_many_times_runs_once(stack: Stack) -> None:
    spec = job_spec(iterations=5)
    job_id = submitted(stack, spec)
    for _ in range(5):
        stack.stores.queue.send(job_id)
    finished(stack, job_id)
    wait_for(lambda: sum(line["action"] == "drop" for line in log_lines(stack, job_id)) >= 5)
    assert stack.stores.jobs.get(job_id).attempt == 1
    wait_for(lambda: not stack.stores.queue.pending())


def test_the_health_check_knows_a_worker_that_works(stack: Stack, tmp_path: Path) -> None:
    def health(*arguments: str, **environment: str) -> int:
        command = [sys.executable, "-m", "worker.health", *arguments]
        return subprocess.run(
            command, env={**stack.environment, **environment}, check=False, capture_output=True
        ).returncode

    assert health("0@test") == 0
    assert health("nobody@test") == 1
    assert health() == 1  # no worker of the usual name on this host
    assert health("0@test", REDIS_URL=f"unix://{tmp_path}/nothing.sock") == 0  # not the worker's fault


def test_memory_that_runs_out_is_named(tmp_path: Path) -> None:
    limits = {"SPHERIFY_RUNNER_MEMORY_BYTES": str(1 << 20), "SPHERIFY_LEASE_S": "5"}
    with started_stack(tmp_path, workers=1, api=False, environment=limits) as small:
        store_mesh(small.stores.meshes, small.stores.blobs, stone(40_000))  # more than lies about unused
        job = finished(small, submitted(small, job_spec()))
        assert job.error is not None
        assert job.error.code == "out-of-memory"
        assert job.losses == 0
