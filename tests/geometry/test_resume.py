"""A run resumed from any of its checkpoints goes on bit for bit as if it had never been interrupted."""

from __future__ import annotations

import io
import shutil
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from spherify.geometry import progress
from spherify.geometry.config import Annealing, ImplicitFlowConfig
from spherify.geometry.errors import InvalidCheckpointError
from spherify.geometry.flow import StopReason, flow
from spherify.geometry.presets import PRESETS
from spherify.geometry.progress import digest_of
from spherify.geometry.samples.solids import icosphere
from tests.geometry.shapes import jittered, open_bump, sample, tetrahedron

ROBUST = PRESETS["robust"].config
MESH = sample("non-convex-sphere", 252)
RUNS = {
    "robust": (MESH, replace(ROBUST, iterations=30)),
    "annealed to the end": (
        MESH,
        replace(ROBUST, iterations=60, stop_radius_variation=0.0, annealing=Annealing(4, 0.5, 0.002)),
    ),
    "paper": (MESH, replace(PRESETS["paper"].config, iterations=20, step=0.01)),
    "volume, absolute": (
        MESH,
        replace(ROBUST, iterations=15, rescale="volume", step=0.01, step_unit="absolute"),
    ),
    "open": (open_bump(), replace(ROBUST, iterations=10)),
    "collapsing": (
        sample("sphere-bar", 300),
        replace(PRESETS["paper"].config, step=0.5, iterations=200),
    ),
    "conformal": (MESH, ImplicitFlowConfig(12, "conformal", 0.01)),
    "conformal, open, to the end": (
        open_bump(),
        ImplicitFlowConfig(60, "conformal", 0.02, patience=5),
    ),
    "pinching": (sample("sphere-bar", 300), ImplicitFlowConfig(100, "mean-curvature", 1e-3)),
    "converging": (MESH, replace(ROBUST, stop_radius_variation=0.02)),
    "from nearly round": (jittered(icosphere(5), 0.1), replace(ROBUST, iterations=15)),
}


def through_a_file(arrays):
    """What a checkpoint is after a file has held it: other memory, perhaps another layout."""
    file = io.BytesIO()
    np.savez(file, **{name: np.ascontiguousarray(array) for name, array in arrays.items()})
    file.seek(0)
    with np.load(file) as loaded:
        return dict(loaded)


def look(state):
    arrays = {name: array.tobytes() for name, array in state.checkpoint().items()}
    vertices, best = state.vertices.tobytes(), state.best
    return (
        state.iteration,
        vertices,
        state.sphericity,
        state.step,
        state.stop_reason,
        state.stop_detail,
        (best.iteration, best.vertices.tobytes(), best.sphericity),
        state.metrics(),
        arrays,
    )


@pytest.mark.parametrize("name", RUNS)
def test_from_every_checkpoint(name):
    mesh, config = RUNS[name]
    states = list(flow(mesh, config))
    assert len(states) > 5
    expected = [look(state) for state in states]
    for i in {0, 1, 2, len(states) // 2, len(states) - 3, len(states) - 2}:
        resumed = flow(mesh, config, resume=through_a_file(states[i].checkpoint()))
        assert [look(state) for state in resumed] == expected[i + 1 :]


@pytest.mark.parametrize("name", RUNS)
def test_a_run_that_has_ended_says_so_once_more(name):
    mesh, config = RUNS[name]
    *_, last = flow(mesh, config)
    (again,) = flow(mesh, config, resume=through_a_file(last.checkpoint()))
    assert look(again) == look(last)


def test_the_reasons_above_are_all_kinds():
    reasons = {list(flow(*run))[-1].stop_reason for run in RUNS.values()}
    assert reasons == {StopReason.ITERATIONS, StopReason.STALLED, StopReason.COLLAPSED, StopReason.CONVERGED}


def test_constant_curvature_is_found_again():
    *_, last = flow(tetrahedron(), PRESETS["paper"].config)
    (again,) = flow(tetrahedron(), PRESETS["paper"].config, resume=through_a_file(last.checkpoint()))
    assert again.stop_reason is StopReason.CONSTANT_CURVATURE


def test_extending_is_the_same_as_one_longer_run():
    mesh, config = RUNS["robust"]
    *_, short = flow(mesh, replace(config, iterations=12))
    assert short.stop_reason is StopReason.ITERATIONS
    extended = [look(state) for state in flow(mesh, config, resume=through_a_file(short.checkpoint()))]
    assert extended == [look(state) for state in flow(mesh, config)][13:]


def test_whole_numbers_written_with_and_without_a_point_are_the_same_parameter():
    mesh, config = RUNS["robust"]
    first, *_ = flow(mesh, replace(config, window=(30, 70), relaxation_exponent=1))
    again = replace(config, window=(30.0, 70.0), relaxation_exponent=1.0)
    assert next(iter(flow(mesh, again, resume=first.checkpoint()))).iteration == 1


def test_a_checkpoint_carries_the_positions_for_readers():
    mesh, config = RUNS["paper"]
    *_, last = flow(mesh, config)
    assert (last.checkpoint()["vertices"] == last.vertices).all()


class TestForeignOrDamaged:
    mesh, config = RUNS["robust"]

    @pytest.fixture
    def arrays(self):
        *_, last = flow(self.mesh, replace(self.config, iterations=3))
        return through_a_file(last.checkpoint())

    def refused(self, sentence, arrays, mesh=None, config=None):
        with pytest.raises(InvalidCheckpointError, match=sentence):
            flow(mesh or self.mesh, config or self.config, resume=arrays)

    def test_another_mesh(self, arrays):
        other = self.mesh.with_vertices(self.mesh.vertices * 1.0000001)
        self.refused("another mesh", arrays, mesh=other)
        self.refused("another mesh", arrays, mesh=icosphere(3))

    def test_other_sources(self, arrays, monkeypatch, tmp_path):
        package = Path(progress.__file__).parent
        assert digest_of(package) == progress.SOURCES
        copy = shutil.copytree(package, tmp_path / "geometry", ignore=shutil.ignore_patterns("__pycache__"))
        archive = shutil.make_archive(str(tmp_path / "app"), "zip", tmp_path, copy.name)
        assert digest_of(copy) == digest_of(zipfile.Path(archive) / copy.name) == progress.SOURCES
        with (copy / "kernels" / "passes" / "step.py").open("a") as source:
            source.write("#\n")
        other = digest_of(copy)
        (copy / "curvature.py").rename(copy / "curvatures.py")
        assert len({digest_of(copy), other, progress.SOURCES}) == 3
        monkeypatch.setattr(progress, "SOURCES", other)
        self.refused("another version", arrays)

    @pytest.mark.parametrize(
        "change",
        [
            {"step": 0.06},
            {"momentum": 0.8},
            {"annealing": None},
            {"annealing": Annealing(100, 0.5, 2e-4)},
            {"measure": "length"},
            {"rescale": "volume"},
            {"window": (30.0, 71.0)},
            {"boundary": "free"},
        ],
    )
    def test_other_parameters(self, arrays, change):
        self.refused("other parameters", arrays, config=replace(self.config, **change))

    @pytest.mark.parametrize(
        "name",
        [
            "fingerprint",
            "position",
            "previous",
            "best_position",
            "counts",
            "control",
            "log_weights",
            "shape",
            "best_shape",
            "broke_how",
        ],
    )
    def test_an_array_is_missing(self, arrays, name):
        del arrays[name]
        self.refused(f"no array '{name}'", arrays)

    def test_an_array_has_another_shape_or_type(self, arrays):
        self.refused("'position' of the checkpoint", arrays | {"position": arrays["position"][:-1]})
        self.refused("'counts' of the checkpoint", arrays | {"counts": arrays["counts"].astype(float)})
        self.refused("another mesh", arrays | {"fingerprint": arrays["fingerprint"][::-1]})
