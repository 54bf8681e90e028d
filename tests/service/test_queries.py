"""A query says what is described, or is refused: nothing is taken for something else."""

from __future__ import annotations

import httpx
import pytest

from spherify.stores.connect import Stores
from tests.service.conftest import OCTAHEDRON, problem


def test_an_unknown_query_makes_no_job(client: httpx.Client, stores: Stores) -> None:
    before = {job.id for job in stores.jobs.find(limit=100).items}
    answer = client.post("/v1/jobs?dryrun=true", files={"file": ("bunny.obj", OCTAHEDRON)})
    document = problem(answer, 422, "invalid-parameters")
    assert document["errors"][0]["pointer"] == "query/dryrun"
    assert "there are dry_run" in document["detail"]
    assert {job.id for job in stores.jobs.find(limit=100).items} == before


def test_a_parameter_says_one_thing(client: httpx.Client, stores: Stores) -> None:
    before = {job.id for job in stores.jobs.find(limit=100).items}
    answer = client.post("/v1/jobs?dry_run=true&dry_run=false", files={"file": ("bunny.obj", OCTAHEDRON)})
    assert problem(answer, 422, "invalid-parameters")["errors"][0]["pointer"] == "query/dry_run"
    assert {job.id for job in stores.jobs.find(limit=100).items} == before
    problem(client.get("/v1/jobs?tag=a&tag=b"), 422, "invalid-parameters")
    twice = {"params": {"name": "bunny.obj", "allow": ["boundary", "genus"]}, "content": OCTAHEDRON}
    assert client.put("/v1/meshes", **twice).status_code == 201, "a list has as many as it likes"


@pytest.mark.parametrize(
    ("address", "offered"),
    [("/v1/jobs?stauts=running", "status"), ("/v1/meshes?page=2", "cursor")],
)
def test_a_misspelt_filter_lists_nothing(client: httpx.Client, address: str, offered: str) -> None:
    document = problem(client.get(address), 422, "invalid-parameters")
    assert offered in document["detail"]


def test_every_operation_refuses_what_it_does_not_describe(client: httpx.Client) -> None:
    fill = {
        "job_id": "job_01K5Z9Q8M4T6V2X0Y7R3N1W5BC",
        "mesh_id": f"mesh_{26 * '0'}",
        "which": "10",
        "format": "ply",
        "field": "mean_curvature",
        "sample": "cube",
    }
    tried = []
    for path, operations in client.get("/openapi.json").json()["paths"].items():
        for method in operations.keys() & {"get", "put", "post", "delete"}:
            if path.startswith("/v1/"):
                answer = client.request(method, f"{path.format_map(fill)}?no-such=1")
                assert answer.status_code == 422, (method, path, answer.text)
                pointers = {error["pointer"] for error in answer.json()["errors"]}
                assert "query/no-such" in pointers, (method, path, answer.text)
                tried.append(path)
    assert len(tried) > 25
