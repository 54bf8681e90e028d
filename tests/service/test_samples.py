from __future__ import annotations

import tracemalloc
from collections.abc import Collection

import httpx
import pytest

from service.intake import Intake
from service.uploads import Upload
from spherify.geometry.samples import SAMPLES
from spherify.jobs.model import MeshRecord
from tests.service.conftest import OPEN, problem


def test_samples_are_listed_with_what_makes_them(client: httpx.Client) -> None:
    items = client.get("/v1/samples").json()["items"]
    assert {item["name"]: item["title"] for item in items} == {it.name: it.title for it in SAMPLES.values()}
    assert items[0]["links"]["create"] == f"/v1/samples/{items[0]['name']}"


@pytest.mark.parametrize("name", ["stone", "quadruped"])
def test_a_sample_is_a_mesh_like_any_other(client: httpx.Client, name: str) -> None:
    made = client.post(f"/v1/samples/{name}", params={"vertices": 400})
    mesh = made.json()
    assert made.status_code == 201
    assert made.headers["location"] == mesh["links"]["self"]
    assert (mesh["name"], mesh["report"]["eligible"], mesh["report"]["genus"]) == (f"{name}.ply", True, 0)
    assert 200 < mesh["report"]["vertices"] < 1200
    again = client.post(f"/v1/samples/{name}?vertices=400")
    assert (again.status_code, again.json()["id"]) == (200, mesh["id"])
    job = client.post("/v1/jobs", json={"mesh_id": mesh["id"], "iterations": 1})
    assert (job.status_code, job.json()["name"]) == (201, name)


def test_a_sample_that_waits_to_be_read_takes_no_memory(
    client: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    accept, held, sizes = Intake.accept, [], []

    async def measured(self: Intake, upload: Upload, allow: Collection[str]) -> tuple[MeshRecord, bool]:
        held.append(tracemalloc.get_traced_memory()[0])
        sizes.append(upload.size)
        return await accept(self, upload, allow)

    monkeypatch.setattr(Intake, "accept", measured)
    tracemalloc.start()
    try:
        for vertices in (400, 20_000):  # what is kept for good is there after the first one
            assert client.post(f"/v1/samples/stone?vertices={vertices}").is_success
    finally:
        tracemalloc.stop()
    assert held[1] - held[0] < sizes[1] / 4


def test_no_such_sample(client: httpx.Client) -> None:
    problem(client.post("/v1/samples/bunny"), 404, "not-found")
    problem(client.post("/v1/samples/stone?vertices=10"), 422, "invalid-parameters")
    problem(client.post("/v1/samples/stone?size=1000"), 422, "invalid-parameters")


def test_a_refusal_tells_where_to_draw_the_defect(client: httpx.Client) -> None:
    document = problem(client.put("/v1/meshes?name=o.obj", content=OPEN), 422, "mesh-not-closed")
    (error,) = document["errors"]  # type: ignore[misc]
    places = error["locations"]
    assert {place["kind"] for place in places} == {"edge"}
    assert {frozenset(place["indices"]) for place in places} == {
        frozenset(e) for e in ((0, 3), (3, 5), (0, 5))
    }
    corners = {0: [1, 0, 0], 3: [0, -1, 0], 5: [0, 0, -1]}
    for place in places:
        assert place["positions"] == [corners[index] for index in place["indices"]]


def test_a_long_rim_is_told_whole_and_a_record_keeps_a_few_places(client: httpx.Client) -> None:
    side = 80
    vertices = "".join(f"v {x} {y} {(x - 40) ** 2 / 99}\n" for y in range(side) for x in range(side))
    faces = "".join(
        f"f {a} {a + 1} {a + side + 1}\nf {a} {a + side + 1} {a + side}\n"
        for y in range(side - 1)
        for a in range(y * side + 1, y * side + side)
    )
    text = (vertices + faces).encode()
    document = problem(client.put("/v1/meshes?name=sheet.obj", content=text), 422, "mesh-not-closed")
    assert len(document["errors"][0]["locations"]) == 4 * (side - 1)  # type: ignore[index]
    assert document["report"]["defects"][0]["locations"] == []  # type: ignore[index]
    mesh = client.put("/v1/meshes?name=sheet.obj&allow=boundary", content=text).json()
    assert len(mesh["report"]["defects"][0]["locations"]) == 10
