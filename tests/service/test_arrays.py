from __future__ import annotations

import gzip
import struct
from collections.abc import Callable

import httpx
import numpy as np
import pytest

from service.arrays import load_mesh
from spherify.formats.viewer import LEVELS
from spherify.geometry.fields import FIELDS, FieldName, vertex_field
from spherify.jobs.model import JobStatus
from spherify.stores.connect import Stores
from tests.service.conftest import Hand, problem

IMMUTABLE = "private, max-age=31536000, immutable"
PLAIN = {"Accept-Encoding": "identity"}


@pytest.fixture
def running(submitted: Callable[..., Hand]) -> Hand:
    return submitted().claim().reach(0).reach(100)


@pytest.fixture
def job(running: Hand) -> str:
    return f"/v1/jobs/{running.job_id}"


def f32(answer: httpx.Response) -> np.ndarray:
    assert answer.headers["content-type"] == "application/octet-stream"
    return np.frombuffer(answer.content, "<f4")


def test_topology_and_positions_are_the_mesh(
    client: httpx.Client, running: Hand, job: str, stores: Stores
) -> None:
    mesh_id = running.job().spec.mesh_id
    start = load_mesh(stores.blobs, mesh_id)
    faces = client.get(f"{job}/topology").content
    assert struct.unpack("<24I", faces) == tuple(start.faces.reshape(-1).tolist())
    assert client.get(f"/v1/meshes/{mesh_id}/topology").content == faces
    state = f32(client.get(f"{job}/snapshots/100/positions"))
    np.testing.assert_array_equal(state, (start.vertices * 101).astype(np.float32).reshape(-1))
    mesh = client.get(f"/v1/meshes/{mesh_id}/positions").content
    assert mesh == client.get(f"{job}/snapshots/0/positions").content


def test_quantised_positions_are_half_the_size(client: httpx.Client, job: str) -> None:
    whole = f32(client.get(f"{job}/snapshots/100/positions")).reshape(-1, 3)
    data = client.get(f"{job}/snapshots/100/positions?dtype=u16").content
    assert len(data) == 24 + whole.nbytes // 2
    low, high = np.frombuffer(data, "<f4", 6).reshape(2, 3)
    q = np.frombuffer(data, "<u2", offset=24).reshape(-1, 3)
    np.testing.assert_allclose(low + q * ((high - low) / LEVELS), whole, atol=202 / LEVELS)


@pytest.mark.parametrize("name", FIELDS)
def test_fields_are_those_of_the_mathematics(
    client: httpx.Client, running: Hand, job: str, stores: Stores, name: FieldName
) -> None:
    mesh_id = running.job().spec.mesh_id
    start = load_mesh(stores.blobs, mesh_id)
    expected = vertex_field(name, start, start.vertices * 101)
    found = f32(client.get(f"{job}/snapshots/100/fields/{name}"))
    np.testing.assert_array_equal(found, expected.astype(np.float32))
    of_mesh = f32(client.get(f"/v1/meshes/{mesh_id}/fields/{name}"))
    np.testing.assert_array_equal(of_mesh, f32(client.get(f"{job}/snapshots/initial/fields/{name}")))
    sizeless = name in {"distance", "quality"}
    assert np.allclose(of_mesh, found, atol=1e-12) == sizeless


@pytest.mark.parametrize(
    ("accepted", "zipped"),
    [("gzip, deflate, br", True), ("*", True), ("gzip;q=0, *", False), ("br", False), ("gzip;q=0.5", True)],
)
def test_compressed_where_it_is_taken(client: httpx.Client, job: str, accepted: str, zipped: bool) -> None:
    plain = client.get(f"{job}/topology", headers=PLAIN)
    assert "content-encoding" not in plain.headers
    with client.stream("GET", f"{job}/topology", headers={"Accept-Encoding": accepted}) as answer:
        raw = b"".join(answer.iter_raw())
    assert answer.headers["vary"] == "Accept-Encoding"
    assert ("content-encoding" in answer.headers) == zipped
    assert (gzip.decompress(raw) if zipped else raw) == plain.content
    assert (answer.headers["etag"] != plain.headers["etag"]) == zipped, "other bytes, another tag"
    assert int(answer.headers["content-length"]) == len(raw)


@pytest.mark.parametrize("path", ["topology", "snapshots/100/positions", "snapshots/100/fields/quality"])
def test_tags_heads_and_ranges(client: httpx.Client, job: str, path: str) -> None:
    url = f"{job}/{path}"
    for coding in (PLAIN, {"Accept-Encoding": "gzip"}):
        first = client.get(url, headers=coding)
        etag = first.headers["etag"]
        assert first.headers["cache-control"] == IMMUTABLE
        assert not etag.startswith("W/")
        again = client.get(url, headers=coding | {"If-None-Match": etag})
        assert (again.status_code, again.content, again.headers["vary"]) == (304, b"", "Accept-Encoding")
        head = client.head(url, headers=coding)
        assert head.content == b""
        for name in ("etag", "content-length", "vary"):
            assert head.headers[name] == first.headers[name]
    whole = client.get(url, headers=PLAIN)
    part = client.get(url, headers=PLAIN | {"Range": "bytes=4-11", "If-Range": whole.headers["etag"]})
    assert (part.status_code, part.content) == (206, whole.content[4:12])
    changed = client.get(url, headers=PLAIN | {"Range": "bytes=4-11", "If-Range": '"other"'})
    assert (changed.status_code, changed.content) == (200, whole.content)
    problem(client.get(url, headers={"Range": "bytes=9999-"}), 416, "range-not-satisfiable")


def test_names_that_may_change_are_not_kept(client: httpx.Client, running: Hand, job: str) -> None:
    path = f"{job}/snapshots/latest/positions"
    before = client.get(path)
    assert before.headers["cache-control"] == "private, no-cache"
    assert before.headers["etag"] == client.get(f"{job}/snapshots/100/positions").headers["etag"]
    running.reach(500).end(JobStatus.SUCCESSFUL)
    after = client.get(path, headers={"If-None-Match": before.headers["etag"]})
    assert (after.status_code, after.headers["cache-control"]) == (200, IMMUTABLE)


def test_what_is_not_there(client: httpx.Client, job: str) -> None:
    problem(client.get(f"{job}/snapshots/500/positions"), 404, "result-not-ready")
    problem(client.get(f"{job}/snapshots/7/fields/quality"), 404, "not-found")
    problem(client.get(f"{job}/snapshots/0/fields/beauty"), 404, "not-found")
    problem(client.get(f"{job}/snapshots/0/positions?dtype=f64"), 422, "invalid-parameters")
    problem(client.get(f"{job}/topology?dtype=f32"), 422, "invalid-parameters")
    problem(client.get("/v1/meshes/mesh_00000000000000000000000000/positions"), 404, "not-found")


def test_equal_states_of_other_jobs_have_equal_tags(
    client: httpx.Client, submitted: Callable[..., Hand], job: str
) -> None:
    other = submitted().claim().reach(0).reach(100)
    for path in ("snapshots/100/positions", "snapshots/100.ply", "topology"):
        first, second = (client.get(f"{base}/{path}") for base in (job, f"/v1/jobs/{other.job_id}"))
        assert first.headers["etag"] == second.headers["etag"]
