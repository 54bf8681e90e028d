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


@pytest.mark.parametrize(
    ("address", "offered"),
    [("/v1/jobs?stauts=running", "status"), ("/v1/meshes?page=2", "cursor")],
)
def test_a_misspelt_filter_lists_nothing(client: httpx.Client, address: str, offered: str) -> None:
    document = problem(client.get(address), 422, "invalid-parameters")
    assert offered in document["detail"]
