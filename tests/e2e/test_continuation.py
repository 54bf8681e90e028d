"""Two jobs one after the other are one longer run, to the last bit, through the whole stack."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from spherify.formats import read_mesh, write_mesh
from spherify.geometry.schedule import SnapshotPlan
from spherify.jobs.run import run
from spherify.parameters import resolve
from spherify.stores.arrays import load_arrays
from tests.e2e.api import Api
from tests.jobs.examples import ENDLESS, stone
from tests.jobs.test_run import Recorder
from tests.stack import Stack, wait_for

PARAMETERS: dict[str, Any] = {
    "annealing": {"patience": 5, "factor": 0.7, "min_step": 1e-9},  # at work long before the seam
    "stop_radius_variation": 0,
}


@pytest.fixture
def mesh(api: Api, tmp_path: Path) -> str:
    path = tmp_path / "stone.obj"
    path.write_bytes(write_mesh(stone(), "obj"))
    return str(api.upload(path).json()["id"])


def submit(api: Api, mesh: str, **request: Any) -> dict[str, Any]:
    answer = api.http.post("/v1/jobs", json={"mesh_id": mesh, **request})
    assert answer.status_code == 201, answer.text
    return dict(answer.json())


def files(stack: Stack, job_id: str) -> dict[int, bytes]:
    return {
        kept.iteration: stack.stores.blobs.read(kept.key) for kept in stack.stores.jobs.get(job_id).snapshots
    }


def test_an_extended_job_is_one_longer_run(api: Api, stack: Stack, mesh: str, tmp_path: Path) -> None:
    first = submit(api, mesh, iterations=60, snapshots=[20], parameters=PARAMETERS)
    assert api.finished(first["id"])["stop_reason"] == "iterations"
    answer = api.http.post(
        f"/v1/jobs/{first['id']}/extend",
        json={"iterations": 60, "snapshots": [90]},
        headers={"Prefer": "wait=60"},
    )
    assert answer.status_code == 201
    assert answer.headers["preference-applied"] == "wait=60"
    second = answer.json()
    assert (second["done"], second["stop_reason"], second["parent_id"]) == (True, "iterations", first["id"])
    assert second["links"]["parent"] == f"/v1/jobs/{first['id']}"
    assert second["parameters"]["iterations"] == 120
    assert api.http.delete(f"/v1/jobs/{first['id']}").status_code == 204

    sink = Recorder()
    path = tmp_path / "stone.obj"
    config = resolve("robust", {"iterations": 120, **PARAMETERS}).config()
    plan = SnapshotPlan((0, 20, 60, 90, 120))
    assert tuple(second["snapshots"]["requested"]) == plan.iterations
    end = run(read_mesh(path, path.name).mesh, config, plan, sink)
    sink.take(end.rows)
    assert load_arrays(sink.snapshots[60])["control"][1] < 1, "annealed before the seam"
    assert files(stack, second["id"]) == sink.snapshots
    assert stack.stores.jobs.metrics(second["id"]) == [sink.rows[i] for i in sorted(sink.rows)]


def test_a_retried_job_ends_as_if_it_had_not_been_cancelled(api: Api, stack: Stack, mesh: str) -> None:
    endless = {**ENDLESS, "iterations": 1_000_000}
    first = submit(api, mesh, parameters=endless, snapshots="every:1009")
    wait_for(lambda: api.job(first["id"])["progress"]["iteration"] > 20, what="some iterations")
    api.http.post(f"/v1/jobs/{first['id']}/cancel")
    stopped = api.finished(first["id"])
    last = stopped["snapshots"]["available"][-1]
    second = api.http.post(f"/v1/jobs/{first['id']}/retry").json()
    wait_for(lambda: api.job(second["id"])["progress"]["iteration"] > last, what="more iterations")
    api.http.post(f"/v1/jobs/{second['id']}/cancel")
    again = api.finished(second["id"])
    assert last not in again["snapshots"]["available"] or last in stopped["snapshots"]["requested"]
    assert again["attempt"] == 1
    rows = stack.stores.jobs.metrics(second["id"])
    assert (
        rows[: len(stack.stores.jobs.metrics(first["id"])) - 1] == stack.stores.jobs.metrics(first["id"])[:-1]
    )
