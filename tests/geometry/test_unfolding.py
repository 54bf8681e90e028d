"""Unfolding on the sphere: what it promises, by either engine, in a run and across an interruption."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.shapes import SHAPES
from spherify.geometry import measures
from spherify.geometry.config import LATE, Stage, Unfolding
from spherify.geometry.covering import covering
from spherify.geometry.errors import InvalidConfigError
from spherify.geometry.flow import StopReason, flow
from spherify.geometry.kernels import ENGINES, get_engine
from spherify.geometry.mesh import TriangleMesh
from spherify.geometry.methods import control, decisions
from spherify.geometry.methods.control import LOOKED_EVERY, Control, Phase, round_enough
from spherify.geometry.methods.decisions import TURNED
from spherify.geometry.presets import PRESETS
from spherify.geometry.quality import inward_faces
from spherify.geometry.samples.implicit import surface
from spherify.geometry.samples.solids import icosphere
from spherify.geometry.topology import Topology
from spherify.geometry.unfolding import EVENING, evened_out, folds
from tests.geometry.shapes import ROUNDING, jittered, sample, torus

ROBUST = PRESETS["robust"].config
STARTS = (
    19,
    20,
    21,
    30,
    44,
    45,
    50,
    51,
    54,
    55,
)  # iterations of a quadruped's run, of one phase after the other
WALL = (
    (0, -1.2),
    (0.5, -0.9),
    (0.7, 0),
    (0.6, 0.7),
    (0.5, 0.75),
    (0.5, 0.7),
    (0.6, 0),
    (0.4, -0.8),
    (0, -1),
)  # ρ, z
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


def unfolded(state):
    """Whether faces looked inward on the sphere, and were turned."""
    return bool(state.checkpoint()["log_weights"].any())


def phase(state):
    """What the iteration did that led there, or what comes next."""
    return Control(*state.checkpoint()["control"]).phase


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


def test_radii_become_equal_whatever_the_triangles_and_however_wide_the_bulge():
    """Curvature from angles and areas leaves radii over uneven triangles uneven; that of the radii is 0 on a sphere."""
    mesh = icosphere(6)
    V = mesh.vertices * np.linspace(0.8, 1.2, len(mesh.vertices))[:, None]
    before = np.ptp(measures.norm(V - CENTRE))
    for _ in range(50):
        V = evened_out(V, CENTRE, 2, 2)
    radii = measures.norm(V - CENTRE)
    assert np.ptp(radii) < 1.1 * (1 - EVENING) ** 100 * before
    assert evened_out(CENTRE + np.array([[1.0, 0, 0], [0, -1.0, 0], [0, 0, 1.0]]), CENTRE, 1, 1) is None


def test_no_vertex_passes_the_centre_where_all_steps_lead_inward():
    """Beside a spike they are longer than a short radius is."""
    mesh = icosphere(6)
    radii = np.ones(len(mesh.vertices))
    radii[:2] = 3, 0.02
    V = CENTRE + radii[:, None] * mesh.vertices
    moved = evened_out(V, CENTRE, 1, 0)
    assert (measures.dot(moved - CENTRE, mesh.vertices) > 0).all()


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
            evened_out(V, CENTRE, stage.k_in, stage.k_out),
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
        a, b = (k.transform_radially(V, stage, 0.05, centre) for k in (one, other))
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


def test_it_begins_where_the_surface_is_round_enough():
    """And unfolds only where there is something to unfold."""
    for name, folded in (("quadruped", True), ("stone", False)):
        mesh = sample(name, 1000)
        states = list(flow(mesh, replace(ROBUST, iterations=60), engine="compiled"))
        at = next(i for i, state in enumerate(states) if phase(state) == Phase.SPHERE)
        assert at % LOOKED_EVERY == 1
        is_round = [state.sphericity >= ROBUST.unfolding.sphericity for state in states]
        assert is_round[at - 1]
        assert not any(is_round[: max(at - LOOKED_EVERY, 0)])
        assert (states[at - 1].metrics().inward_faces > 0) is folded
        assert unfolded(states[-1]) is folded


def test_what_covers_the_sphere_otherwise_than_once_is_no_fold():
    """A ball with another inside covers it not at all, the outer one alone once, and a crumpled patch once as well."""
    ball, crumple = icosphere(8), crumpled()
    assert covering(ball.vertices, ball.faces, np.zeros(3)) == (1, 0.0)
    inner = ball.faces[:, ::-1]
    degree, turned = covering(ball.vertices, np.vstack([ball.faces, inner]), np.zeros(3))
    assert (degree, turned) == (0, pytest.approx(1))
    degree, turned = covering(crumple.vertices, crumple.faces, np.zeros(3))
    assert degree == 1
    assert 0.01 < turned < 0.1


@pytest.mark.parametrize(("shape", "later"), [("stone", 0), ("sphere-bar", 10)])
def test_late_in_a_run_less_is_round_enough(shape, later):
    """What T gets on with slowly: wide bulges of many small triangles, or here a tiny step; the later, the less."""
    slow = replace(ROBUST, step=1e-5, annealing=None, momentum=0.0, iterations=LATE + later + 2)
    at = [state.iteration for state in flow(sample(shape, 642), slow, engine="compiled") if phase(state)]
    assert at == [LATE + later + 1, LATE + later + 2]


def test_how_round_is_enough():
    """As told before it is late; then 0.8, and 0.004 less with each iteration; never more than told."""
    assert round_enough(LATE - 1, 0.97) == 0.97
    assert round_enough(LATE, 0.97) == 0.8
    assert round_enough(LATE, 0.7) == 0.7
    assert round_enough(LATE + 50, 0.97) == pytest.approx(0.6)
    assert round_enough(LATE + 201, 0.97) < 0


def vessel():
    """A deep one: the meridians of a ball laid along its wall, up outside and down inside."""
    ball = icosphere(20)
    x, y, z = ball.vertices.T
    corners = np.array(WALL)
    along = np.append(0, np.cumsum(np.hypot(*np.diff(corners, axis=0).T)))
    at = np.arccos(np.clip(-z, -1, 1)) / np.pi * along[-1]
    radius, height = (np.interp(at, along, corners[:, k]) for k in range(2))
    longitude = np.arctan2(y, x)
    V = np.stack([radius * np.cos(longitude), radius * np.sin(longitude), height], axis=1)
    return ball.with_vertices(V)


def test_a_cavity_is_opened_before_the_sphere(monkeypatch):
    """Its inside still covers much of the sphere the other way round when Ψ says that it is round enough.

    Unless it is late, when another point may do.
    """
    mesh, turned = vessel(), {}
    config = replace(ROBUST, unfolding=replace(ROBUST.unfolding, sphericity=0.9))
    with monkeypatch.context() as never:
        for module in (control, decisions):
            never.setattr(module, "LATE", 10**6)
        for state in flow(mesh, config, engine="compiled"):
            if phase(state) != Phase.NORMALS:
                break
            if state.sphericity >= config.unfolding.sphericity:
                turned[state.iteration] = covering(state.vertices, mesh.faces, state.vertices.mean(axis=0))[1]
    assert max(turned.values()) > 5 * TURNED
    assert turned[max(turned)] < 0.5 * TURNED
    *_, last = flow(mesh, config, engine="compiled")
    assert last.sphericity >= 0.995
    assert last.metrics().inward_faces == 0


def test_a_surface_of_another_genus_has_no_part_on_the_sphere():
    mesh = torus(24, 12)
    *_, last = flow(mesh, replace(ROBUST, iterations=300), engine="compiled")
    assert phase(last) == Phase.NORMALS


def test_nor_have_two_bodies_whose_numbers_add_up_to_those_of_a_sphere():
    """A ball and a small ring beside it, which nothing unfolds: together they have Euler's number of one ball."""
    ball, ring = icosphere(6), torus(16, 8)
    mesh = TriangleMesh.checked(
        np.vstack([ball.vertices, 0.1 * ring.vertices + [1.3, 0, 0]]),
        np.vstack([ball.faces, ring.faces + len(ball.vertices)]),
    )
    assert Topology.of(len(mesh.vertices), mesh.faces).euler == 2
    *_, last = flow(mesh, replace(ROBUST, iterations=30), engine="compiled")
    assert phase(last) == Phase.NORMALS


@pytest.mark.parametrize("engine", ENGINES)
def test_a_run_resumes_from_within_bit_by_bit(engine):
    mesh, config = sample("quadruped", 1000), replace(ROBUST, iterations=60)
    whole = {state.iteration: state for state in flow(mesh, config, engine=engine)}
    for start in STARTS:
        resumed = {
            state.iteration: state
            for state in flow(mesh, config, engine=engine, resume=whole[start].checkpoint())
        }
        assert sorted(resumed) == list(range(start + 1, 61))
        for iteration, state in resumed.items():
            assert state.vertices.tobytes() == whole[iteration].vertices.tobytes()
            assert state.metrics() == whole[iteration].metrics()
    assert {phase(whole[i]) for i in STARTS} == set(Phase) - {Phase.FOLDED, Phase.FINISH}


def test_a_run_that_gets_no_rounder_goes_on_upon_the_sphere_across_an_interruption():
    """Whatever state it resumes from: the last along the normals, the one that tells, or the first on the sphere."""
    config = replace(
        ROBUST,
        iterations=40,
        unfolding=replace(ROBUST.unfolding, sphericity=0.9999),
        annealing=replace(ROBUST.annealing, patience=20),
    )
    mesh = sample("stone", 600)
    whole = list(flow(mesh, config, engine="compiled"))
    folded = next(state.iteration for state in whole if phase(state) == Phase.FOLDED)
    assert [phase(state) for state in whole[folded - 1 :][:3]] == [Phase.NORMALS, Phase.FOLDED, Phase.SPHERE]
    for start in range(folded - 1, folded + 2):
        resumed = flow(mesh, config, engine="compiled", resume=whole[start].checkpoint())
        for state, expected in zip(resumed, whole[start + 1 :], strict=True):
            assert state.vertices.tobytes() == expected.vertices.tobytes()


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
        if phase(state) in {Phase.SMOOTHING, Phase.STAR}
    ]
    assert after[-1].stop_reason is not None
    assert after[-1].sphericity > after[0].sphericity + 1e-4
    assert all(inward_faces(s.vertices, mesh.faces, s.vertices.mean(axis=0)) == 0 for s in after[::20])
