"""What the service costs: jobs against a bare Celery task, polling against a bare FastAPI route.

All on this machine, in one run: one server of records and queue, workers of one process each, one API process.
"""

from __future__ import annotations

import contextlib
import json
import os
import socket
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import httpx
from redis import Redis

from benchmarks.bare_api import DOCUMENT
from benchmarks.pictures import bars
from benchmarks.raw_http import Connections
from spherify.cli.programs import Program
from spherify.cli.stack import Address, Stack
from spherify.formats import write_mesh
from spherify.geometry.samples.solids import icosphere
from spherify.stores.embedded import EmbeddedServer

WORKERS: Final = 2
JOBS: Final = 40
TASKS: Final = 400
ALONE: Final = 10  # one job after the other
REQUESTS: Final = 2_000
CONNECTIONS: Final = (1, 16)
READY_S: Final = 60.0
ROOT: Final = Path(__file__).resolve().parents[1]


def main() -> None:
    """Print rates and their ratios, and draw the ratios."""
    with tempfile.TemporaryDirectory(prefix="spherify-bench-") as scratch:
        folder = Path(scratch)
        server = EmbeddedServer(folder / "server")
        server.start()
        try:
            with Stack(
                Address("127.0.0.1", 0), folder / "data", WORKERS, _quiet, redis_url=server.url
            ) as stack:
                stack.start()
                rate, alone, job = _jobs(stack)
                polled = _polled(stack.port, f"/v1/jobs/{job['id']}")
            bare_rate, bare_alone = _bare_celery(server.url, folder)
        finally:
            server.stop()
        with _bare_api(job, folder) as port:
            bare_polled = _polled(port, f"/v1/jobs/{job['id']}")
    print(f"Jobs of no iterations through {WORKERS} workers, tasks that do nothing through as many.")
    print(f"{'':<34} {'service':>10} {'bare':>10} {'ratio':>8}")
    _row("jobs a second, against Celery", rate, bare_rate)
    _row("ms for one job alone", alone * 1e3, bare_alone * 1e3)
    ratios = []
    for count, ours, theirs in zip(CONNECTIONS, polled, bare_polled, strict=True):
        _row(f"polls a second, {count} connections", ours, theirs)
        ratios.append(ours / theirs)
    labels = ["jobs a second", *(f"polls a second,\n{count} connections" for count in CONNECTIONS)]
    series = {"service over bare Celery, FastAPI": [rate / bare_rate, *ratios]}
    print("drawn:", bars("service", "What is left of the bare rate", labels, series, unit="ratio").name)


def _row(what: str, ours: float, theirs: float) -> None:
    print(f"{what:<34} {ours:>10.1f} {theirs:>10.1f} {ours / theirs:>7.2f}×", flush=True)


def _quiet(_name: str, _line: str) -> None:
    """Leave the programs' logs aside."""


def _jobs(stack: Stack) -> tuple[float, float, dict[str, Any]]:
    """Return jobs a second, seconds from the request to the end of one alone, and one job."""
    with httpx.Client(base_url=stack.url, timeout=60, trust_env=False) as client:
        mesh = client.put(
            "/v1/meshes", params={"name": "ball.ply"}, content=write_mesh(icosphere(4), "ply")
        ).json()
        order = {"mesh_id": mesh["id"], "iterations": 0}
        job: dict[str, Any] = {}
        alone = []
        for _ in range(ALONE):
            began = time.perf_counter()
            job = _submitted(client, order)
            _until(lambda job=job: client.get(f"/v1/jobs/{job['id']}").json()["done"])
            alone.append(time.perf_counter() - began)
        began = time.perf_counter()
        for _ in range(JOBS):
            _submitted(client, order)
        _until(lambda: client.get("/v1/info").json()["jobs"]["successful"] >= ALONE + JOBS)
        rate = JOBS / (time.perf_counter() - began)
        return rate, sorted(alone)[ALONE // 2], client.get(f"/v1/jobs/{job['id']}").json()


def _submitted(client: httpx.Client, order: dict[str, Any]) -> dict[str, Any]:
    answer = client.post("/v1/jobs", json=order)
    if answer.is_error:
        raise AssertionError(answer.text)
    return dict(answer.json())


def _bare_celery(url: str, folder: Path) -> tuple[float, float]:
    """Return tasks a second, and seconds for one alone."""
    os.environ["BENCH_BROKER"] = url.replace("db=0", "db=1")
    from benchmarks.bare_celery import DONE, URL, say  # noqa: PLC0415 - it reads the address when it is loaded

    with contextlib.ExitStack() as programs, Redis.from_url(URL) as results:
        for number in range(WORKERS):
            command = ["-m", "benchmarks.bare_celery", "--concurrency=1", f"--hostname=bare-{number}@bench"]
            programs.enter_context(_program(f"bare-{number}", command, folder))
        say.delay(0)
        if results.blpop([DONE], timeout=READY_S) is None:
            raise AssertionError("the bare worker does not answer")
        alone = []
        for number in range(ALONE):
            began = time.perf_counter()
            say.delay(number)
            results.blpop([DONE], timeout=READY_S)
            alone.append(time.perf_counter() - began)
        began = time.perf_counter()
        for number in range(TASKS):
            say.delay(number)
        for _ in range(TASKS):
            results.blpop([DONE], timeout=READY_S)
        return TASKS / (time.perf_counter() - began), sorted(alone)[ALONE // 2]


@contextlib.contextmanager
def _bare_api(job: dict[str, Any], folder: Path) -> Iterator[int]:
    """Serve the bare route; its port."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        fd, port = listener.fileno(), int(listener.getsockname()[1])
        os.environ[DOCUMENT] = json.dumps(job)
        with _program("bare-api", ["-m", "benchmarks.serve_bare_api", str(fd)], folder, keep_open=[fd]):
            yield port


@contextlib.contextmanager
def _program(
    name: str, command: list[str], folder: Path, keep_open: list[int] | None = None
) -> Iterator[None]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    program = Program(
        name, [sys.executable, *command], environment, _quiet, folder=folder, keep_open=keep_open or []
    )
    program.start()
    try:
        yield
    finally:
        program.terminate()
        program.reap(time.monotonic() + 5)


def _polled(port: int, path: str) -> list[float]:
    """Return requests a second for each number of connections."""
    rates = []
    for count in CONNECTIONS:
        with Connections(port, count) as connections:
            connections.per_second(path, REQUESTS // 10)
            rates.append(connections.per_second(path, REQUESTS))
    return rates


def _until(look: Any) -> None:  # noqa: ANN401 - any question
    deadline = time.monotonic() + READY_S
    while not look():
        if time.monotonic() > deadline:
            raise AssertionError(f"not within {READY_S:g} s")
        time.sleep(0.005)
