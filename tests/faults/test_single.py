"""Rows 3, 10, 17 and 19 of docs/durability.md: one fault, one job, on a stack of its own."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from spherify.formats import write_mesh
from spherify.geometry.samples import SAMPLES
from tests.e2e.api import Api
from tests.faults.campaign import SHORT
from tests.faults.ledger import Ledger, Verdict, judge
from tests.faults.logs import Logs
from tests.faults.specimens import Specimen, specimen
from tests.stack import Stack, started_stack, wait_for

MAX_LOSSES = 2
ENDLESS = {
    "iterations": "900000",
    "annealing": "null",
    "stop_radius_variation": "0",
    "snapshots": "every:5000",
}


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stack]:
    folder = tmp_path_factory.mktemp("single")
    temporary = folder / "tmp"
    temporary.mkdir()
    settings = SHORT | {"SPHERIFY_MAX_LOSSES": str(MAX_LOSSES), "TMPDIR": str(temporary)}
    with started_stack(folder, workers=0, environment=settings) as stack:
        yield stack


@pytest.fixture
def worker(stack: Stack) -> Iterator[None]:
    """A worker that runs at the beginning, and none at the end."""
    stack.start_worker("0")
    yield
    for name in list(stack.workers):
        stack.stop_worker(name)


@pytest.fixture
def logs(stack: Stack) -> Logs:
    return Logs(stack.data_dir)


@pytest.fixture
def api(stack: Stack) -> Iterator[Api]:
    api = Api(stack.url)
    yield api
    api.http.close()


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    path = tmp_path / "stone.ply"
    path.write_bytes(write_mesh(SAMPLES["stone"].build(60), "ply"))
    return path


def reached(stack: Stack, job_id: str, iteration: int) -> bool:
    snapshots = stack.stores.jobs.get(job_id).snapshots
    return bool(snapshots) and snapshots[-1].iteration >= iteration


@pytest.mark.usefixtures("worker")
def test_a_poison_job_fails_after_its_cap_and_the_others_are_done(
    stack: Stack, logs: Logs, api: Api, mesh: Path, specimens: list[Specimen]
) -> None:
    ledger = Ledger(stack.url)
    poison = api.submit(mesh, **ENDLESS)["id"]
    for number in range(8):
        assert ledger.submit(specimens[number % len(specimens)], f"poison-{number}")
    killed: set[int] = set()

    def ended() -> bool:
        runner = logs.runner_of(poison)
        if runner is not None and runner not in killed:
            killed.add(runner)
            os.kill(runner, signal.SIGKILL)
        return bool(api.job(poison)["done"])

    wait_for(ended, limit_s=90)
    for job_id in ledger.acknowledged:
        api.finished(job_id)
    assert judge(ledger, logs) == Verdict()
    ledger.http.close()
    job = api.job(poison)
    assert (job["status"], job["error"]["code"]) == ("failed", "worker-lost")
    assert sum(line.action == "start" for line in logs.lines() if line.job_id == poison) == MAX_LOSSES + 1


def test_a_job_cancelled_while_no_worker_is_there_never_runs(
    stack: Stack, logs: Logs, api: Api, mesh: Path
) -> None:
    job_id = api.submit(mesh, **ENDLESS)["id"]
    assert api.http.post(f"/v1/jobs/{job_id}/cancel").json()["status"] == "cancelled"
    stack.start_worker("0")
    wait_for(lambda: any((line.action, line.job_id) == ("drop", job_id) for line in logs.lines()))
    stack.stop_worker("0")
    job = api.job(job_id)
    assert (job["status"], job["attempt"], job["snapshots"]["available"]) == ("cancelled", 0, [])


@pytest.mark.usefixtures("worker")
def test_a_cancel_outlives_the_worker_that_was_told(stack: Stack, api: Api, mesh: Path) -> None:
    job_id = api.submit(mesh, **ENDLESS)["id"]
    wait_for(lambda: reached(stack, job_id, 0))
    stack.workers["0"].send_signal(signal.SIGSTOP)  # so that it cannot end the job before it is killed
    assert api.http.post(f"/v1/jobs/{job_id}/cancel").status_code in {200, 202}
    stack.stop_worker("0", signal.SIGKILL)
    assert list((stack.data_dir / "tmp").iterdir()) == [], "nor does a killed worker leave temporary files"
    stack.start_worker("0")
    job = api.finished(job_id)
    assert (job["status"], job["attempt"]) == ("cancelled", 1)


@pytest.mark.usefixtures("worker")
@pytest.mark.parametrize("damage", ["flipped", "cut"])
def test_damaged_snapshots_are_passed_over_and_the_bytes_are_those_of_a_clean_run(
    stack: Stack, logs: Logs, api: Api, tmp_path: Path, damage: str
) -> None:
    long = specimen(tmp_path, "stone", 90, 150, 25)
    ledger = Ledger(stack.url)
    job_id = ledger.submit(long, f"damage-{damage}")
    assert job_id
    wait_for(lambda: reached(stack, job_id, 50), limit_s=60)
    stack.stop_worker("0", signal.SIGKILL)
    newest = stack.stores.jobs.get(job_id).snapshots[-1]
    file = stack.stores.blobs.root / newest.key
    content = file.read_bytes()
    half = len(content) // 2
    file.write_bytes(
        content[:half] + (b"" if damage == "cut" else bytes([content[half] ^ 255]) + content[half + 1 :])
    )
    for checkpoint in (stack.stores.blobs.root / "jobs" / job_id / "checkpoints").glob("*.npz"):
        checkpoint.write_bytes(b"")
    stack.start_worker("0")
    assert api.finished(job_id)["status"] == "successful"
    assert judge(ledger, logs) == Verdict()
    ledger.http.close()


def test_a_job_that_needs_too_much_memory_ends_alone(
    stack: Stack, api: Api, mesh: Path, tmp_path: Path
) -> None:
    """Runners get just what a small mesh needs, measured on one; a large mesh does not fit, the small one goes on."""
    stack.start_worker("0")
    small = api.submit(mesh, **ENDLESS)["id"]
    wait_for(lambda: reached(stack, small, 0))
    runner = Logs(stack.data_dir).runner_of(small)
    taken = int(Path(f"/proc/{runner}/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    stack.stop_worker("0")
    limits = {"SPHERIFY_RUNNER_MEMORY_BYTES": str(taken + (24 << 20))}
    process = stack.start_worker("0", concurrency=2, environment=limits)
    large = tmp_path / "large.ply"
    large.write_bytes(write_mesh(SAMPLES["stone"].build(160_000), "ply"))
    bomb = api.finished(api.submit(large, iterations="5")["id"])
    assert (bomb["status"], bomb["error"]["code"], bomb["attempt"]) == ("failed", "out-of-memory", 1)
    before = api.job(small)["progress"]["iteration"]
    wait_for(lambda: api.job(small)["progress"]["iteration"] > before, what="the other job going on")
    assert process.poll() is None
    api.http.post(f"/v1/jobs/{small}/cancel")
    assert api.finished(small)["status"] == "cancelled"
    stack.stop_worker("0")
