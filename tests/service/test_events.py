from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import httpx
import pytest

from service import events as module
from service.events import Teller
from service.watch import Sight
from spherify.jobs.model import Job, JobStatus, Progress, Snapshot
from spherify.jobs.rebuild import rebuild
from spherify.settings import Settings
from spherify.stores.connect import Stores, open_stores
from spherify.stores.embedded import EmbeddedServer
from tests.jobs.examples import job_spec
from tests.service.conftest import OCTAHEDRON, Hand, problem, serve
from tests.service.conftest import until as hold
from tests.service.sse import Event, events, until

Submit = Callable[..., Hand]
ROOT = Path(__file__).resolve().parents[2]


def names(read: list[Event]) -> list[str]:
    return [event.name for event in read]


def iterations(read: list[Event]) -> list[int]:
    return [event.data["iteration"] for event in read if event.name == "snapshot"]


def test_a_life_from_the_queue_to_the_end(client: httpx.Client, submitted: Submit) -> None:
    hand = submitted()
    with events(client, hand.job_id) as found:
        first = next(found)
        assert (first.name, first.data["status"], first.data["queue"]) == (
            "status",
            "accepted",
            {"position": 0},
        )
        assert first.data == client.get(f"/v1/jobs/{hand.job_id}").json()
        hand.claim()
        assert until(found, "status")[-1].data["status"] == "running"
        hand.reach(0)
        kept = until(found, "snapshot")[-1]
        assert kept.data == client.get(f"/v1/jobs/{hand.job_id}/snapshots/0").json()
        hand.reach(40, keep=False)
        told = until(found, "progress")
        while told[-1].data["progress"]["iteration"] != 40:
            told = until(found, "progress")
        assert told[-1].data.keys() == {"rev", "status", "progress", "queue", "metrics"}
        assert told[-1].data["metrics"]["sphericity"] == pytest.approx(0.9 + 40e-6)
        hand.reach(100).reach(1000).end()
        last = until(found, "done")
        assert iterations(last) == [100, 1000]
        assert names(last)[-1] == "done"
        assert last[-1].data == client.get(f"/v1/jobs/{hand.job_id}").json()
        assert list(found) == [], "nothing comes after the end"
    assert len({event.id for event in (first, kept, *told, *last)}) >= 4


def test_who_comes_back_is_told_every_snapshot_since(client: httpx.Client, submitted: Submit) -> None:
    hand = submitted().claim().reach(0).reach(100)
    with events(client, hand.job_id) as found:
        seen = [next(found) for _ in range(3)]
    assert names(seen) == ["status", "snapshot", "snapshot"]
    hand.reach(500)
    for event, missed in ((seen[0], [0, 100, 500]), (seen[1], [100, 500]), (seen[2], [500])):
        with events(client, hand.job_id, event.id) as found:
            read = [next(found) for _ in range(len(missed) + 1)]
            assert read[0].name == "status"
            assert iterations(read) == missed
    hand.reach(333).reach(1000).end()  # the best state, found in hindsight
    with events(client, hand.job_id, read[-1].id) as found:
        assert iterations(until(found, "done")) == [333, 1000]


def test_after_the_end_nobody_need_come_back(client: httpx.Client, submitted: Submit) -> None:
    hand = submitted().claim().reach(0).reach(1000).end(JobStatus.FAILED)
    with events(client, hand.job_id) as found:
        read = list(found)
    assert names(read) == ["status", "snapshot", "snapshot", "done"]
    again = client.get(f"/v1/jobs/{hand.job_id}/events", headers={"Last-Event-ID": read[-1].id})
    assert (again.status_code, again.content) == (204, b"")
    for other in (read[0].id, "nonsense", "1.5.done.more"):  # not the end, or not of ours
        with events(client, hand.job_id, other) as found:
            assert names(list(found))[-1] == "done"


def test_jobs_that_are_not_there(client: httpx.Client, submitted: Submit) -> None:
    hand = submitted().claim().reach(0).end()
    path = f"/v1/jobs/{hand.job_id}/events"
    assert client.delete(f"/v1/jobs/{hand.job_id}").status_code == 204
    problem(client.get(path), 410, "gone")
    problem(client.get(path, headers={"Last-Event-ID": "9.1000.done"}), 410, "gone")
    problem(client.get("/v1/jobs/job_01K5Z9Q8M4T6V2X0Y7R3N1W5BC/events"), 404, "not-found")


def test_head_does_not_wait(client: httpx.Client, submitted: Submit) -> None:
    answer = client.head(f"/v1/jobs/{submitted().job_id}/events")
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("text/event-stream")


def test_a_quiet_stream_shows_that_it_lives(
    client: httpx.Client, submitted: Submit, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "HEARTBEAT_S", 0.05)
    with events(client, submitted().job_id) as found:
        assert next(found).name == "status"
        for _ in range(3):
            assert next(found).comments


@pytest.fixture
def own(tmp_path: Path) -> Iterator[tuple[EmbeddedServer, Stores, str]]:
    """A service on a server of its own, which may be stopped."""
    server = EmbeddedServer(tmp_path / "redis")
    server.start()
    settings = Settings(redis_url=server.url, data_dir=tmp_path / "data")
    stores = open_stores(settings)
    rebuild(stores.stock)  # a new server knows of no records: that there are none is found out first
    with serve(settings, stores) as url:
        yield server, stores, url
    stores.close()
    server.stop()


def test_a_stream_outlives_a_restart_of_the_store(own: tuple[EmbeddedServer, Stores, str]) -> None:
    server, stores, url = own
    with httpx.Client(base_url=url, timeout=30) as client:
        mesh = client.put("/v1/meshes?name=o.obj", content=OCTAHEDRON).json()["id"]
        job = client.post("/v1/jobs", json={"mesh_id": mesh, "iterations": 1000}).json()
        hand = Hand(stores, job["id"]).claim().reach(0)
        with events(client, hand.job_id) as found:
            assert iterations(until(found, "snapshot")) == [0]
            server.stop()
            problem(client.get(f"/v1/jobs/{hand.job_id}"), 503, "not-ready")
            server.start()
            hand.reach(1000).end()
            assert iterations(until(found, "done")) == [1000]


def test_followers_share_one_look_and_leave_nothing(
    stores: Stores, settings: Settings, submitted: Submit, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[int] = []
    get_all = type(stores.jobs).get_all
    hand, other = submitted().claim().reach(0), submitted()

    def counted(self: object, known: dict[str, object]) -> object:
        if None not in known.values():  # a look; who comes asks for what is not known yet
            asked.append(len(known))
        return get_all(self, known)  # type: ignore[arg-type]

    monkeypatch.setattr(type(stores.jobs), "get_all", counted)
    limits = httpx.Limits(max_connections=100)
    with serve(settings, stores) as url, httpx.Client(base_url=url, timeout=30, limits=limits) as client:
        with ExitStack() as stack:
            streams = [stack.enter_context(events(client, hand.job_id)) for _ in range(40)]
            streams.append(stack.enter_context(events(client, other.job_id)))
            hold(lambda: 2 in asked)
            hand.reach(1000).end()
            for stream in streams[:-1]:
                assert iterations(until(stream, "done")) == [0, 1000]
            assert max(asked) == 2, "one look at two jobs, however many follow them"
        asked_then = len(asked)
        with events(client, hand.job_id) as found:
            list(found)
        assert len(asked) <= asked_then + 2, "nobody looks when nobody follows"


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_open_streams_do_not_hold_a_stop_up(
    settings: Settings, stores: Stores, submitted: Submit, number: signal.Signals
) -> None:
    hand = submitted().claim().reach(0)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "service", f"--port={port}"]
    environment = os.environ | {"REDIS_URL": settings.redis_url, "SPHERIFY_DATA_DIR": str(settings.data_dir)}
    with subprocess.Popen(command, env=environment, cwd=ROOT, stderr=subprocess.PIPE, text=True) as process:
        try:
            with httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=30) as client:

                def ready() -> bool:
                    try:
                        return client.get("/healthz").status_code == 200
                    except httpx.ConnectError:
                        return False

                hold(ready)
                with ExitStack() as stack:
                    streams = [stack.enter_context(events(client, hand.job_id)) for _ in range(5)]
                    for stream in streams:
                        until(stream, "snapshot")
                    process.send_signal(number)
                    for stream in streams:
                        assert "done" not in names(list(stream)), "ended whole, to be come back to"
            _, errors = process.communicate(timeout=20)
        finally:
            process.kill()
    assert "Traceback" not in errors
    assert "Cancel" not in errors, "no request had to be broken off"


def sight(
    status: JobStatus = JobStatus.RUNNING, rev: int = 1, at: int = 0, kept: tuple[int, ...] = ()
) -> Sight:
    snapshots = tuple(Snapshot(i, "k", "0" * 64, 1, {"sphericity": 0.5}, 1.0) for i in kept)
    job = Job(
        job_spec(iterations=1000),
        status,
        rev=rev,
        attempt=1,
        progress=Progress(at, 1000),
        snapshots=snapshots,
    )
    return Sight(job)


def told(teller: Teller, seen: Sight, now: float) -> tuple[list[str], bool]:
    found, last = teller.news(seen, now)
    return [event.split(b"\n")[0].decode().removeprefix("event: ") for event in found], last


def test_progress_is_told_twice_a_second_at_most_and_none_is_left_out_at_the_end() -> None:
    teller = Teller("/", "req", None)
    assert told(teller, sight(at=1), 0.0) == (["status"], False)
    assert told(teller, sight(rev=2, at=2), 0.1) == ([], False)
    assert teller.due == 0.5
    assert told(teller, sight(rev=3, at=3), 0.3) == ([], False)
    assert told(teller, sight(rev=3, at=3), 0.5) == (["progress"], False)
    assert teller.due == float("inf")
    assert told(teller, sight(rev=3, at=3), 5.0) == ([], False), "nothing new"
    assert told(teller, sight(rev=4, at=3, kept=(0,)), 5.1) == (["snapshot", "progress"], False)
    assert told(teller, sight(rev=5, at=4, kept=(0, 1000)), 5.2) == (["snapshot"], False), "at once"
    ended = sight(JobStatus.SUCCESSFUL, rev=6, at=5, kept=(0, 1000))
    assert told(teller, ended, 5.3) == (["status", "done"], True)


def test_a_job_deleted_behind_the_back_of_a_stream_ends_it() -> None:
    teller = Teller("/v1/jobs/x/events", "req", None)
    told(teller, sight(), 0.0)
    found, last = teller.news(replace(sight(), gone=True), 1.0)
    assert last
    assert b"event: gone" in found[0]
    assert b'"type": "/problems/gone"' in found[0]


def test_another_attempt_is_told_as_a_change_of_status() -> None:
    teller = Teller("/", "req", None)
    told(teller, sight(), 0.0)
    again = sight(rev=9)
    assert told(teller, replace(again, job=replace(again.job, attempt=2)), 0.1)[0] == ["status"]
