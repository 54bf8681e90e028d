"""Unfolding on the sphere: what it promises, by either engine, in a run and across an interruption."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.shapes import SHAPES
from spherify.geometry import measures
from spherify.geometry.config import Stage, Unfolding
from spherify.geometry.errors import InvalidConfigError
from spherify.geometry.flow import StopReason, flow
from spherify.geometry.kernels import ENGINES, get_engine
from spherify.geometry.methods.curvature import Control, Phase
from spherify.geometry.presets import PRESETS
from spherify.geometry.quality import inward_faces
from spherify.geometry.samples.implicit import surface
from spherify.geometry.samples.solids import icosphere
from spherify.geometry.topology import Topology
from spherify.geometry.unfolding import folds
from tests.geometry.shapes import ROUNDING, jittered, sample

ROBUST = PRESETS["robust"].config
CENTRE = np.array([0.01, -0.02, 0.005])


def kernel(mesh, engine):
    return get_engine(engine).prepare(Topology.of(len(mesh.vertices), mesh.faces), ROBUST)


def crumpled():
    """A sphere with a patch pushed through itself."""
    mesh = icosphere(8)
    V = mesh.vertices.copy()
    cap = V[:, 2] > 0.9
    V[cap, :2] *= -1
    return mesh.with_vertices(V)


def begun(state):
    """Whether the unfolding has begun."""
    return bool(state.checkpoint()["log_weights"].any())


@pytest.mark.parametrize("engine", ENGINES)
def test_a_crumpled_patch_unfolds_and_radii_stay(engine):
    mesh = crumpled()
    V = np.asfortranarray(mesh.vertices * np.linspace(0.9, 1.1, len(mesh.vertices))[:, None])
    assert inward_faces(V, mesh.faces, CENTRE) > 10
    weights, damping, unfolding, positions = np.zeros(len(V)), 1.0, kernel(mesh, engine), V
    for _ in range(60):
        found = unfolding.unfold(positions, CENTRE, weights, exponent=4.0, damping=damping, rounds=8)
        positions, weights, damping = found.positions, found.log_weights, 0.3
    assert found.inward == 0 == inward_faces(positions, mesh.faces, CENTRE)
    np.testing.assert_allclose(measures.norm(positions - CENTRE), measures.norm(V - CENTRE), rtol=1e-12)
    assert folds(measures.normalised(positions - CENTRE), mesh.faces)[1] == pytest.approx(found.least_area)


@pytest.mark.parametrize("engine", ENGINES)
def test_radii_become_equal_whatever_the_triangles(engine):
    """Curvature from angles and areas leaves radii over uneven triangles uneven; that of the radii is 0 on a sphere."""
    mesh = icosphere(6)
    V = np.asfortranarray(mesh.vertices * np.linspace(0.8, 1.2, len(mesh.vertices))[:, None])
    unfolding = kernel(mesh, engine)
    for _ in range(400):
        V = unfolding.even_out(V, Stage(1, 2, 2), CENTRE)
    radii = measures.norm(V - CENTRE)
    assert np.ptp(radii) < 1e-3 * radii.mean()


@pytest.mark.parametrize("engine", ENGINES)
def test_vanishing_triangles_are_drawn_apart_and_none_is_turned(engine):
    """A cap squeezed to a millionth of its width: no face turns on the way, and none stays that small."""
    mesh = icosphere(8)
    V = mesh.vertices.copy()
    cap = V[:, 2] > 0.9
    V[cap, :2] *= 5e-4
    V = np.asfortranarray(measures.normalised(V))
    spreading = kernel(mesh, engine)
    least = folds(V, mesh.faces)[1]
    assert least < 1e-6
    other = kernel(mesh, "reference").spread(V, np.zeros(3), 2).positions
    assert np.abs(spreading.spread(V, np.zeros(3), 2).positions - other).max() < 10 * ROUNDING
    for _ in range(30):
        found = spreading.spread(V, np.zeros(3), 16)
        V = found.positions
        assert found.inward == 0
    assert found.least_area > 3e-6


def test_no_step_along_the_radii_turns_a_face():
    """However long and however uneven: whatever looks outward from the centre still does."""
    mesh = jittered(icosphere(6), 0.05)
    unfolding = kernel(mesh, "reference")
    V = mesh.vertices
    assert inward_faces(V, mesh.faces, CENTRE) == 0
    for stage in (Stage(1, 0, 3), Stage(1, 2, 1), Stage(1, 1, 2)):
        for moved in (
            unfolding.even_out(V, stage, CENTRE),
            unfolding.transform_radially(V, stage, 0.1, CENTRE),
        ):
            assert np.abs(moved - V).max() > 1e-3
            assert inward_faces(moved, mesh.faces, CENTRE) == 0
        V = moved


@pytest.mark.parametrize("name", ["quadruped", "stone", "cube"])
def test_both_engines_agree(name):
    mesh = sample(name, 1000)
    V = np.asfortranarray(mesh.vertices)
    one, other = (kernel(mesh, engine) for engine in ("reference", "compiled"))
    centre = one.shape(V).centroid + 0.001
    weights = np.random.default_rng(1).uniform(-3, 0, len(V))
    for rounds, damping in ((1, 1.0), (3, 0.25)):
        a, b = (
            k.unfold(V, centre, weights, exponent=4.0, damping=damping, rounds=rounds) for k in (one, other)
        )
        assert np.abs(a.positions - V).max() > 1e-3
        assert np.abs(a.positions - b.positions).max() < 10 * ROUNDING * np.abs(V).max()
        np.testing.assert_allclose(a.log_weights, b.log_weights, rtol=1e-11, atol=1e-11)
        assert a.inward == b.inward
        assert a.least_area == pytest.approx(b.least_area, rel=1e-9)
    for stage in (Stage(1, 1, 0), Stage(1, 0, 1)):
        for a, b in (
            [k.even_out(V, stage, centre) for k in (one, other)],
            [k.transform_radially(V, stage, 0.05, centre) for k in (one, other)],
        ):
            assert np.abs(a - V).max() > 1e-3
            assert np.abs(a - b).max() < ROUNDING * np.abs(V).max()


@pytest.mark.parametrize("name", ["quadruped", "head", "sphere-bar"])
def test_runs_end_as_true_spheres(name):
    mesh = sample(name, 1000)
    *_, last = flow(mesh, ROBUST, engine="compiled")
    metrics, areas = last.metrics(), measures.face_areas(last.vertices, mesh.faces)
    assert last.stop_reason in {StopReason.CONVERGED, StopReason.STALLED}
    assert metrics.sphericity >= 0.995
    assert metrics.inward_faces == 0
    assert areas.min() >= 1e-6 * areas.mean()


def test_long_limbs_need_it():
    """A ball with nine thin arms: folded for good without, and a true sphere with it."""
    mesh, folded = surface(SHAPES["star"], 2000), {}
    for unfolding in (None, ROBUST.unfolding):
        *_, last = flow(mesh, replace(ROBUST, unfolding=unfolding), engine="compiled")
        folded[unfolding is None] = last.metrics().inward_faces
    assert last.sphericity >= 0.995
    assert folded[True] > 0.01 * len(mesh.faces)
    assert folded[False] == 0


def test_it_begins_where_there_is_something_to_unfold():
    quadruped = list(flow(sample("quadruped", 1000), replace(ROBUST, iterations=60), engine="compiled"))
    at = next(state.iteration for state in quadruped if begun(state))
    assert quadruped[at - 1].sphericity >= ROBUST.unfolding.sphericity
    assert quadruped[at - 1].metrics().inward_faces > 0
    *_, stone = flow(sample("stone", 1000), replace(ROBUST, iterations=60), engine="compiled")
    assert stone.sphericity > ROBUST.unfolding.sphericity
    assert not begun(stone)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_run_resumes_from_within_bit_by_bit(engine):
    mesh, config = sample("quadruped", 1000), replace(ROBUST, iterations=56)
    whole = {state.iteration: state for state in flow(mesh, config, engine=engine)}
    for start in (29, 30, 31, 44):
        resumed = {
            state.iteration: state
            for state in flow(mesh, config, engine=engine, resume=whole[start].checkpoint())
        }
        assert sorted(resumed) == list(range(start + 1, 57))
        for iteration, state in resumed.items():
            assert state.vertices.tobytes() == whole[iteration].vertices.tobytes()
            assert state.metrics() == whole[iteration].metrics()
    assert begun(whole[56])
    assert not begun(whole[29])


@pytest.mark.parametrize("wrong", [{"sphericity": 1.0}, {"exponent": 0.0}, {"rounds": 0}])
def test_wrong_parameters_are_refused(wrong):
    with pytest.raises(InvalidConfigError, match=next(iter(wrong))):
        Unfolding(**{"sphericity": 0.99, "exponent": 4.0, "rounds": 8} | wrong)


def test_what_is_unfolded_gets_rounder_along_the_radii():
    """Equal radii cut more off the ball over large triangles: T goes on, and turns no face."""
    mesh = sample("quadruped", 1000)
    after = [
        state
        for state in flow(mesh, ROBUST, engine="compiled")
        if Control(*state.checkpoint()["control"]).phase == Phase.RADII
    ]
    assert after[-1].stop_reason is not None
    assert after[-1].sphericity > after[0].sphericity + 1e-4
    assert all(inward_faces(s.vertices, mesh.faces, s.vertices.mean(axis=0)) == 0 for s in after[::20])
