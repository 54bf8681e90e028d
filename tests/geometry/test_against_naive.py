"""The reference engine does what the paper's formulas in plain loops do, in every mode."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spherify.geometry.config import Annealing, FlowConfig, Stage
from spherify.geometry.curvature import vertex_curvature
from spherify.geometry.flow import flow
from spherify.geometry.kernels import get_engine
from spherify.geometry.metrics import metrics_of
from spherify.geometry.topology import Topology
from tests import naive
from tests.geometry.shapes import FEW_STEPS, ROUNDING, as_lists, small_samples

MESHES = small_samples()
MEASURES = ("vtk", "length", "dual-area")
MODES = {
    "paper": {},
    "window": {"window": (30.0, 70.0)},
    "lopsided window": {"window": (0.0, 65.0)},
    "step bound": {"step_bound": 0.05},
    "relaxation": {"relaxation": 0.5},
    "weighted relaxation": {"relaxation": 0.7, "relaxation_exponent": 1.5},
    "everything": {"window": (20.0, 80.0), "step_bound": 0.1, "relaxation": 0.5, "relaxation_exponent": 1.0},
}


def naive_settings(config: FlowConfig, mesh):
    held = set()
    if config.boundary == "fixed":
        held = {int(p) for p in Topology.of(len(mesh.vertices), mesh.faces).boundary_vertices}
    return {
        "measure": config.measure,
        "window": config.window,
        "step_bound": config.step_bound,
        "exponent": config.relaxation_exponent,
        "held": held,
    }


def assert_near(actual, expected, tolerance):
    expected = np.asarray(expected)
    assert np.abs(np.asarray(actual) - expected).max() <= tolerance * np.abs(expected).max()


@pytest.mark.parametrize("measure", MEASURES)
@pytest.mark.parametrize("name", MESHES)
def test_curvature(name, measure):
    V, F = as_lists(MESHES[name])
    topology = Topology.of(len(V), MESHES[name].faces)
    expected = [naive.curvature(p, V, F, measure) for p in range(len(V))]
    assert_near(vertex_curvature(MESHES[name].vertices, topology, measure), expected, ROUNDING)


@pytest.mark.parametrize("measure", MEASURES)
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", ["stone", "open"])
def test_one_application_of_t(name, mode, measure):
    mesh = MESHES[name]
    V, F = as_lists(mesh)
    config = FlowConfig(iterations=1, measure=measure, **MODES[mode])
    kernel = get_engine("reference").prepare(Topology.of(len(V), mesh.faces), config)
    actual = kernel.transform(mesh.vertices, Stage(1, 2, 1), 0.03, config.relaxation)
    expected = naive.transform(V, F, 2, 1, 0.03, relaxation=config.relaxation, **naive_settings(config, mesh))
    assert actual is not None
    assert_near(actual, expected, ROUNDING * 100)
    assert not np.allclose(actual, mesh.vertices, atol=1e-4), (
        "the mesh has to move for the comparison to mean anything"
    )


@pytest.mark.parametrize("name", MESHES)
def test_every_mesh_in_the_full_mode(name):
    mesh = MESHES[name]
    V, F = as_lists(mesh)
    config = FlowConfig(iterations=1, boundary="free", **MODES["everything"])
    kernel = get_engine("reference").prepare(Topology.of(len(V), mesh.faces), config)
    actual = kernel.transform(mesh.vertices, Stage(1, 1, 1), 0.02, 0.5)
    expected = naive.transform(V, F, 1, 1, 0.02, relaxation=0.5, **naive_settings(config, mesh))
    assert actual is not None
    assert_near(actual, expected, ROUNDING * 100)


@pytest.mark.parametrize(
    ("rescale", "step_unit", "momentum", "annealing"),
    [
        ("none", "absolute", 0.0, None),
        ("area", "mean-edge", 0.9, Annealing(2, 0.5, 1e-6)),
        ("volume", "initial-mean-edge", 0.5, None),
        ("none", "mean-edge", 0.04, Annealing(1, 0.7, 1e-6)),
    ],
)
def test_whole_run(rescale, step_unit, momentum, annealing):
    """Schedule, momentum, annealing, rescaling and step units, over iterations in which each of them acts."""
    mesh = MESHES["stone"]
    V, F = as_lists(mesh)
    config = FlowConfig(
        iterations=7,
        schedule=(Stage(2, 2, 1), Stage(1, 1, 2)),
        step=0.04,
        step_unit=step_unit,
        momentum=momentum,
        rescale=rescale,
        annealing=annealing,
        **MODES["everything"],
    )
    expected = naive.run(
        V,
        F,
        7,
        schedule=[(2, 2, 1), (1, 1, 2)],
        step=0.04,
        step_unit=step_unit,
        momentum=momentum,
        rescale=rescale,
        annealing=annealing and (annealing.patience, annealing.factor),
        relaxation=config.relaxation,
        **naive_settings(config, mesh),
    )
    states = list(flow(mesh, config))
    assert [state.iteration for state in states] == list(range(8))
    for state, (positions, sphericity) in zip(states, expected, strict=True):
        assert_near(state.vertices, positions, FEW_STEPS)
        assert state.sphericity == pytest.approx(sphericity, rel=FEW_STEPS)


@pytest.mark.parametrize("name", [name for name in MESHES if name != "open"])
def test_metrics(name):
    mesh = MESHES[name]
    V, F = as_lists(mesh)
    metrics = metrics_of(mesh.vertices, Topology.of(len(V), mesh.faces), measure="vtk", step=0.5)
    K = [naive.curvature(p, V, F, "vtk") for p in range(len(V))]
    c = naive.centroid(V, F)
    radii = [naive.length(naive.sub(p, c)) for p in V]
    expected = {
        "sphericity": naive.sphericity(V, F),
        "area": naive.area(V, F),
        "volume": naive.volume(V, F),
        "radius_variation": naive.radius_variation(V, F),
        "radius_ratio": min(radii) / max(radii),
        "curvature_min": min(K),
        "curvature_max": max(K),
        "step": 0.5,
        "mean_quality": sum(naive.quality(V, F)) / len(F),
        "least_quality": min(naive.quality(V, F)),
        "inward_faces": naive.inward_faces(V, F),
    }
    assert metrics.as_dict() == pytest.approx(expected, rel=1e-9, abs=1e-11)


def test_a_fixed_boundary_stays_and_a_free_one_moves():
    mesh = MESHES["open"]
    rim = Topology.of(len(mesh.vertices), mesh.faces).boundary_vertices
    fixed = FlowConfig(iterations=5, rescale="area", momentum=0.9, **MODES["everything"])
    last = list(flow(mesh, fixed))[-1]
    np.testing.assert_allclose(last.vertices[rim], mesh.vertices[rim], rtol=0, atol=1e-15)
    assert np.abs(last.vertices - mesh.vertices).max() > 1e-3
    free = list(flow(mesh, replace(fixed, boundary="free")))[-1]
    assert np.abs(free.vertices[rim] - mesh.vertices[rim]).max(axis=1).min() > 1e-6
