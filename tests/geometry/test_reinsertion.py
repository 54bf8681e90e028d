"""Directions set anew: from whatever tangle, all look outward; in a run, what nothing else unfolds ends as a sphere."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import groupby, islice

import numpy as np
import pytest

from spherify.geometry import measures, reinsertion
from spherify.geometry.covering import covering
from spherify.geometry.flow import FlowState, StopReason, flow
from spherify.geometry.kernels import get_engine
from spherify.geometry.kernels.compiled import CompiledKernel
from spherify.geometry.kernels.sphere import OnTheSphere
from spherify.geometry.kernels.thinning import CompiledThinning
from spherify.geometry.mesh import TriangleMesh
from spherify.geometry.methods import control, decisions
from spherify.geometry.methods.control import Control, Phase
from spherify.geometry.methods.decisions import Decisions
from spherify.geometry.plain_thinning import PlainThinning
from spherify.geometry.presets import PRESETS
from spherify.geometry.reinsertion import drawn, mended, reinserted
from spherify.geometry.roundness import Shape, sphericity
from spherify.geometry.samples.solids import icosphere
from spherify.geometry.thinning import volumes
from spherify.geometry.topology import Topology
from spherify.geometry.unfolding import folds
from tests.geometry.shapes import drum, octahedron, sample, tetrahedron
from tests.geometry.test_covering import wound

ROBUST = PRESETS["robust"].config
CENTRE = np.array([0.01, -0.02, 0.005])
MESHES = {
    "tetrahedron": tetrahedron(),
    "octahedron": octahedron(),
    "ball": icosphere(6),
    "drum": drum(24, 3),
    "fans": drum(60, 1),
    "coil": wound(1.5, 5, 40),
    "string": wound(0.9, 4, 60),
}


def coil(turns: int, rings: int, around: int = 6) -> TriangleMesh:
    """A tube along a helix, closed at its ends by a vertex each."""
    angle = np.linspace(0, 2 * np.pi * turns, rings)
    line = np.stack([np.cos(angle), np.sin(angle), 0.8 * angle / (2 * np.pi)], axis=1)
    ahead = measures.normalised(np.gradient(line, axis=0))
    out = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    turn = 2 * np.pi * np.arange(around) / around
    ring = np.cos(turn)[:, None] * out[:, None] + np.sin(turn)[:, None] * np.cross(ahead, out)[:, None]
    tube = (line[:, None] + 0.25 * ring).reshape(-1, 3)
    V = np.vstack([tube, line[:1] - 0.25 * ahead[:1], line[-1:] + 0.25 * ahead[-1:]])
    here = np.arange(around)
    there, last, n = (here + 1) % around, (rings - 1) * around, len(tube)
    faces = [np.stack([np.full(around, n), here, there], axis=1)]
    faces.append(np.stack([np.full(around, n + 1), last + there, last + here], axis=1))
    for row in range(0, last, around):
        faces.append(np.stack([row + here, row + around + there, row + there], axis=1))
        faces.append(np.stack([row + here, row + around + here, row + around + there], axis=1))
    F = np.concatenate(faces)
    return TriangleMesh.checked(V, F if measures.volume(V, F, np.zeros(3)) > 0 else F[:, ::-1])


def vessel(around: int, rings: int, depth: float = 5.0, wall: float = 0.12) -> TriangleMesh:
    """A deep tube with a wall, closed at one end, round about the z axis."""
    arc, straight = np.linspace(0, np.pi / 2, 8)[1:], np.linspace(0, depth, rings)[1:]
    outer = [*((np.sin(a), -np.cos(a)) for a in arc), *((1.0, z) for z in straight)]
    inner = [((1 - wall) * r, (1 - wall) * z if z < 0 else z) for r, z in reversed(outer)]
    profile = np.array(outer + inner)
    turn = 2 * np.pi * np.arange(around) / around
    r, z = profile[:, 0, None], np.broadcast_to(profile[:, 1, None], (len(profile), around))
    tube = np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=2).reshape(-1, 3)
    here = np.arange(around)
    there, last, n = (here + 1) % around, (len(profile) - 1) * around, len(tube)
    faces = [np.stack([np.full(around, n), there, here], axis=1)]
    faces.append(np.stack([np.full(around, n + 1), last + here, last + there], axis=1))
    for row in range(0, last, around):
        faces.append(np.stack([row + here, row + there, row + around + there], axis=1))
        faces.append(np.stack([row + here, row + around + there, row + around + here], axis=1))
    V, F = np.vstack([tube, [[0, 0, -1.0], [0, 0, wall - 1]]]), np.concatenate(faces)
    return TriangleMesh.checked(V, F if measures.volume(V, F, np.zeros(3)) > 0 else F[:, ::-1])


def tangled(mesh: TriangleMesh, seed: int = 0):
    """Vertices anywhere about the centre."""
    return np.asfortranarray(CENTRE + np.random.default_rng(seed).normal(size=mesh.vertices.shape))


@pytest.mark.parametrize("way", [PlainThinning, CompiledThinning])
@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES.keys())
def test_from_any_tangle_all_faces_look_outward_and_cover_the_sphere_once(mesh, way):
    V = tangled(mesh)
    found = reinserted(V, mesh.faces, CENTRE, way)
    spokes = found - CENTRE
    inward, least = folds(measures.normalised(spokes), mesh.faces)
    assert inward == 0
    assert least > 1e-3
    assert covering(found, mesh.faces, CENTRE).degree == 1
    assert measures.norm(spokes) == pytest.approx(measures.norm(V - CENTRE).mean(), rel=1e-12)


def test_twice_is_the_same_to_the_last_bit():
    mesh = MESHES["coil"]
    one, other = (reinserted(tangled(mesh), mesh.faces, CENTRE, CompiledThinning) for _ in range(2))
    assert one.tobytes() == other.tobytes()


@pytest.mark.parametrize("name", ["ball", "coil"])
def test_a_drawing_is_turned_to_where_vertices_were(name):
    mesh = MESHES[name]
    U = measures.normalised(tangled(mesh) - CENTRE)
    turn, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    one, other = (drawn(V, mesh.faces, CompiledThinning) for V in (U, U @ turn))
    assert other == pytest.approx(one @ turn, abs=1e-9)
    small = np.array([[0, -1, 2], [1, 0, -3], [-2, 3, 0]]) * 1e-3
    for angle in (small, -small):  # turned a little further, vertices are farther from where they were
        further = one + one @ angle + 0.5 * one @ angle @ angle
        assert (further * U).sum() < (one * U).sum()


def roundness(U, F):
    return sphericity(float(measures.face_areas(U, F).sum()), measures.volume(U, F, np.zeros(3)))


def test_a_ball_is_drawn_as_the_round_one_that_it_is():
    """Nothing but who is whose neighbour tells."""
    ball = icosphere(8)
    U = drawn(tangled(ball), ball.faces, CompiledThinning)
    assert folds(U, ball.faces)[1] > 0.1
    assert roundness(U, ball.faces) > 0.99


@pytest.mark.parametrize("way", [PlainThinning, CompiledThinning])
def test_directions_that_look_outward_are_kept_but_for_room(way):
    ball = icosphere(6)
    U = ball.vertices.copy()
    U[7] = -U[7]
    found = mended(U, ball.faces, way)
    assert folds(found, ball.faces)[0] == 0
    assert found[7] @ ball.vertices[7] > 0.99
    assert (measures.norm(found - ball.vertices) < 0.1).all()
    turned_over = U * [1, 1, -1]
    assert mended(turned_over, ball.faces, way) is None, "covers the sphere, but the other way round"


def test_of_both_the_rounder_is_taken():
    ball, string = icosphere(6), coil(4, 80)
    U = ball.vertices.copy()
    U[7] = -U[7]
    taken = set()
    for V, F in ((U, ball.faces), (measures.normalised(string.vertices), string.faces)):
        both = [make(V, F, CompiledThinning) for make in (mended, drawn)]
        found = reinserted(V, F, np.zeros(3), CompiledThinning)
        best = int(np.argmax([-1 if D is None else roundness(D, F) for D in both]))
        assert found == pytest.approx(both[best], abs=1e-12)
        taken.add(best)
    assert taken == {0, 1}


@pytest.mark.parametrize("way", [PlainThinning, CompiledThinning])
def test_of_more_vertices_than_can_be_waited_for_it_keeps_off(monkeypatch, way):
    ball = icosphere(3)
    monkeypatch.setattr(way, "most", len(ball.vertices) - 1)
    assert reinserted(tangled(ball), ball.faces, CENTRE, way) is None
    monkeypatch.setattr(way, "most", len(ball.vertices))
    assert reinserted(tangled(ball), ball.faces, CENTRE, way) is not None


def test_where_rounding_leaves_a_vertex_no_place_there_is_none(monkeypatch):
    ball, put_back, asked = icosphere(3), CompiledThinning.put_back, []

    def none(self, U):
        asked.append(len(self.left))
        return len(self.left) < 20 and put_back(self, U)

    monkeypatch.setattr(CompiledThinning, "put_back", none)
    assert reinserted(tangled(ball), ball.faces, CENTRE, CompiledThinning) is None
    assert asked[-1] == asked[-2], "asked again after room was made"


BRIEFLY = replace(ROBUST, iterations=280)  # what follows makes it rounder, and takes long


@cache
def run() -> list[FlowState]:
    return list(flow(coil(4, 80), BRIEFLY, engine="compiled"))


def test_a_coil_that_nothing_unwinds_ends_as_a_sphere(monkeypatch):
    *_, last = flow(coil(4, 80), ROBUST, engine="compiled")
    areas = measures.face_areas(last.vertices, coil(4, 80).faces)
    assert last.stop_reason == StopReason.STALLED
    assert last.metrics().inward_faces == 0
    assert areas.min() > 1e-6 * areas.mean()
    assert last.sphericity > 0.97
    monkeypatch.setattr(decisions, "reinserted", lambda *_: None)
    *_, tangle = flow(coil(4, 80), BRIEFLY, engine="compiled")
    assert tangle.metrics().inward_faces > 100


def first_anew(states) -> int:
    """Return the first state of those whose directions were set anew."""
    controls = [Control(*state.checkpoint()["control"]) for state in states]
    return next(i for i, control in enumerate(controls) if control.anew)


def test_that_resumes_bit_by_bit():
    begun = first_anew(run())
    for start in range(begun - 3, begun + 2):
        resumed = islice(flow(coil(4, 80), BRIEFLY, engine="compiled", resume=run()[start].checkpoint()), 10)
        for state, expected in zip(resumed, run()[start + 1 : start + 11], strict=True):
            assert state.vertices.tobytes() == expected.vertices.tobytes()


def test_folds_are_waited_for_as_long_whenever_they_begin(monkeypatch):
    for long in (35, 45):
        monkeypatch.setattr(decisions, "LONG_FOLDED", long)
        states = list(flow(wound(1.5, 10, 80), BRIEFLY, engine="compiled"))
        controls = [Control(*state.checkpoint()["control"]) for state in states]
        begun = next(i for i, control in enumerate(controls) if control.phase == Phase.SPHERE)
        assert first_anew(states) - begun == long
        assert states[-1].metrics().inward_faces == 0


def test_around_too_large_a_hub_nothing_is_set_anew(monkeypatch):
    mesh = drum(60, 1)
    squares = int((np.bincount(mesh.faces.reshape(-1)) ** 2).sum())
    kernel = get_engine("compiled").prepare(Topology.of(len(mesh.vertices), mesh.faces), ROBUST)
    for most, may in ((squares, True), (squares - 1, False)):
        monkeypatch.setattr(decisions, "MOST_SQUARES", most)
        deciding = Decisions(kernel, ROBUST, ROBUST.unfolding, mesh.faces)
        assert deciding.may_set_anew(Control(0.0, 1.0, 0.5, 0)) == may


def test_what_cannot_be_set_anew_is_tried_once(monkeypatch):
    asked = []
    monkeypatch.setattr(decisions, "reinserted", lambda *_: asked.append(1))
    monkeypatch.setattr(decisions, "LONG_FOLDED", 10)
    *_, last = flow(coil(4, 80), BRIEFLY, engine="compiled")
    assert len(asked) == 1
    assert Control(*last.checkpoint()["control"]).anew == control.SET


def test_that_it_was_set_anew_is_known_from_phase_to_phase():
    ball = icosphere(4)
    kernel = get_engine("compiled").prepare(Topology.of(len(ball.vertices), ball.faces), ROBUST)
    shape, was = kernel.shape(ball.vertices), Control(0.0, 1.0, 0.0, 0, anew=control.SET)
    for then in (was.as_star(shape), was.as_finish(shape), was.on_the_sphere(3, 0.1), was.more_carefully()):
        assert then.anew == control.SET


@pytest.mark.parametrize("share", [0.5, 2])
def test_of_what_is_kept_no_triangle_may_be_too_small(monkeypatch, share):
    ball = icosphere(6)
    U = ball.vertices.copy()
    U[7] = -U[7]
    found = volumes(mended(U, ball.faces, CompiledThinning), ball.faces)
    monkeypatch.setattr(reinsertion, "ENOUGH", share * found.min() / found.mean())
    assert (mended(U, ball.faces, CompiledThinning) is None) == (share > 1)


def test_before_a_place_is_looked_for_again_room_is_made(monkeypatch):
    ball, calls = icosphere(3), []
    put_back, relax = CompiledThinning.put_back, CompiledThinning.relax

    def not_the_third_time(self, U):
        calls.append("put")
        return calls.count("put") != 3 and put_back(self, U)

    def noted(self, U, sweeps):
        calls.append(sweeps)
        relax(self, U, sweeps)

    monkeypatch.setattr(CompiledThinning, "put_back", not_the_third_time)
    monkeypatch.setattr(CompiledThinning, "relax", noted)
    assert drawn(tangled(ball), ball.faces, CompiledThinning) is not None
    third = [i for i, call in enumerate(calls) if call == "put"][2]
    assert calls[third + 1 : third + 3] == [reinsertion.SWEEPS[0], "put"]


@pytest.mark.parametrize("most", [CompiledThinning.most, 0])
def test_what_gets_no_better_on_the_sphere_does_not_end_folded_if_it_need_not(monkeypatch, most):
    monkeypatch.setattr(control, "PATIENCES", 0)
    monkeypatch.setattr(control, "WAITED", 0)
    monkeypatch.setattr(decisions, "LEAST_ROUNDS", ROBUST.unfolding.rounds)
    monkeypatch.setattr(CompiledThinning, "most", most)
    mesh = wound(1.5, 10, 80)
    *states, last = flow(mesh, BRIEFLY, engine="compiled")
    assert (last.metrics().inward_faces == 0) == (most > 0)
    assert last.stop_reason == StopReason.STALLED
    assert ("on the sphere" in last.stop_detail) == (most == 0)
    if most:  # and what its directions go on from are not those of before
        kept = [state.checkpoint() for state in states]
        begun = kept[first_anew(states)]
        assert Control(*begun["control"]).phase == Phase.FINISH
        assert folds(measures.normalised(begun["previous"] - begun["centre"]), mesh.faces)[0] == 0


def test_what_a_step_of_t_would_break_goes_on_from_its_best_state(monkeypatch):
    """The inner wall slides out through the bottom."""
    mesh = vessel(20, 40)
    *_, last = flow(mesh, ROBUST, engine="compiled")
    areas = measures.face_areas(last.vertices, mesh.faces)
    assert last.stop_reason in {StopReason.STALLED, StopReason.CONVERGED}
    assert last.metrics().inward_faces == 0
    assert areas.min() > 1e-6 * areas.mean()
    assert last.sphericity >= 0.995
    monkeypatch.setattr(decisions, "reinserted", lambda *_: None)
    *_, broken = flow(mesh, ROBUST, engine="compiled")
    assert broken.stop_reason == StopReason.COLLAPSED


def test_what_a_step_along_the_radii_would_break_is_finished(monkeypatch):
    transformed = CompiledKernel.transform_radially
    mesh = sample("quadruped", 600)
    monkeypatch.setattr(
        CompiledKernel, "transform_radially", lambda self, V, *rest: transformed(self, V, *rest) * -1
    )
    states = list(flow(mesh, ROBUST, engine="compiled"))
    phases = [Control(*state.checkpoint()["control"]).phase for state in states]
    assert states[-1].stop_reason == StopReason.STALLED
    assert phases[-1] == Phase.FINISH
    assert states[-1].metrics().inward_faces == 0


@pytest.mark.parametrize("way", [PlainThinning, CompiledThinning])
def test_around_a_hub_many_are_taken_out_at_once(monkeypatch, way):
    mesh = drum(300, 1)
    left, level = [], way._level
    monkeypatch.setattr(way, "_level", lambda self, **how: left.append(len(self.left)) or level(self, **how))
    way(tangled(mesh), mesh.faces).until_four()
    assert left[0] == len(mesh.vertices)
    assert len(left) < 40


def test_what_was_set_anew_is_finished_until_it_is_round_and_t_goes_on_once():
    round_, rough = (
        Shape(4 * np.pi / share, 4 / 3 * np.pi, CENTRE, 0.1, 0.0) for share in (control.SHORT + 1e-6, 0.99)
    )
    folded = Control(0.0, 1.0, 0.5, 0, Phase.SPHERE, 1.0, 3.0)
    assert folded.set_anew(rough, 1000).phase == Phase.FINISH
    assert folded.set_anew(rough, control.MOST + 1).phase == Phase.STAR, "too many to be finished"
    assert folded.set_anew(round_, 1000).phase == Phase.STAR
    begun = folded.set_anew(rough, 1000)
    assert not begun.goes_on(rough)
    assert begun.goes_on(round_)
    assert not begun._replace(anew=control.GONE_ON).goes_on(round_)
    assert not folded.as_finish(rough).goes_on(round_), "what was not set anew ends there"


@cache
def run_of_a_spring() -> list[tuple[Phase, float]]:
    states = flow(wound(3, 12, 200), ROBUST, engine="compiled")
    controls = (Control(*state.checkpoint()["control"]) for state in states)
    return [(Phase(int(one.phase)), one.anew) for one in controls]


def test_that_is_what_a_run_does():
    seen = [key for key, _ in groupby(run_of_a_spring())]
    assert seen[-4:-1] == [
        (Phase.SPHERE, 0.0),
        (Phase.FINISH, control.SET),
        (Phase.STAR, control.GONE_ON),
    ]


def test_a_run_ends_about_the_centroid_as_far_as_all_look_outward_from_there():
    ball = icosphere(4)
    kernel = get_engine("compiled").prepare(Topology.of(len(ball.vertices), ball.faces), ROBUST)
    far = np.array([3.0, 0, 0])
    assert (decisions.nearer(kernel, ball.vertices, CENTRE, np.zeros(3)) == 0).all()
    assert decisions.nearer(kernel, ball.vertices, np.zeros(3), far) == pytest.approx(far / 4)
    assert (decisions.nearer(kernel, ball.vertices, np.zeros(3), 100 * far) == 0).all()


@pytest.mark.parametrize("bad", [0.0, np.nan, np.inf])
def test_what_has_no_directions_is_left_alone(bad):
    ball = icosphere(3)
    V = (
        ball.vertices * bad
        if bad == 0
        else np.where(np.arange(len(ball.vertices))[:, None] == 5, bad, ball.vertices)
    )
    with np.errstate(invalid="ignore"):
        assert reinserted(V, ball.faces, np.zeros(3)) is None


@pytest.mark.parametrize("how", [(1, 1e-9), (0, np.nan)], ids=["turned", "no-number"])
def test_where_rounding_ends_the_drawing_apart_directions_are_set_anew(monkeypatch, how):
    """As on a random tree of 3,000 vertices, of whose tips unfolding had left 1e-25, and which ended as collapsed."""
    spread, asked = OnTheSphere.spread, []

    def as_if_rounded(self, V, centre, rounds):
        found = spread(self, V, centre, rounds)
        asked.append(len(asked))
        return replace(found, inward=how[0], least_area=how[1])

    monkeypatch.setattr(OnTheSphere, "spread", as_if_rounded)
    anew = []
    for state in flow(wound(0.5, 20, 200), replace(ROBUST, iterations=800), engine="compiled"):
        anew.append((len(asked), Control(*state.checkpoint()["control"]).anew > 0))
    assert (0, False) in anew
    assert (1, False) not in anew, "in the very iteration"
    assert anew[-1] == (1, True)
    assert state.metrics().inward_faces == 0
    assert state.sphericity > 0.99
