"""What takes too long, or too much of the machine, for every day: `make drills` (`ARGS="-k campaign"` for one).

Rows 1, 2, 4 to 7, 9, 14, 15, 16, 18 and 23 of docs/durability.md at their full numbers. Figures are printed.
"""

from __future__ import annotations

import errno
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import httpx
import pytest

from spherify.jobs.cancel import cancel
from spherify.jobs.model import JobStatus
from spherify.jobs.ports import CancelOutcome
from tests.faults.campaign import SHORT, campaign, say
from tests.faults.chaos import ChaosProxy
from tests.faults.ledger import Ledger, Verdict, judge
from tests.faults.leftovers import assert_nothing_left, usage
from tests.faults.logs import Logs
from tests.faults.polling import Clients
from tests.faults.specimens import Specimen, specimen
from tests.jobs.examples import ENDLESS, job_spec, stone, store_mesh
from tests.processes import below
from tests.stack import ROOT, Stack, started_stack, wait_for
from tests.worker.observation import actions, runner_of, submitted

pytestmark = [pytest.mark.drill, pytest.mark.timeout(4 * 3600)]
CLOCK = Path(__file__).parent / "clock"
SOAK_S = float(os.environ.get("DRILL_SOAK_S", "7200"))
SOAK_EVERY_S = 3.0  # between two jobs
SOAK_WARM = 60  # jobs after which whatever is kept to be used again is there
# After each of these a process is killed in the middle of its work: who slept is fenced, and its runner killed.
SOAK_KILLS = ("kill_worker", "kill_child", "kill_runner", "freeze_worker")
SOAK_FAULTS = ("kill_worker", "kill_child", "kill_runner", "kill_broker", "stop_worker", "freeze_worker")
AS_DELIVERED: dict[str, str] = {}  # lease 30 s, heartbeat 5 s, scan 5 s, 3 losses
EXIT_S = 10.0  # from SIGTERM to the end of a worker
DEAF_ATTEMPTS = 5  # at jobs whose runners do not hear that their worker is to end
REBUILD_S = 30.0  # from the loss of all records until they are back
LONG = 500  # iterations of a job that takes seconds
RECOVERY_S = 45.0  # lease, scan, and 10 s for everything else
EVERYTHING = {"kill_worker": 20, "kill_child": 10, "kill_runner": 10, "kill_broker": 5, "flush": 3}


def test_campaign_of_200_jobs_under_everything(tmp_path: Path, specimens: list[Specimen]) -> None:
    """With the settings as they are delivered."""
    with campaign(tmp_path, seed=200, environment=AS_DELIVERED) as one:
        assert one.run(specimens, 200, EVERYTHING, limit_s=3600) == Verdict()
        assert one.figures["slowest_recovery_s"] <= RECOVERY_S
        assert one.figures["resumed"] >= 1
        assert one.figures["rebuilds"] == EVERYTHING["flush"]
        assert one.figures["slowest_rebuild_s"] <= REBUILD_S


def test_rolling_restarts(tmp_path: Path) -> None:
    """Workers told to end, again and again, amid jobs that take longer than they have: seconds of work are lost."""
    long = specimen(tmp_path, "stone", 20_000, LONG, LONG // 4)
    with campaign(tmp_path, seed=9, environment=AS_DELIVERED) as one:
        assert one.run([long], 10, {"stop_worker": 20}, limit_s=3600) == Verdict()
        assert len(one.exits) == 20
        assert max(one.exits) <= EXIT_S
        assert one.most_losses() == 0, "a worker that is told to stop hands on"
        assert one.figures["resumed"] >= 1


def test_workers_with_deaf_runners_are_stopped_in_time(tmp_path: Path) -> None:
    """Two runners stand still, as in a long call of a library, and are killed after the grace as it is delivered."""
    exits: list[float] = []
    with started_stack(tmp_path, workers=0, api=False, environment=AS_DELIVERED) as stack:
        store_mesh(stack.stores.meshes, stack.stores.blobs, stone())
        jobs = [submitted(stack, job_spec(**ENDLESS, snapshots="2")) for _ in range(2)]
        for attempt in range(1, DEAF_ATTEMPTS + 1):
            worker = stack.start_worker("deaf", concurrency=2)
            for job_id in jobs:
                wait_for(lambda i=job_id, n=attempt: actions(stack, i).count("start") == n, limit_s=60)
                os.kill(runner_of(stack, job_id), signal.SIGSTOP)
            began = time.monotonic()
            worker.send_signal(signal.SIGTERM)
            assert worker.wait(60) == 0
            exits.append(time.monotonic() - began)
        for job_id in jobs:
            job = stack.stores.jobs.get(job_id)
            assert (job.status, job.losses, job.attempt) == (JobStatus.ACCEPTED, 0, DEAF_ATTEMPTS)
            assert cancel(stack.stores.jobs, stack.stores.blobs, job_id) is CancelOutcome.CANCELLED
    say(f"with deaf runners a worker ended within {max(exits):.1f} s: {[round(s, 1) for s in exits]}")
    assert max(exits) <= EXIT_S


def test_campaign_of_150_jobs_under_silence_and_sleep(tmp_path: Path, specimens: list[Specimen]) -> None:
    with campaign(tmp_path, seed=150, through_proxy=True) as one:
        assert one.run(specimens, 150, {"half_open": 6, "freeze_worker": 5}, limit_s=3600) == Verdict()
        assert one.figures["fenced"] >= 1


def test_workers_whose_clocks_are_wrong_by_an_hour(tmp_path: Path, specimens: list[Specimen]) -> None:
    with started_stack(tmp_path, workers=0, environment=SHORT) as stack:
        for name, offset in (("early", -3600), ("late", 3600)):
            path = os.pathsep.join([str(CLOCK), os.environ.get("PYTHONPATH", "")])
            stack.start_worker(name, environment={"PYTHONPATH": path, "CLOCK_OFFSET_S": str(offset)})
        ledger = Ledger(stack.url)
        for number in range(24):
            assert ledger.submit(specimens[number % len(specimens)], f"clock-{number}")
        jobs = stack.stores.jobs
        wait_for(lambda: all(jobs.get(i).status.done for i in ledger.acknowledged), limit_s=300)
        assert judge(ledger, Logs(tmp_path)) == Verdict()
        assert {jobs.get(job_id).attempt for job_id in ledger.acknowledged} == {1}
        ledger.http.close()


@pytest.mark.parametrize("how", ["refused", "hung"])
def test_a_broker_that_is_away_for_a_minute(tmp_path: Path, specimens: list[Specimen], how: str) -> None:
    """Every answer is a 503 that says when to ask again, and soon; afterwards everything goes on."""
    with started_stack(tmp_path, workers=1, api=False, environment=SHORT) as stack, ExitStack() as exits:
        proxy = exits.enter_context(ChaosProxy(stack.server.url))
        stack.environment["REDIS_URL"] = proxy.url
        stack.start_api()
        ledger = Ledger(stack.url)
        jobs = [ledger.submit(specimens[0], f"before-{number}") for number in range(6)]
        mesh = ledger.http.get(f"/v1/jobs/{jobs[0]}").json()["mesh_id"]
        if how == "refused":
            stack.server.stop()
        else:
            proxy.hang()
        slowest: dict[str, float] = {}
        till = time.monotonic() + 60
        while time.monotonic() < till:
            for path in ("/v1/jobs", f"/v1/jobs/{jobs[0]}", f"/v1/meshes/{mesh}", "/readyz"):
                _timed(slowest, lambda path=path: ledger.http.get(path), path)
            _timed(slowest, lambda: _submit(ledger, specimens[1]), "POST /v1/jobs")
        assert ledger.http.get("/healthz").status_code == 200
        if how == "refused":
            stack.server.start()
        proxy.heal()
        wait_for(lambda: ledger.http.get("/readyz").status_code == 200, limit_s=30)
        wait_for(lambda: all(ledger.http.get(f"/v1/jobs/{i}").json()["done"] for i in jobs), limit_s=120)
        assert judge(ledger, Logs(tmp_path)) == Verdict()
        losses = [stack.stores.jobs.get(job_id).losses for job_id in ledger.acknowledged]
        ledger.http.close()
        say(f"broker {how}: slowest {slowest}, losses counted {losses}")
        assert max(losses) == 0, "the server was lost, and no worker"
        assert max(slowest.values()) < (1 if how == "refused" else 2)


def test_slow_clients_do_not_keep_others_waiting(tmp_path: Path) -> None:
    """200 bodies of a byte a second and 200 headers that never end, beside everybody else."""
    with started_stack(tmp_path, workers=1, environment=SHORT) as stack, ExitStack() as exits:
        where = httpx.URL(stack.url)
        heads = [
            b"PUT /v1/meshes?name=a.ply HTTP/1.1\r\nHost: x\r\nContent-Length: 100000\r\n\r\n",
            b"GET / HT",
        ]
        slow = [exits.enter_context(socket.create_connection((where.host, where.port))) for _ in range(400)]
        for number, connection in enumerate(slow):
            connection.sendall(heads[number % 2])
            connection.setblocking(False)
        done = threading.Event()
        cut: dict[socket.socket, float] = {}
        began = time.monotonic()

        def trickle() -> None:
            while not done.wait(1):
                for connection in slow:
                    try:
                        connection.send(b"a")
                        connection.recv(1)  # an answer, or the end: both mean that it was dropped
                        cut.setdefault(connection, time.monotonic() - began)
                    except BlockingIOError:
                        continue
                    except OSError:
                        cut.setdefault(connection, time.monotonic() - began)

        thread = threading.Thread(target=trickle)
        thread.start()
        try:
            polled = Clients(
                where.host, where.port or 80, "/v1/jobs", clients=20, period_s=0.2, rounds=200
            ).poll()
            wait_for(lambda: len(cut) == len(slow), limit_s=60, what="the end of the slow ones")
        finally:
            done.set()
            thread.join()
        say(f"slow clients: p99 {polled.percentile(0.99):.3f} s, all cut after {max(cut.values()):.0f} s")
        assert polled.errors == []
        assert polled.percentile(0.99) < 1


def test_ten_thousand_open_connections(tmp_path: Path, specimens: list[Specimen]) -> None:
    with started_stack(tmp_path, workers=1, api=False, environment=SHORT) as stack, _two_apis(stack) as port:
        ledger = Ledger(f"http://127.0.0.1:{port}")
        job_id = ledger.submit(specimens[0], "polled")
        wait_for(lambda: ledger.http.get(f"/v1/jobs/{job_id}").json()["done"], limit_s=60)
        ledger.http.close()
        polled = Clients(
            "127.0.0.1", port, f"/v1/jobs/{job_id}", clients=10_000, period_s=10, rounds=6
        ).poll()
        times = ", ".join(f"p{100 * share:g} {polled.percentile(share):.3f} s" for share in (0.5, 0.99, 1))
        say(f"10,000 connections: {len(polled.seconds)} answers, {times}")
        say(f"the clients took {polled.cpu_s / polled.took_s:.2f} of a core")
        assert polled.errors == []
        assert polled.percentile(0.99) < 1


def test_a_full_disk(tmp_path: Path, specimens: list[Specimen]) -> None:
    """The data folder and the server's log on 6 MB: nothing torn, and back by itself when there is room."""
    if os.geteuid() != 0:
        pytest.skip("NOT DRILLED: mounting a small file system needs root")
    with _small_disk(tmp_path / "small"):
        settings = SHORT | {"SPHERIFY_MIN_FREE_BYTES": "65536"}
        with started_stack(tmp_path / "small", workers=1, environment=settings) as stack:
            ledger = Ledger(stack.url)
            jobs = [ledger.submit(specimens[0], "first")]
            wait_for(lambda: ledger.http.get(f"/v1/jobs/{jobs[0]}").json()["done"], limit_s=60)
            ballast = tmp_path / "small" / "ballast"
            _fill(ballast)
            name, content = specimens[1].name, specimens[1].content
            answer = ledger.http.put(f"/v1/meshes?name={name}", content=content)
            assert answer.status_code in {507, 503}, answer.text
            assert answer.headers["content-type"] == "application/problem+json"
            ballast.unlink()

            def server_back() -> bool:
                if not stack.server.alive:
                    stack.server.start()
                return ledger.http.get("/readyz").status_code == 200

            wait_for(server_back, limit_s=60)
            wait_for(lambda: ledger.submit(specimens[1], "second"), limit_s=60)
            jobs_done = stack.stores.jobs.get
            wait_for(lambda: all(jobs_done(i).status.done for i in ledger.acknowledged), limit_s=120)
            assert judge(ledger, Logs(stack.data_dir)) == Verdict()
            assert list(stack.stores.blobs.scratch().iterdir()) == []
            ledger.http.close()


def test_soak(tmp_path: Path, specimens: list[Specimen]) -> None:
    """A fault about every 20 s for two hours (DRILL_SOAK_S): nothing lost, and nothing that grows."""
    jobs, faults = round(SOAK_S / SOAK_EVERY_S), max(1, round(SOAK_S / 20 / len(SOAK_FAULTS)))
    with campaign(tmp_path, seed=23) as one:
        api = one.stack._processes[0].pid
        worker = one.stack.start_worker("steady")
        one.injectors.spared = "steady"
        assert one.run(specimens, SOAK_WARM, {}, limit_s=600) == Verdict()
        before = {name: usage(pid) for name, pid in _long_lived(api, worker.pid).items()}
        verdict = one.run(
            specimens,
            jobs,
            dict.fromkeys(SOAK_FAULTS, faults),
            limit_s=4 * SOAK_S + 600,
            every_s=SOAK_EVERY_S,
        )
        assert verdict == Verdict()
        after = {name: usage(pid) for name, pid in _long_lived(api, worker.pid).items()}
        for name, old in before.items():
            say(f"soak: {name} {old} → {after[name]}")
        kills = sum(hit.fault in SOAK_KILLS for hit in one.injectors.hits)
        assert_nothing_left(one.stack, set(one.ledger.acknowledged), kills=kills)
        for name, old in before.items():
            assert after[name].memory < 1.1 * old.memory, name
            assert after[name].files <= old.files + 8, name  # a pool of connections breathes


def _long_lived(api: int, worker: int) -> dict[str, int]:
    """Return the processes that live as long as the soak; a new number would mean that one was started again."""
    pool, server = (
        seen.pid for seen in sorted(below(worker, "-m worker"), key=lambda seen: seen.parent != worker)
    )
    return {"API": api, "worker": worker, "pool process": pool, "fork server": server}


def _timed(slowest: dict[str, float], ask: Callable[[], httpx.Response], name: str) -> None:
    began = time.monotonic()
    answer = ask()
    slowest[name] = max(slowest.get(name, 0.0), round(time.monotonic() - began, 3))
    assert answer.status_code == httpx.codes.SERVICE_UNAVAILABLE
    assert answer.headers["retry-after"]


def _submit(ledger: Ledger, specimen: Specimen) -> httpx.Response:
    files = {"file": (specimen.name, specimen.content)}
    return ledger.http.post("/v1/jobs", files=files, data=specimen.fields)


@contextmanager
def _two_apis(stack: Stack) -> Iterator[int]:
    with socket.create_server(("127.0.0.1", 0), backlog=4096) as listener:
        command = [sys.executable, "-m", "service", f"--fd={listener.fileno()}"]
        processes = []
        for number in range(2):
            with stack.log(f"api-{number}").open("wb") as log:
                processes.append(
                    subprocess.Popen(
                        command,
                        cwd=ROOT,
                        env=stack.environment,
                        pass_fds=[listener.fileno()],
                        stdout=log,
                        stderr=log,
                    )
                )
        try:
            yield int(listener.getsockname()[1])
        finally:
            for process in processes:
                process.terminate()
            for process in processes:
                process.wait(20)


def _fill(path: Path) -> None:
    """Write until nothing fits any more."""
    try:
        with path.open("wb", buffering=0) as file:
            while file.write(bytes(4096)):
                pass
    except OSError as e:
        if e.errno != errno.ENOSPC:
            raise


@contextmanager
def _small_disk(folder: Path) -> Iterator[None]:
    folder.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=6m", "tmpfs", str(folder)], check=True)
    try:
        yield
    finally:
        subprocess.run(["umount", str(folder)], check=True)
