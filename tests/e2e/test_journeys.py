"""Real meshes through the whole stack: upload, worker, snapshots in every format; and what happens on the way."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from spherify.formats import FORMATS_OUT, read_mesh, write_mesh
from spherify.geometry.samples import SAMPLES
from tests.e2e.api import Api
from tests.shared import shared_mesh
from tests.stack import started_stack, wait_for


@dataclass(frozen=True)
class Journey:
    """A mesh, how far it goes, and what of it is known: vertices, triangles, sphericity at both ends."""

    name: str
    vertices: int
    faces: int
    iterations: int
    at_first: float
    at_last: float


JOURNEYS = (
    Journey("spot.obj", 2930, 5856, 50, 0.679, 0.99),
    Journey("castalia.obj", 2048, 4092, 50, 0.868, 0.99),
    Journey("20mm-xyz-cube.stl", 132, 260, 200, 0.770, 0.97),
    Journey("nefertiti-lowres.obj", 35002, 70000, 2, 0.681, 0.69),
    Journey("scallop.glb", 60002, 120000, 1, 0.740, 0.742),
)


@pytest.mark.parametrize("journey", JOURNEYS, ids=lambda journey: journey.name)
def test_a_real_mesh_goes_the_whole_way(api: Api, tmp_path: Path, journey: Journey) -> None:
    path = shared_mesh(journey.name)
    half = journey.iterations // 2
    job = api.submit(path, iterations=str(journey.iterations), snapshots=str(half))
    mesh = api.http.get(job["links"]["mesh"]).json()
    assert (mesh["report"]["vertices"], mesh["report"]["faces"]) == (journey.vertices, journey.faces)
    assert mesh["report"]["sphericity"] == pytest.approx(journey.at_first, abs=6e-4)

    done = api.finished(job["id"])
    assert (done["status"], done["stop_reason"]) == ("successful", "iterations")
    assert done["snapshots"]["available"] == sorted({0, half, done["best_iteration"], journey.iterations})
    assert done["progress"]["percent"] == 100
    assert done["metrics"]["sphericity"] >= journey.at_last
    assert done["metrics"]["inward_faces"] <= 0.001 * journey.faces or journey.iterations < 10

    saved = api.download(job["id"], "final.ply", tmp_path)
    assert saved.name == f"{path.stem}_it{journey.iterations:05d}.ply"
    final = read_mesh(saved, saved.name).mesh
    start = read_mesh(path, path.name).mesh
    assert (final.faces == start.faces).all()
    assert final.vertices.shape == start.vertices.shape


def test_every_format_holds_the_same_state(api: Api, tmp_path: Path) -> None:
    path = tmp_path / "stone.obj"
    path.write_bytes(write_mesh(SAMPLES["stone"].build(300), "obj"))
    job = api.finished(api.submit(path, iterations="10")["id"])
    exact = read_mesh(api.download(job["id"], "10.ply", tmp_path), "stone.ply").mesh
    for form in FORMATS_OUT:
        saved = api.download(job["id"], f"10.{form}", tmp_path)
        mesh = read_mesh(saved, saved.name).mesh
        if form in {"obj", "off"}:
            assert (mesh.vertices == exact.vertices).all()
            assert (mesh.faces == exact.faces).all()
        else:
            assert len(mesh.vertices) == len(exact.vertices)
            corners = mesh.vertices[mesh.faces].mean(axis=(0, 1))
            assert corners == pytest.approx(exact.vertices[exact.faces].mean(axis=(0, 1)), abs=1e-6)


def test_a_snapshot_can_be_had_before_the_job_is_done_and_the_job_be_cancelled(
    api: Api, tmp_path: Path
) -> None:
    path = tmp_path / "quadruped.obj"
    start = SAMPLES["quadruped"].build(600)
    path.write_bytes(write_mesh(start, "obj"))
    endless = {
        "iterations": "1000000",
        "snapshots": "1,2,3",
        "annealing": "null",
        "stop_radius_variation": "0",
    }
    job_id = api.submit(path, **endless)["id"]
    wait_for(lambda: 3 in api.job(job_id)["snapshots"]["available"], what="the third iteration")
    saved = api.download(job_id, "3.obj", tmp_path)
    early = api.http.get(f"/v1/jobs/{job_id}/snapshots/1000000.obj")
    assert api.job(job_id)["status"] == "running"
    assert early.status_code == 404
    assert early.json()["type"] == "/problems/result-not-ready"
    assert int(early.headers["retry-after"]) >= 1
    moved = read_mesh(saved, saved.name).mesh.vertices
    assert moved.shape == start.vertices.shape
    assert np.abs(moved - start.vertices).max() > 0

    assert api.http.post(f"/v1/jobs/{job_id}/cancel").status_code == 202
    assert api.finished(job_id, limit_s=10)["status"] == "cancelled"
    assert api.download(job_id, "3.obj", tmp_path).read_bytes() == saved.read_bytes()


def test_a_run_that_breaks_keeps_its_best_state(api: Api, tmp_path: Path) -> None:
    path = tmp_path / "quadruped.obj"
    path.write_bytes(write_mesh(SAMPLES["quadruped"].build(400), "obj"))
    job = api.finished(api.submit(path, preset="paper-absolute", step="0.01", iterations="2000")["id"])
    assert (job["status"], job["stop_reason"]) == ("failed", "collapsed")
    assert job["error"]["code"] == "collapsed"
    assert job["progress"]["percent"] < 100
    assert job["result_iteration"] == job["best_iteration"]
    best = read_mesh(api.download(job["id"], "final.ply", tmp_path), "best.ply")
    assert best.report.volume > 0


def test_an_upload_over_the_limit_is_refused(tmp_path: Path) -> None:
    limit = 100_000
    with started_stack(tmp_path, workers=0, environment={"SPHERIFY_MAX_UPLOAD_BYTES": str(limit)}) as stack:
        small = Api(stack.url)
        large = tmp_path / "large.obj"
        large.write_bytes(b"v 0 0 0\n" * limit)
        with small.http:
            for answer in (
                small.upload(large),
                small.http.post("/v1/jobs", files={"file": (large.name, large.read_bytes())}),
            ):
                assert answer.status_code == 413
                assert answer.json()["type"] == "/problems/upload-too-large"
                assert str(limit) in answer.json()["detail"].replace(",", "")
        assert not any((tmp_path / "blobs" / ".scratch").iterdir())
