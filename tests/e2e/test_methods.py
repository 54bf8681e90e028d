"""Every method through the whole service and on the command line: the same states, byte for byte."""

from __future__ import annotations

from pathlib import Path

import pytest

from spherify.formats import write_mesh
from spherify.geometry.samples import SAMPLES
from tests.cli.program import spherify, spherify_here
from tests.e2e.api import Api
from tests.stack import Stack, wait_for

METHODS = ("curvature", "conformal", "mean-curvature")


def saved(name: str, resolution: int, folder: Path) -> Path:
    path = folder / f"{name}.ply"
    path.write_bytes(write_mesh(SAMPLES[name].build(resolution), "ply"))
    return path


@pytest.mark.parametrize("method", METHODS)
def test_service_and_command_line_agree(api: Api, stack: Stack, tmp_path: Path, method: str) -> None:
    path = saved("head", 600, tmp_path)
    job = api.finished(api.submit(path, method=method, iterations="8", snapshots="3")["id"])
    assert (job["status"], job["stop_reason"]) == ("successful", "iterations")
    assert job["parameters"]["method"] == method
    assert {0, 3, 8} <= set(job["snapshots"]["available"])
    assert job["metrics"]["sphericity"] > 0.9
    rows = api.http.get(job["links"]["metrics"]).json()["rows"]
    assert [row["iteration"] for row in rows] == list(range(9))

    options = ["--method", method, "--iterations", "8", "--snapshots", "3"]
    here = spherify_here("morph", path.name, "-o", "here.ply", *options, cwd=tmp_path)
    assert here.code == 0, here.err
    sent = spherify_here("submit", path.name, "-o", "sent", "--url", stack.url, *options, cwd=tmp_path)
    assert sent.code == 0, sent.err
    for iteration, local in ((3, "here_it00003.ply"), (8, "here.ply")):
        of_the_service = api.download(job["id"], f"{iteration}.ply", tmp_path).read_bytes()
        assert (tmp_path / local).read_bytes() == of_the_service
        assert (tmp_path / "sent" / f"head_it{iteration:05d}.ply").read_bytes() == of_the_service


def test_a_dumbbell_pinches_and_the_job_says_where(api: Api, tmp_path: Path) -> None:
    path = saved("sphere-bar", 600, tmp_path)
    job = api.finished(api.submit(path, method="mean-curvature")["id"])
    assert (job["status"], job["stop_reason"]) == ("failed", "collapsed")
    assert job["error"]["code"] == "collapsed"
    assert f"iteration {job['progress']['iteration'] + 1} pinched triangle" in job["stop_detail"]
    assert job["result_iteration"] == job["best_iteration"]
    options = ["--method", "mean-curvature", "--set", "patience=0"]
    here = spherify("morph", path.name, "-o", "best.ply", *options, cwd=tmp_path)
    assert here.code == 3
    assert job["stop_detail"].split(";")[0] in " ".join(here.err.split())
    assert (tmp_path / "best.ply").read_bytes() == api.download(job["id"], "final.ply", tmp_path).read_bytes()


def test_a_flow_is_cancelled_between_its_steps(api: Api, tmp_path: Path) -> None:
    endless = {"method": "conformal", "iterations": "100000", "patience": "0", "stop_radius_variation": "0"}
    job_id = api.submit(saved("quadruped", 8000, tmp_path), **endless)["id"]
    wait_for(lambda: api.job(job_id)["progress"]["iteration"] > 0, what="the first iteration")
    assert api.http.post(f"/v1/jobs/{job_id}/cancel").status_code == 202
    job = api.finished(job_id, limit_s=10)
    assert (job["status"], job["stop_reason"]) == ("cancelled", "cancelled")
    assert job["progress"]["iteration"] == max(job["snapshots"]["available"])


def test_the_command_line_refuses_what_does_not_go_together(tmp_path: Path) -> None:
    for options, said in (
        (["--method", "ricci"], "curvature, conformal, mean-curvature"),
        (["--method", "conformal", "--preset", "paper"], "of the method curvature"),
        (["--method", "conformal", "--set", "momentum=0.5"], "no parameter momentum"),
        (["--method", "conformal", "--set", "method=curvature"], "two methods"),
    ):
        done = spherify_here("morph", "sample:cube:100", "-o", "out.ply", *options, cwd=tmp_path)
        assert done.code == 2
        assert said in done.err
