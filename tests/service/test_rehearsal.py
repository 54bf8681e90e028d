"""Dry runs, and jobs that begin with another one's state."""

from __future__ import annotations

from collections.abc import Callable

import httpx
import numpy as np
import pytest

from service.arrays import load_mesh
from spherify.jobs.estimate import estimate
from spherify.parameters import resolve
from spherify.stores.connect import Stores
from tests.service.conftest import OCTAHEDRON, OPEN, Hand, problem


def test_a_dry_run_says_what_the_job_would_be_and_makes_none(client: httpx.Client, known: str) -> None:
    asked = {"mesh_id": known, "preset": "paper", "iterations": 50, "snapshots": [10], "tags": ["a"]}
    answer = client.post("/v1/jobs?dry_run=true", json=asked)
    assert answer.status_code == 200
    said = answer.json()
    assert said["mesh"]["id"] == known
    assert said["snapshots"]["requested"] == [0, 10, 50]
    assert said["estimate"]["seconds"] > 0
    assert client.get("/v1/jobs").json()["items"] == []
    made = client.post("/v1/jobs?dry_run=false", json=asked).json()
    for name in ("name", "tags", "preset", "parameters"):
        assert said[name] == made[name]


def test_a_dry_run_with_a_file_keeps_the_mesh(client: httpx.Client) -> None:
    answer = client.post(
        "/v1/jobs?dry_run=true", files={"file": ("cat.obj", OCTAHEDRON)}, data={"step": "0.02"}
    )
    said = answer.json()
    assert (answer.status_code, said["name"], said["parameters"]["step"]) == (200, "cat", 0.02)
    assert client.get(said["mesh"]["links"]["self"]).status_code == 200
    assert client.get("/v1/jobs").json()["items"] == []


def test_a_dry_run_refuses_what_the_run_would(client: httpx.Client, known: str) -> None:
    dry = "/v1/jobs?dry_run=true"
    problem(client.post(dry, files={"file": ("open.obj", OPEN)}), 422, "mesh-not-closed")
    problem(client.post(dry, json={"mesh_id": known, "iterations": -1}), 422, "invalid-parameters")
    problem(client.post(dry, json={"mesh_id": "mesh_" + "0" * 26}), 422, "invalid-parameters")
    problem(
        client.post(dry, content=b"", headers={"Content-Type": "text/plain"}), 415, "unsupported-media-type"
    )


def test_more_of_everything_takes_more() -> None:
    def of(preset: str, iterations: int, vertices: int, states: int) -> tuple[float, int, int]:
        taken = estimate(resolve(preset, {}).config(), iterations, vertices, states)
        return taken.seconds, taken.memory_bytes, taken.storage_bytes

    least = of("paper", 100, 10_000, 5)
    assert all(a < b for a, b in zip(least, of("paper", 100, 20_000, 5), strict=True))
    assert of("paper", 200, 10_000, 5)[0] > least[0]
    assert of("paper", 100, 10_000, 10)[2] == 2 * least[2]
    assert of("robust", 100, 10_000, 5)[0] > least[0]
    assert of("conformal", 100, 10_000, 5)[0] > of("robust", 100, 10_000, 5)[0]


@pytest.mark.parametrize("form", [False, True])
def test_a_job_begins_with_a_state_of_another(
    client: httpx.Client, submitted: Callable[..., Hand], stores: Stores, *, form: bool
) -> None:
    hand = submitted().claim().reach(0).reach(100)
    fields = {"from_snapshot": f"{hand.job_id}/100", "preset": "paper"}
    if form:
        answer = client.post("/v1/jobs", files={name: (None, value) for name, value in fields.items()})
    else:
        answer = client.post("/v1/jobs", json=fields)
    job = answer.json()
    assert (answer.status_code, job["name"], job["parent_id"]) == (201, "bunny_it00100", None)
    start = load_mesh(stores.blobs, hand.job().spec.mesh_id)
    begun = load_mesh(stores.blobs, job["mesh_id"])
    np.testing.assert_array_equal(begun.vertices, start.vertices * 101)
    np.testing.assert_array_equal(begun.faces, start.faces)
    again = client.post("/v1/jobs?dry_run=true", json=fields).json()
    assert again["mesh"]["id"] == job["mesh_id"], "the same state is the same mesh"


def test_a_state_that_is_not_there_begins_nothing(
    client: httpx.Client, submitted: Callable[..., Hand], known: str
) -> None:
    hand = submitted().claim().reach(0)

    def begun(address: str, **more: str) -> httpx.Response:
        return client.post("/v1/jobs", json={"from_snapshot": address, **more})

    problem(begun(f"{hand.job_id}/500"), 404, "result-not-ready")
    problem(begun(f"{hand.job_id}/7"), 404, "not-found")
    problem(begun(f"{hand.job_id}/nicest"), 404, "not-found")
    problem(begun("job_01K5Z9Q8M4T6V2X0Y7R3N1W5BC/0"), 404, "not-found")
    for wrong in (begun("0"), begun(f"{hand.job_id}/0", mesh_id=known), client.post("/v1/jobs", json={})):
        problem(wrong, 422, "invalid-parameters")
