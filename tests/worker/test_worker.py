"""Real workers, real runners, a real server: jobs that finish, are cancelled, and lose everything they can lose."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from spherify.geometry.flow import flow
from spherify.jobs import layout
from spherify.jobs.cancel import cancel
from spherify.jobs.codec import dump_record
from spherify.jobs.model import Job, JobSpec, JobStatus
from spherify.jobs.ports import CancelOutcome
from spherify.jobs.results import Result, read_result
from spherify.jobs.submit import submit
from spherify.parameters import resolve
from spherify.stores import keys
from spherify.stores.arrays import load_arrays
from tests.jobs.examples import ENDLESS, job_spec, mesh_record, stone, store_mesh
from tests.stack import Stack, started_stack, wait_for

LONG = {"iterations": 240, "snapshots": "every:40"}


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stack]:
    folder = tmp_path_factory.mktemp("worker")
    with started_stack(folder, workers=1, api=False) as stack:
        store_mesh(stack.stores.meshes, stack.stores.blobs, stone())
        assert processes_of(folder)
        yield stack
    assert processes_of(folder) == []  # nothing is left behind


@pytest.fixture(scope="module")
def undisturbed(stack: Stack) -> dict[int, str]:
    """The sha256 of each snapshot of the long job, of a run that nothing happened to."""
    return hashes(finished(stack, submitted(stack, job_spec(**LONG))))


def submitted(stack: Stack, spec: JobSpec) -> str:
    return submit(stack.stores.jobs, stack.stores.blobs, stack.stores.queue, spec).id


def finished(stack: Stack, job_id: str) -> Job:
    return wait_for(
        lambda: job if (job := stack.stores.jobs.get(job_id)).status.done else None,
        limit_s=60,
        what=f"the end of {job_id}, see {stack.data_dir}",
    )


def under_way(stack: Stack, job_id: str, iteration: int = 0) -> Job:
    """Wait until a job is computing and a snapshot at or after an iteration is known."""
    return wait_for(
        lambda: (
            job
            if (job := stack.stores.jobs.get(job_id)).snapshots and job.snapshots[-1].iteration >= iteration
            else None
        ),
        what=f"iteration {iteration} of {job_id}, see {stack.data_dir}",
    )


def hashes(job: Job) -> dict[int, str]:
    return {snapshot.iteration: snapshot.sha256 for snapshot in job.snapshots}


def log_lines(stack: Stack, job_id: str) -> list[dict[str, object]]:
    lines = [line for path in stack.data_dir.glob("worker-*.log") for line in path.read_text().splitlines()]
    parsed = [json.loads(line) for line in lines if line.startswith("{")]
    return [line for line in parsed if line.get("job_id") == job_id]


def actions(stack: Stack, job_id: str) -> list[object]:
    """Return what the log says of a job, without second deliveries: on a busy machine it may be sent again."""
    return [
        line["action"]
        for line in log_lines(stack, job_id)
        if line["action"] not in {"drop", "reconcile-orphan"}
    ]


def runner_of(stack: Stack, job_id: str) -> int:
    """Return the process id of the runner that works on a job."""
    starts = [line for line in log_lines(stack, job_id) if line["action"] == "start"]
    return int(str(starts[-1]["message"]).rpartition(" ")[2])


def processes_of(folder: Path) -> list[int]:
    """Return the processes of this machine that were started to work in a data folder, orphans included."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal() and int(entry.name) != os.getpid():
            try:
                if str(folder).encode() in (entry / "environ").read_bytes():
                    found.append(int(entry.name))
            except (FileNotFoundError, ProcessLookupError, PermissionError):
                continue
    return found


def descendants(pid: int, word: str) -> list[int]:
    """Return the live processes below one whose command line has a word in it."""
    found = []
    for child in [int(c) for c in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]:
        try:
            if word in Path(f"/proc/{child}/cmdline").read_text():
                found.append(child)
            found += descendants(child, word)
        except (FileNotFoundError, ProcessLookupError):
            continue
    return found


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def check_whole(stack: Stack, job: Job) -> Result:
    """Assert that record, files and result of a successful job say the same."""
    assert job.error is None
    assert (job.status, job.worker, job.lease_until) == (JobStatus.SUCCESSFUL, None, None)
    result = read_result(stack.stores.blobs, job.id)
    assert result is not None
    assert result.outcome.status is job.status
    assert tuple(result.snapshots) == job.snapshots
    assert list(result.rows) == stack.stores.jobs.metrics(job.id)
    assert result.progress == job.progress
    wait_for(lambda: not list(stack.stores.blobs.list(layout.checkpoints(job.id))))  # swept after the record
    return result


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
    wait_for(lambda: actions(stack, job.id) == ["start", "commit"])  # the line follows the record


def test_a_collapse_fails_and_keeps_its_best_state(stack: Stack) -> None:
    spec = job_spec(iterations=300, preset="paper", step=0.1)
    job = finished(stack, submitted(stack, spec))
    assert (job.status, job.stop_reason) == (JobStatus.FAILED, "collapsed")
    assert job.error is not None
    assert job.error.code == "collapsed"
    assert job.result_iteration == job.best_iteration
    assert job.best_iteration in hashes(job)


def test_a_job_that_cannot_be_computed_says_why(stack: Stack) -> None:
    without_files = mesh_record("mesh_" + "0" * 26)
    stack.stores.meshes.add(without_files)
    job = finished(stack, submitted(stack, job_spec(mesh_id=without_files.id)))
    assert job.status is JobStatus.FAILED
    assert job.error is not None
    assert job.error.code == "mesh-missing"
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
    message = stack.stores.client.rpop(keys.QUEUE)  # as kombu takes one, and books it as delivered
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
    under_way(stack, job_id, 80)
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
        if job.status is JobStatus.RUNNING and len(log_lines(stack, job_id)) >= 1:
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
    under_way(stack, job_id, 80)
    family = descendants(stack.workers["0"].pid, "worker")
    assert runner_of(stack, job_id) in family
    stack.stop_worker("0", signal.SIGKILL)
    wait_for(lambda: not any(map(is_running, family)), what="the end of its pool and its runners")
    stack.start_worker("0")
    job = finished(stack, job_id)
    check_whole(stack, job)
    assert (job.attempt, job.losses) == (2, 1)
    assert hashes(job) == undisturbed


def test_a_worker_that_is_stopped_hands_its_job_on(stack: Stack, undisturbed: dict[int, str]) -> None:
    job_id = submitted(stack, job_spec(**LONG))
    under_way(stack, job_id, 80)
    assert stack.stop_worker("0") == 0
    job = stack.stores.jobs.get(job_id)
    assert (job.status, job.losses) == (JobStatus.ACCEPTED, 0)
    assert job_id in stack.stores.queue.pending()
    stack.start_worker("0")
    job = finished(stack, job_id)
    check_whole(stack, job)
    assert (job.attempt, job.losses) == (2, 0)
    assert hashes(job) == undisturbed


def test_a_worker_that_sleeps_through_its_lease_is_fenced(stack: Stack, undisturbed: dict[int, str]) -> None:
    job_id = submitted(stack, job_spec(**LONG))
    under_way(stack, job_id, 40)
    sleeper = runner_of(stack, job_id)
    supervisor = int(Path(f"/proc/{sleeper}/stat").read_text().rpartition(")")[2].split()[1])
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


def test_a_worker_that_died_between_file_and_record_is_made_up_for(stack: Stack) -> None:
    first = finished(stack, submitted(stack, job_spec(iterations=4)))
    text = stack.stores.blobs.read(layout.result(first.id))
    spec = job_spec(iterations=4)
    stack.stores.blobs.create(layout.result(spec.id), text.replace(first.id.encode(), spec.id.encode()))
    job = finished(stack, submitted(stack, spec))
    assert (job.status, job.attempt) == (JobStatus.SUCCESSFUL, 1)
    assert hashes(job) == hashes(first)
    wait_for(lambda: actions(stack, job.id) == ["adopt", "commit"])


def test_memory_that_runs_out_is_named(tmp_path: Path) -> None:
    limits = {"SPHERIFY_RUNNER_MEMORY_BYTES": str(1 << 20), "SPHERIFY_LEASE_S": "5"}
    with started_stack(tmp_path, workers=1, api=False, environment=limits) as small:
        store_mesh(small.stores.meshes, small.stores.blobs, stone())
        job = finished(small, submitted(small, job_spec()))
        assert job.error is not None
        assert job.error.code == "out-of-memory"
        assert job.losses == 0
