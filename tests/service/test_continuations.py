from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import httpx

from spherify.jobs.model import JobStatus
from spherify.stores.connect import Stores
from tests.service.conftest import Hand, problem
from tests.service.conftest import until as hold

Submit = Callable[..., Hand]


def test_a_finished_job_is_extended(client: httpx.Client, submitted: Submit, stores: Stores) -> None:
    parent = submitted().claim().reach(0).reach(100).reach(1000).end()
    path = client.get(f"/v1/jobs/{parent.job_id}").json()["links"]["extend"]
    answer = client.post(path, json={"iterations": 500, "snapshots": "every:250"})
    job = answer.json()
    assert answer.status_code == 201
    assert answer.headers["location"] == job["links"]["self"]
    assert answer.headers["retry-after"]
    assert (job["parent_id"], job["status"], job["name"]) == (parent.job_id, "accepted", "bunny")
    assert job["snapshots"]["requested"] == [0, 100, 1000, 1250, 1500]
    assert job["progress"]["iterations_total"] == 1500
    assert job["id"] in stores.queue.pending()
    child = Hand(stores, job["id"]).claim()
    assert child.job().spec.parent_id == parent.job_id


def test_repeated_with_a_key_it_is_one_job(client: httpx.Client, submitted: Submit) -> None:
    parent = submitted().claim().reach(0).reach(1000).end(JobStatus.FAILED, stop_reason=None)
    for path, body in (("extend", {"iterations": 5}), ("retry", None)):
        ids = {
            client.post(
                f"/v1/jobs/{parent.job_id}/{path}", json=body, headers={"Idempotency-Key": path}
            ).json()["id"]
            for _ in range(2)
        }
        assert len(ids) == 1


def test_what_cannot_go_on(client: httpx.Client, submitted: Submit) -> None:
    running = submitted().claim().reach(0)
    more = {"iterations": 10}
    problem(client.post(f"/v1/jobs/{running.job_id}/extend", json=more), 409, "job-not-finished")
    problem(client.post(f"/v1/jobs/{running.job_id}/retry"), 409, "job-not-finished")
    running.reach(1000).end(stop_reason="converged")
    path = f"/v1/jobs/{running.job_id}"
    assert not {"extend", "retry"} & client.get(path).json()["links"].keys()
    problem(client.post(f"{path}/extend", json=more), 409, "job-cannot-go-on")
    problem(client.post(f"{path}/retry"), 409, "job-cannot-go-on")
    assert client.delete(path).status_code == 204
    problem(client.post(f"{path}/extend", json=more), 410, "gone")
    problem(client.post("/v1/jobs/job_01K5Z9Q8M4T6V2X0Y7R3N1W5BC/retry"), 404, "not-found")


def test_wrong_extensions(client: httpx.Client, submitted: Submit, settings: object) -> None:
    path = f"/v1/jobs/{submitted().claim().reach(0).reach(1000).end().job_id}/extend"
    for body in ({}, {"iterations": 0}, {"iterations": 1, "preset": "paper"}, {"iterations": 10**6}):
        problem(client.post(path, json=body), 422, "invalid-parameters")
    document = problem(
        client.post(path, json={"iterations": 5, "snapshots": [9999]}), 422, "invalid-parameters"
    )
    assert document["errors"][0]["pointer"] == "#/snapshots"  # type: ignore[index]
    headers = {"Content-Type": "application/json"}
    problem(client.post(path, content=b"{", headers=headers), 400, "malformed-json")
    problem(client.post(path, data={"iterations": "5"}), 415, "unsupported-media-type")


def later(do: Callable[[], object], when: Callable[[], bool]) -> threading.Thread:
    def act() -> None:
        hold(when)
        do()

    thread = threading.Thread(target=act)
    thread.start()
    return thread


def test_a_look_that_waits_for_the_end(client: httpx.Client, submitted: Submit) -> None:
    hand = submitted().claim().reach(0)
    path = f"/v1/jobs/{hand.job_id}"
    assert client.get(path, params={"wait": 0.01}).json()["done"] is False
    thread = later(hand.reach(1000).end, lambda: True)
    assert client.get(path, params={"wait": 30}).json()["status"] == "successful"
    thread.join()
    assert client.get(path, params={"wait": 60}).json()["done"] is True
    problem(client.get(path, params={"wait": 61}), 422, "invalid-parameters")
    problem(client.get(path, params={"wate": 1}), 422, "invalid-parameters")


def test_a_look_that_waits_for_a_change(client: httpx.Client, submitted: Submit) -> None:
    hand = submitted().claim().reach(0)
    path = f"/v1/jobs/{hand.job_id}"
    seen = client.get(path)
    same = client.get(path, params={"wait": 0.01}, headers={"If-None-Match": seen.headers["etag"]})
    assert same.status_code == 304
    thread = later(lambda: hand.reach(100), lambda: True)
    changed = client.get(path, params={"wait": 30}, headers={"If-None-Match": seen.headers["etag"]})
    thread.join()
    assert changed.status_code == 200
    assert changed.json()["done"] is False
    assert changed.json()["rev"] > seen.json()["rev"]


def test_a_submission_that_waits_for_the_end(client: httpx.Client, stores: Stores, known: str) -> None:
    def run() -> None:
        Hand(stores, stores.jobs.find().items[0].id).claim().reach(0).reach(10).end()

    thread = later(run, lambda: bool(stores.jobs.find().items))
    asked: dict[str, Any] = {
        "json": {"mesh_id": known, "iterations": 10},
        "headers": {"Prefer": "respond-async, wait=30", "Idempotency-Key": "k"},
    }
    answer = client.post("/v1/jobs", **asked)
    thread.join()
    assert answer.status_code == 201
    assert answer.headers["preference-applied"] == "wait=30"
    assert answer.headers["location"] == answer.json()["links"]["self"]
    assert answer.json()["status"] == "successful"
    assert "idempotent-replayed" not in answer.headers
    again = client.post("/v1/jobs", **asked)
    assert again.json() == answer.json()
    assert again.headers["preference-applied"] == "wait=30"
    assert again.headers["idempotent-replayed"] == "true"
    plain = client.post(
        "/v1/jobs", json={"mesh_id": known, "iterations": 10}, headers={"Prefer": "wait=soon"}
    )
    assert (plain.status_code, plain.json()["status"]) == (201, "accepted")
    assert "preference-applied" not in plain.headers
