"""Idempotency-Key: whatever is sent twice, in a row, at once, or after a crash, is done once."""

from __future__ import annotations

import uuid
from concurrent.futures import ThreadPoolExecutor

import httpx
import pytest

import service.routes.jobs
from spherify.jobs import layout
from spherify.jobs.cancel import cancel
from spherify.jobs.errors import RequestInProgressError, StoreUnavailableError
from spherify.jobs.rebuild import rebuild
from spherify.stores import keys
from spherify.stores.connect import Stores
from spherify.stores.repeats import RedisRepeatStore
from tests.service.conftest import OCTAHEDRON, OPEN, problem, stretched, until


@pytest.fixture
def key() -> str:
    return str(uuid.uuid4())


def submit(client: httpx.Client, key: str, mesh: bytes = OCTAHEDRON, **fields: str) -> httpx.Response:
    form = {"iterations": "10", **fields}
    return client.post(
        "/v1/jobs", files={"file": ("o.obj", mesh)}, data=form, headers={"Idempotency-Key": key}
    )


def jobs(client: httpx.Client) -> int:
    return len(client.get("/v1/jobs").json()["items"])


def test_the_same_request_is_answered_as_before(client: httpx.Client, known: str, key: str) -> None:
    first = submit(client, key)
    assert first.status_code == 201, first.text
    again = submit(client, key)
    assert (again.status_code, again.content) == (201, first.content)
    assert again.headers["location"] == first.headers["location"]
    assert again.headers["idempotent-replayed"] == "true"
    assert "idempotent-replayed" not in first.headers
    assert jobs(client) == 1
    assert submit(client, f"{key}-other").json()["id"] != first.json()["id"]


def test_what_a_request_means_counts_and_not_its_bytes(client: httpx.Client, known: str, key: str) -> None:
    """Every form has another boundary; fields come in any order, defaults may be spelt out."""
    first = submit(client, key, preset="robust", name="a")
    assert submit(client, key, name="a").content == first.content
    asked = {"mesh_id": known, "iterations": 10}
    first = client.post("/v1/jobs", json=asked, headers={"Idempotency-Key": f"{key}-json"})
    spelt = asked | {"snapshots": "log:12", "preset": "robust"}
    again = client.post("/v1/jobs", json=spelt, headers={"Idempotency-Key": f"{key}-json"})
    assert again.content == first.content
    assert jobs(client) == 2


@pytest.mark.parametrize(
    ("mesh", "fields"), [(OCTAHEDRON, {"iterations": "11"}), (OCTAHEDRON + b"# else\n", {})]
)
def test_another_request_needs_another_key(
    client: httpx.Client, known: str, key: str, mesh: bytes, fields: dict[str, str]
) -> None:
    submit(client, key)
    problem(submit(client, key, mesh, **fields), 422, "idempotency-key-reused")
    assert jobs(client) == 1


def test_fifty_at_once_are_one_job(client: httpx.Client, known: str, key: str) -> None:
    def insist(_: int) -> httpx.Response:
        found: list[httpx.Response] = []

        def answered() -> bool:
            found.append(submit(client, key))
            return found[-1].status_code != 409

        until(answered)
        for refused in found[:-1]:
            problem(refused, 409, "idempotency-in-progress")
            assert refused.headers["retry-after"]
        return found[-1]

    with ThreadPoolExecutor(50) as pool:
        answers = list(pool.map(insist, range(50)))
    assert {answer.status_code for answer in answers} == {201}
    assert len({answer.content for answer in answers}) == 1
    assert sum("idempotent-replayed" not in answer.headers for answer in answers) == 1
    assert jobs(client) == 1


def test_a_refused_request_may_be_mended_and_sent_again(client: httpx.Client, key: str) -> None:
    problem(submit(client, key, OPEN), 422, "mesh-not-closed")
    assert submit(client, key, allow="boundary", mesh=OPEN).status_code == 201


def test_a_request_that_failed_half_way_makes_the_same_job_when_it_is_sent_again(
    client: httpx.Client, known: str, key: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The record was written, and then the server was away: nobody knows, and the client asks again."""
    made: list[str] = []
    whole = service.routes.jobs._submit

    def half(*arguments: object) -> object:
        made.append(whole(*arguments).id)  # type: ignore[arg-type]
        raise StoreUnavailableError("away")

    with monkeypatch.context() as patch:
        patch.setattr(service.routes.jobs, "_submit", half)
        problem(submit(client, key), 503, "not-ready")
    again = submit(client, key)
    assert again.status_code == 201
    assert [again.json()["id"]] == made
    assert jobs(client) == 1


def test_uploads_of_a_mesh_have_keys_too(client: httpx.Client, stores: Stores, key: str) -> None:
    def send(mesh: bytes) -> httpx.Response:
        return client.post("/v1/meshes", files={"file": ("o.obj", mesh)}, headers={"Idempotency-Key": key})

    first, again = send(stretched(1.5)), send(stretched(1.5))
    assert (first.status_code, again.status_code) == (201, 201)  # not 200: it is the answer of the first
    assert again.content == first.content
    problem(send(stretched(2.5)), 422, "idempotency-key-reused")


def test_a_key_outlives_the_loss_of_the_records(
    client: httpx.Client, stores: Stores, known: str, key: str
) -> None:
    first = submit(client, key).json()["id"]
    stores.client.flushdb()
    problem(submit(client, key), 503, "not-ready")  # it may be among those that are coming back
    assert rebuild(stores.stock)
    again = submit(client, key)
    assert (again.status_code, again.json()["id"]) == (201, first)
    assert again.headers["idempotent-replayed"] == "true"
    assert submit(client, key).headers["idempotent-replayed"] == "true"
    problem(submit(client, key, iterations="11"), 422, "idempotency-key-reused")
    assert jobs(client) == 1


def test_the_key_of_a_deleted_job_makes_no_other(
    client: httpx.Client, stores: Stores, known: str, key: str
) -> None:
    headers = {"Idempotency-Key": f"{key}-other"}
    parent = client.post("/v1/jobs", json={"mesh_id": known}).json()["links"]["self"]
    client.post(f"{parent}/cancel")
    for way in (
        lambda: submit(client, key),
        lambda: client.post("/v1/jobs", json={"mesh_id": known}, headers=headers),
        lambda: client.post(f"{parent}/retry", headers=headers),
    ):
        job_id = way().json()["id"]
        assert way().status_code == 201
        cancel(stores.jobs, stores.blobs, job_id)
        assert way().status_code == 201, "an end alone changes nothing"
        assert client.delete(f"/v1/jobs/{job_id}").status_code == 204
        for _ in range(2):
            problem(way(), 410, "gone")
    assert jobs(client) == 1, "the one to be tried again"
    problem(submit(client, key, iterations="11"), 422, "idempotency-key-reused")


def test_the_key_of_a_deleted_job_makes_no_other_after_the_loss_of_the_records(
    client: httpx.Client, stores: Stores, known: str, key: str
) -> None:
    job_id = submit(client, key).json()["id"]
    cancel(stores.jobs, stores.blobs, job_id)
    assert client.delete(f"/v1/jobs/{job_id}").status_code == 204
    stores.client.flushdb()
    assert rebuild(stores.stock)
    for _ in range(2):
        problem(submit(client, key), 410, "gone")
    problem(submit(client, key, iterations="11"), 422, "idempotency-key-reused")
    assert jobs(client) == 0
    assert list(stores.blobs.list(layout.job_folder(job_id))) == []


def test_a_key_is_free_after_a_request_for_what_is_gone(client: httpx.Client, known: str, key: str) -> None:
    """Nothing took effect: it can be mended and sent again as after any other refusal."""
    deleted = submit(client, f"{key}-other").json()["id"]
    client.post(f"/v1/jobs/{deleted}/cancel")
    assert client.delete(f"/v1/jobs/{deleted}").status_code == 204
    headers = {"Idempotency-Key": key}
    problem(client.post("/v1/jobs", json={"from_snapshot": f"{deleted}/0"}, headers=headers), 410, "gone")
    assert client.post("/v1/jobs", json={"mesh_id": known}, headers=headers).status_code == 201


@pytest.mark.parametrize("bad", ["", "a b", "x" * 256, "\x7f"])
def test_what_is_no_key_is_refused(client: httpx.Client, known: str, bad: str) -> None:
    problem(submit(client, bad), 422, "invalid-parameters")
    assert jobs(client) == 0


def test_a_day_and_no_longer(client: httpx.Client, stores: Stores, known: str, key: str) -> None:
    submit(client, key)
    names = list(stores.client.scan_iter(keys.repeat("*")))
    assert len(names) == 1
    assert 86_000 < stores.client.ttl(names[0]) <= 86_400


def test_whoever_died_over_a_request_leaves_its_identity(stores: Stores) -> None:
    hasty = RedisRepeatStore(stores.client, busy_s=0.05)
    assert hasty.begin("k", "f", "one").identity == "one"
    with pytest.raises(RequestInProgressError):
        stores.repeats.begin("k", "f", "two")
    found: list[str] = []

    def taken_up() -> bool:
        try:
            found.append(stores.repeats.begin("k", "f", "three").identity)
        except RequestInProgressError:
            return False
        return True

    until(taken_up)
    assert found == ["one"]
    stores.client.delete(keys.repeat("k"))
    stores.repeats.answered("k", "an answer to nothing")  # lost meanwhile
    assert stores.repeats.begin("k", "g", "four").identity == "four"
