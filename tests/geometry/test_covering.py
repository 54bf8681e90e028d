"""How often a surface covers the sphere, and what becomes of those that do it otherwise than once."""

from __future__ import annotations

from functools import cache
from itertools import islice

import numpy as np
import pytest

from spherify.geometry import measures
from spherify.geometry.covering import covering
from spherify.geometry.flow import FlowState, StopReason, flow
from spherify.geometry.kernels import ENGINES, get_engine
from spherify.geometry.kernels.thinning import CompiledThinning
from spherify.geometry.mesh import TriangleMesh
from spherify.geometry.methods import decisions
from spherify.geometry.methods.control import Control, Phase
from spherify.geometry.presets import PRESETS
from spherify.geometry.samples.solids import icosphere
from spherify.geometry.topology import Topology
from tests.geometry.shapes import drum

ROBUST = PRESETS["robust"].config


def wound(turns, around, rings, thickness=0.1):
    """A tube along a flat spiral, closed at its ends by a vertex each."""
    along = np.linspace(0, 1, rings + 1)
    angle, out = 2 * np.pi * turns * along, 0.3 + 0.7 * along
    line = np.stack([out * np.cos(angle), out * np.sin(angle), 0 * along], axis=1)
    up = np.array([0.0, 0.0, 1.0])
    aside = measures.normalised(np.cross(up, np.gradient(line, axis=0)))
    turn = 2 * np.pi * np.arange(around) / around
    radius = thickness * np.sqrt(1 - (2 * along - 1) ** 8)
    ring = np.cos(turn)[:, None, None] * aside + np.sin(turn)[:, None, None] * up
    tube = (line + radius[:, None] * ring)[:, 1:-1].transpose(1, 0, 2).reshape(-1, 3)
    here = np.arange(around)
    there, last = (here + 1) % around, (rings - 2) * around
    faces = [np.stack([here, there, np.full(around, len(tube))], axis=1)]
    faces.append(np.stack([last + there, last + here, np.full(around, len(tube) + 1)], axis=1))
    for row in range(0, last, around):
        faces.append(np.stack([row + there, row + here, row + around + here], axis=1))
        faces.append(np.stack([row + there, row + around + here, row + around + there], axis=1))
    V, F = np.vstack([tube, line[[0, -1]]]), np.concatenate(faces)
    return TriangleMesh.checked(V, F if measures.volume(V, F, np.zeros(3)) > 0 else F[:, ::-1])


def kernel(mesh, engine):
    return get_engine(engine).prepare(Topology.of(len(mesh.vertices), mesh.faces), ROBUST)


def seen_from(point, mesh):
    return covering(mesh.vertices, mesh.faces, point)


@cache
def run(turns: float, around: int, rings: int) -> tuple[list[Control], list[float], FlowState]:
    """What a run did next and its sphericity, after each iteration, and its end."""
    controls, sphericities = [], []
    for state in flow(wound(turns, around, rings), ROBUST, engine="compiled"):
        controls.append(Control(*state.checkpoint()["control"]))
        sphericities.append(state.sphericity)
    return controls, sphericities, state


@pytest.mark.parametrize("engine", ENGINES)
def test_a_point_inside_is_found_where_the_centroid_is_outside(engine):
    for mesh in (wound(0.9, 12, 60), wound(2.2, 12, 120)):
        centroid, within = mesh.vertices.mean(axis=0), kernel(mesh, engine)
        assert within.covering(mesh.vertices, centroid).degree == 0
        found = within.centre_inside(mesh.vertices, centroid)
        assert seen_from(found, mesh).degree == 1 == within.covering(mesh.vertices, found).degree


@pytest.mark.parametrize("engine", ENGINES)
def test_a_point_inside_once_is_found_from_one_inside_twice(engine):
    """Between the outer and the inner of two balls, both of which look outward, is a point within one of them."""
    ball = icosphere(6)
    V = np.vstack([ball.vertices, 0.5 * ball.vertices])
    mesh = TriangleMesh(V, np.vstack([ball.faces, ball.faces + len(ball.vertices)]))
    near = np.array([0.01, 0.02, 0.03])
    assert seen_from(near, mesh).degree == 2
    found = kernel(mesh, engine).centre_inside(mesh.vertices, near)
    assert seen_from(found, mesh).degree == 1
    assert 0.5 < np.linalg.norm(found) < 1


@pytest.mark.parametrize("engine", ENGINES)
def test_a_point_inside_once_is_found_however_narrow_what_lies_around_it(engine):
    """All wide ways lead through what is within several balls at once."""
    ball = icosphere(6)
    radii = (1.0, 0.95, 0.6, 0.3)
    V = np.vstack([radius * ball.vertices for radius in radii])
    mesh = TriangleMesh(V, np.vstack([ball.faces + i * len(ball.vertices) for i in range(len(radii))]))
    near = np.array([0.01, 0.02, 0.03])
    assert seen_from(near, mesh).degree == len(radii)
    found = kernel(mesh, engine).centre_inside(mesh.vertices, near)
    assert seen_from(found, mesh).degree == 1


@pytest.mark.parametrize("engine", ENGINES)
def test_none_is_found_where_there_is_none(engine):
    ball = icosphere(4)
    inward = TriangleMesh(ball.vertices, np.ascontiguousarray(ball.faces[:, ::-1]))
    assert kernel(inward, engine).centre_inside(ball.vertices, np.array([0.01, 0.02, 0.03])) is None


@pytest.mark.parametrize("mesh", [wound(2.2, 12, 120), icosphere(6)])
def test_both_engines_see_the_same(mesh):
    """From two points, and of the sphere also from a vertex."""
    V, (one, other) = mesh.vertices, (kernel(mesh, engine) for engine in ENGINES)
    for centre in (V.mean(axis=0), np.array([0.3, 0.1, 0.02]), V[7]):
        a, b = one.covering(V, centre), other.covering(V, centre)
        assert a.degree == b.degree
        assert a.turned == pytest.approx(b.turned, abs=1e-12)
        if not (centre == V[7]).all():  # whose faces look nowhere: rounding
            assert one.folds(V, centre) == pytest.approx(other.folds(V, centre), rel=1e-9)


def test_what_t_winds_around_itself_becomes_a_true_sphere():
    """About a point that it goes around once: the centroid is inside more often when T gets no further.

    Whether that is looked for because nothing gets rounder or because it is late depends on the last bits.
    """
    controls, _, last = run(2.0, 16, 150)
    phases = [control.phase for control in controls]
    sphere = phases.index(Phase.SPHERE)
    assert set(phases[:sphere]) <= {Phase.NORMALS, Phase.FOLDED}
    assert phases[-1] == Phase.STAR
    areas = measures.face_areas(last.vertices, wound(2.0, 16, 150).faces)
    assert last.sphericity >= 0.995
    assert last.metrics().inward_faces == 0
    assert areas.min() > 1e-6 * areas.mean()


COARSE_COILS = [(1.5, 10, 80), (1.2, 8, 60), (1.8, 8, 90), (2.0, 8, 60)]


@pytest.mark.parametrize("coil", COARSE_COILS)
def test_what_is_lost_with_all_rounds_is_unfolded_with_fewer(coil):
    """So few triangles that they pass the centre as they are drawn: the sphere is not covered once any more."""
    controls, _, last = run(*coil)
    assert any(control.rounds < 1 for control in controls)
    assert last.metrics().inward_faces == 0
    assert last.sphericity > 0.98  # no more can be had of so few triangles


@pytest.mark.parametrize("coil", COARSE_COILS)
def test_what_cannot_be_unwound_ends_as_it_was_and_not_collapsed(coil, monkeypatch):
    monkeypatch.setattr(decisions, "LEAST_ROUNDS", ROBUST.unfolding.rounds)
    monkeypatch.setattr(CompiledThinning, "most", 0)
    controls, sphericities, last = run.__wrapped__(*coil)
    phases = [control.phase for control in controls]
    assert last.stop_reason == StopReason.STALLED
    assert "unwound" in last.stop_detail
    begun = phases.index(Phase.SPHERE) - 1
    assert last.sphericity > max(sphericities[:begun]) - 0.01


def test_a_run_goes_back_to_the_state_it_was_roundest_in():
    """Fans of 110 triangles: T along the normals goes on from the third iteration to turn them over."""
    *states, last = flow(drum(110, 4), ROBUST, engine="compiled")
    phases = [Control(*state.checkpoint()["control"]).phase for state in states]
    folded = phases.index(Phase.FOLDED)
    assert states[folded].best.iteration < 10
    assert states[folded].sphericity < states[folded].best.sphericity - 0.05
    assert states[folded + 1].sphericity > 0.9
    assert last.sphericity > 0.98
    assert last.metrics().inward_faces == 0


def test_going_back_resumes_bit_by_bit():
    mesh = drum(110, 4)
    whole = []
    for state in flow(mesh, ROBUST, engine="compiled"):
        whole.append(state)
        if Control(*state.checkpoint()["control"]).phase == Phase.SMOOTHING:
            break
    folded = next(s.iteration for s in whole if Control(*s.checkpoint()["control"]).phase == Phase.FOLDED)
    for start in range(folded - 1, folded + 3):
        resumed = flow(mesh, ROBUST, engine="compiled", resume=whole[start].checkpoint())
        rest = whole[start + 1 :]
        for state, expected in zip(islice(resumed, len(rest)), rest, strict=True):
            assert state.vertices.tobytes() == expected.vertices.tobytes()


def assert_resumes_around(whole, mesh, iteration):
    for start in range(iteration - 3, iteration + 2):
        resumed = flow(mesh, ROBUST, engine="compiled", resume=whole[start].checkpoint())
        for state, expected in zip(resumed, whole[start + 1 :], strict=True):
            assert state.vertices.tobytes() == expected.vertices.tobytes()


def test_beginning_anew_resumes_bit_by_bit():
    mesh = wound(1.2, 8, 60)
    whole = list(flow(mesh, ROBUST, engine="compiled"))
    rounds = [Control(*state.checkpoint()["control"]).rounds for state in whole]
    assert_resumes_around(whole, mesh, next(i for i, share in enumerate(rounds) if share < 1))


def test_giving_up_resumes_bit_by_bit(monkeypatch):
    monkeypatch.setattr(decisions, "LEAST_ROUNDS", ROBUST.unfolding.rounds)
    monkeypatch.setattr(CompiledThinning, "most", 0)
    mesh = wound(1.5, 10, 80)
    whole = list(flow(mesh, ROBUST, engine="compiled"))
    given_up = [Control(*state.checkpoint()["control"]).given_up for state in whole]
    assert_resumes_around(whole, mesh, given_up.index(True))
