"""Directions set anew in a run: when, once, and what it goes on with; what nothing else unfolds ends as a sphere."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import groupby, islice

import numpy as np
import pytest

from spherify.geometry import measures
from spherify.geometry.flow import FlowState, StopReason, flow
from spherify.geometry.kernels import get_engine
from spherify.geometry.kernels.compiled import CompiledKernel
from spherify.geometry.kernels.sphere import OnTheSphere
from spherify.geometry.kernels.thinning import CompiledThinning
from spherify.geometry.mesh import TriangleMesh
from spherify.geometry.methods import control, decisions
from spherify.geometry.methods.control import Control, Phase
from spherify.geometry.methods.decisions import Decisions
from spherify.geometry.roundness import Shape
from spherify.geometry.samples.solids import icosphere
from spherify.geometry.topology import Topology
from spherify.geometry.unfolding import folds
from tests.geometry.shapes import drum, sample
from tests.geometry.test_covering import wound
from tests.geometry.test_reinsertion import CENTRE, ROBUST, coil


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
        deciding = Decisions(kernel, ROBUST, ROBUST.unfolding, mesh.faces, len(mesh.vertices))
        assert deciding.may_set_anew(Control(0.0, 1.0, 0.5, 0)) == may


def test_two_balls_that_touch_in_two_vertices_are_no_sphere_though_their_euler_number_is():
    ball = icosphere(4)
    n, poles = len(ball.vertices), [int(ball.vertices[:, 2].argmax()), int(ball.vertices[:, 2].argmin())]
    other = np.arange(n, 2 * n)
    other[poles] = poles
    F = np.concatenate([ball.faces, other[ball.faces]])
    used, F = np.unique(F, return_inverse=True)
    F = F.reshape(-1, 3)
    topology = Topology.of(len(used), F)
    assert topology.euler == 2
    assert topology.n_components == 1
    kernel = get_engine("compiled").prepare(topology, ROBUST)
    for faces, may in ((F, False), (ball.faces, True)):
        deciding = Decisions(kernel, ROBUST, ROBUST.unfolding, faces, int(faces.max()) + 1)
        assert deciding.may_set_anew(Control(0.0, 1.0, 0.5, 0)) == may
    unused = Decisions(kernel, ROBUST, ROBUST.unfolding, ball.faces, n + 1)
    assert not unused.may_set_anew(Control(0.0, 1.0, 0.5, 0))


def test_what_cannot_be_set_anew_is_tried_once(monkeypatch):
    asked = []
    monkeypatch.setattr(decisions, "reinserted", lambda *_: asked.append(1))
    monkeypatch.setattr(decisions, "LONG_FOLDED", 10)
    *_, last = flow(coil(4, 80), BRIEFLY, engine="compiled")
    assert len(asked) == 1
    assert Control(*last.checkpoint()["control"]).anew == control.GONE_ON


def test_that_it_was_set_anew_is_known_from_phase_to_phase():
    ball = icosphere(4)
    kernel = get_engine("compiled").prepare(Topology.of(len(ball.vertices), ball.faces), ROBUST)
    shape, was = kernel.shape(ball.vertices), Control(0.0, 1.0, 0.0, 0, anew=control.SET)
    for then in (was.as_star(shape), was.as_finish(shape), was.on_the_sphere(3, 0.1), was.more_carefully()):
        assert then.anew == control.SET


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
    states = flow(wound(3, 14, 240), ROBUST, engine="compiled")
    controls = (Control(*state.checkpoint()["control"]) for state in states)
    return [(Phase(int(one.phase)), one.anew) for one in controls]


def test_that_is_what_a_run_does():
    seen = [key for key, _ in groupby(run_of_a_spring())]
    begun = seen.index((Phase.FINISH, control.SET))
    assert seen[begun - 1] == (Phase.SPHERE, 0.0)
    assert seen[begun + 1] == (Phase.STAR, control.GONE_ON)


def test_a_run_ends_about_the_centroid_as_far_as_all_look_outward_from_there():
    ball = icosphere(4)
    kernel = get_engine("compiled").prepare(Topology.of(len(ball.vertices), ball.faces), ROBUST)
    far = np.array([3.0, 0, 0])
    assert (decisions.nearer(kernel, ball.vertices, CENTRE, np.zeros(3)) == 0).all()
    assert decisions.nearer(kernel, ball.vertices, np.zeros(3), far) == pytest.approx(far / 4)
    assert (decisions.nearer(kernel, ball.vertices, np.zeros(3), 100 * far) == 0).all()


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
    for state in flow(wound(0.5, 16, 120), replace(ROBUST, iterations=800), engine="compiled"):
        anew.append((len(asked), Control(*state.checkpoint()["control"]).anew > 0))
    assert (0, False) in anew
    assert (1, False) not in anew, "in the very iteration"
    assert anew[-1] == (1, True)
    assert state.metrics().inward_faces == 0
    assert state.sphericity > 0.99
