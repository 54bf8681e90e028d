"""The roundness suite of the benchmarks: its figures are those of the flow it names."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from lapy import TriaMesh
from lapy.diffgeo import tria_mean_curvature_flow

from benchmarks import pictures
from benchmarks.roundness import COLUMNS, FLOWS, bench, line, read_folder, summary, table
from benchmarks.runs import LAPY, OUT_OF_TIME, run
from spherify.formats import write_mesh
from spherify.geometry import measures
from spherify.geometry.flow import flow
from spherify.geometry.kernels import default_engine
from spherify.geometry.presets import PRESETS
from spherify.geometry.samples.solids import icosphere
from tests.geometry.shapes import open_bump, sample, torus


@pytest.fixture(scope="module")
def runs():
    """Of an animal and of a stone, but for `paper`, which takes its 10,000 iterations."""
    meshes = [(name, sample(name, 500)) for name in ("quadruped", "stone")]
    return list(table(meshes, ("robust", LAPY), limit=60))


def of(runs, mesh, name):
    return next(one for one in runs if (one.mesh, one.flow) == (mesh, name))


def test_a_preset_is_measured_where_it_ends(runs):
    mesh, found = sample("quadruped", 500), of(runs, "quadruped", "robust")
    states = list(flow(mesh, PRESETS["robust"].config))
    end, areas = states[-1].metrics(), measures.face_areas(states[-1].vertices, mesh.faces)
    assert (found.vertices, found.faces) == (len(mesh.vertices), len(mesh.faces))
    assert (found.iterations, found.ended) == (states[-1].iteration, states[-1].stop_reason)
    assert found.inward_faces == end.inward_faces
    for ours, theirs in (
        (found.sphericity, end.sphericity),
        (found.radius_variation, end.radius_variation),
        (found.least_quality, end.least_quality),
        (found.least_area, areas.min() / areas.mean()),
    ):
        assert ours == pytest.approx(theirs, rel=1e-9)
    for mark, seconds in found.seconds_to.items():
        assert (seconds is not None) == any(state.sphericity >= mark for state in states)
        assert seconds is None or 0 < seconds <= found.seconds


def test_lapy_goes_as_far_as_it_goes_alone(runs):
    mesh, found = sample("quadruped", 500), of(runs, "quadruped", LAPY)
    alone = tria_mean_curvature_flow(TriaMesh(np.array(mesh.vertices), np.array(mesh.faces)))
    areas = measures.face_areas(alone.v, mesh.faces)
    assert found.least_area == pytest.approx(areas.min() / areas.mean(), rel=1e-6)
    assert 0.99 < found.sphericity < 1
    assert 0 < found.seconds_to[0.99] <= found.seconds
    assert found.iterations <= 30


@pytest.mark.parametrize("name", FLOWS)
def test_no_flow_goes_on_beyond_its_time(name):
    mesh, seen = sample("quadruped", 500), []
    found = run("", mesh, name, default_engine(), limit=0, watch=lambda *at: seen.append(at))
    assert (found.ended, found.iterations) == (OUT_OF_TIME, 0)
    assert [iteration for iteration, _ in seen] == [0]
    assert seen[0][1] == pytest.approx(found.sphericity)
    assert found.seconds_to == {0.99: None, 0.999: None}
    assert not found.true_sphere


def test_what_a_true_sphere_is(runs):
    good = replace(of(runs, "stone", "robust"), faces=1000, inward_faces=1, least_area=1e-6, sphericity=0.995)
    assert good.true_sphere
    for change in ({"inward_faces": 2}, {"least_area": 9e-7}, {"sphericity": 0.9949}):
        assert not replace(good, **change).true_sphere


def test_the_lines_say_it(runs):
    one = replace(of(runs, "stone", "robust"), seconds_to={0.99: 0.5, 0.999: None}, inward_faces=3, faces=300)
    cells = [cell.strip() for cell in line(one).strip("|").split("|")]
    said = dict(zip(COLUMNS, cells, strict=True))
    assert (said["mesh"], said["flow"], said["ended"]) == ("stone", "robust", one.ended)
    assert (said["s to Ψ 0.99"], said["s to Ψ 0.999"]) == ("0.50", "-")
    assert (said["inward faces"], said["true sphere"]) == ("3 (1.00 %)", "no")
    theirs = replace(one, flow=LAPY, seconds_to={0.99: 1.0, 0.999: None})
    assert "robust: 0 of 1 are true spheres; Ψ 0.99 2 times as soon as LaPy" in summary([one, theirs])
    assert "as soon" not in summary([one, replace(theirs, seconds_to={0.99: None, 0.999: None})])


def test_a_folder_ends_as_table_report_and_picture(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(pictures, "FOLDER", tmp_path / "plots")
    (tmp_path / "README.md").write_text("Not a mesh.")
    (tmp_path / "empty.obj").write_text("# nothing\n")
    (tmp_path / "egg.ply").write_bytes(write_mesh(icosphere(4), "ply"))
    (tmp_path / "ring.off").write_bytes(write_mesh(torus(12, 8), "off"))
    (tmp_path / "bump.off").write_bytes(write_mesh(open_bump(), "off"))
    meshes = read_folder(tmp_path)
    assert [name for name, _ in meshes] == ["egg"]
    left_out = capsys.readouterr().out
    for name, why in (("empty.obj", "not OBJ"), ("bump.off", "not closed"), ("ring.off", "genus 1")):
        assert any(name in said and why in said for said in left_out.splitlines())
    bench(meshes, ("robust", "conformal"), limit=10)
    assert sum(row.startswith("| egg") for row in capsys.readouterr().out.splitlines()) == 2
    written = json.loads((tmp_path / "plots" / "roundness.json").read_text())
    assert [(one["mesh"], one["flow"]) for one in written] == [("egg", "robust"), ("egg", "conformal")]
    assert (tmp_path / "plots" / "roundness.png").read_bytes().startswith(b"\x89PNG")
