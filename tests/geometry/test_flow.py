"""The flow as a whole: every reason to stop, the best state, invariance, and the same bits again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spherify.geometry.config import Annealing, FlowConfig, Stage, Unfolding
from spherify.geometry.errors import InvalidConfigError, InvalidMeshError
from spherify.geometry.flow import StopReason, flow
from spherify.geometry.kernels.reference import ReferenceEngine
from spherify.geometry.mesh import TriangleMesh
from spherify.geometry.presets import PRESETS
from spherify.geometry.samples.solids import icosphere
from spherify.geometry.topology import Topology
from tests.geometry.shapes import (
    icosahedron,
    jittered,
    octahedron,
    open_bump,
    pinched,
    prism,
    sample,
    tetrahedron,
    torus,
    uneven_sphere,
)

ROBUST = PRESETS["robust"].config
PAPER = PRESETS["paper"].config


def run(mesh, config):
    """All states of a run; checks on the way what must hold of every one of them."""
    states = list(flow(mesh, config))
    closed = Topology.of(len(mesh.vertices), mesh.faces).closed
    for i, state in enumerate(states):
        assert not state.vertices.flags.writeable
        assert np.isfinite(state.vertices).all()
        assert (state.stop_reason is not None) == (state.stop_detail is not None) == (state is states[-1])
        assert state.best.sphericity >= state.sphericity
        assert state.best_iteration == state.best.iteration
        assert state.best.sphericity == max(earlier.sphericity for earlier in states[: i + 1])
        if closed and i % 20 == 0:
            assert state.metrics().volume > 0
        if state is not states[-1]:
            assert state.iteration == i
    assert states[0].vertices is mesh.vertices
    return states


def rotation(seed=3):
    matrix, _ = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))
    return matrix * np.sign(np.linalg.det(matrix))


class TestReasonsToStop:
    def test_all_iterations_done(self):
        last = run(sample("stone", 200), replace(PAPER, iterations=7))[-1]
        assert last.stop_reason is StopReason.ITERATIONS
        assert last.iteration == 7

    def test_no_iterations_asked(self):
        (only,) = run(sample("stone", 200), replace(PAPER, iterations=0))
        assert only.stop_reason is StopReason.ITERATIONS

    def test_converged(self):
        config = replace(ROBUST, unfolding=None, stop_radius_variation=0.01)
        states = run(jittered(icosphere(5), 0.1), config)
        assert states[-1].stop_reason is StopReason.CONVERGED
        assert states[-1].metrics().radius_variation < 0.01
        assert states[-2].metrics().radius_variation >= 0.01

    def test_a_folded_sphere_is_not_converged(self):
        """All its vertices lie on the unit sphere, but one was pushed past a neighbour: faces look inward."""
        mesh = icosphere(8)
        V = mesh.vertices.copy()
        ring = np.unique(mesh.faces[(mesh.faces == 0).any(axis=1)])
        pushed = 2.5 * V[ring[1]] - 1.5 * V[0]
        V[0] = pushed / np.linalg.norm(pushed)
        folded = mesh.with_vertices(V)
        states = run(folded, replace(ROBUST, iterations=500))
        assert states[0].metrics().inward_faces > 0
        assert states[-1].iteration > 0
        assert states[-1].stop_reason is StopReason.CONVERGED
        assert states[-1].metrics().inward_faces == 0

    @pytest.mark.parametrize("mesh", [icosphere(6), uneven_sphere(6), icosahedron(), octahedron()])
    def test_a_round_mesh_ends_at_once_as_converged(self, mesh):
        (only,) = run(mesh, ROBUST)
        assert only.stop_reason is StopReason.CONVERGED
        assert only.iteration == 0

    def test_what_is_round_already_has_nothing_prepared_for_it(self, monkeypatch):
        prepared, prepare = [], ReferenceEngine.prepare

        def told(*given):
            prepared.append(given)
            return prepare(*given)

        monkeypatch.setattr(ReferenceEngine, "prepare", told)
        (only,) = flow(icosphere(6), ROBUST, engine="reference")
        assert (only.stop_reason, prepared) == (StopReason.CONVERGED, [])
        only.metrics()
        assert len(prepared) == 1
        states = flow(jittered(icosphere(6), 0.1), ROBUST, engine="reference")
        next(states)
        assert len(prepared) == 1
        next(states)
        assert len(prepared) == 2
        flow(sample("stone", 200), ROBUST, engine="reference")
        assert len(prepared) == 3

    @pytest.mark.parametrize("unit", [1e-200, 1e200])
    def test_what_is_round_already_may_be_of_any_size(self, unit):
        mesh = icosphere(6)
        (only,) = flow(TriangleMesh(unit * mesh.vertices, mesh.faces), ROBUST, engine="reference")
        assert only.stop_reason is StopReason.CONVERGED

    def test_converged_though_few_triangles_keep_it_from_being_rounder(self):
        """The sphericity of 500 vertices stays below that of a sphere at once; the radii are equal all the same."""
        *_, last = flow(sample("stone", 500), ROBUST)
        assert last.sphericity < 0.999
        assert last.metrics().radius_variation < ROBUST.stop_radius_variation
        assert last.stop_reason is StopReason.CONVERGED

    def test_converged_though_nothing_makes_the_step_smaller(self):
        *_, last = flow(sample("stone", 500), replace(ROBUST, annealing=None, iterations=400))
        assert last.stop_reason is StopReason.CONVERGED

    def test_stalled(self):
        config = replace(ROBUST, annealing=Annealing(3, 0.5, 0.01), unfolding=None)
        last = run(sample("cube", 26), config)[-1]
        assert last.stop_reason is StopReason.STALLED
        assert "0.01" in last.stop_detail

    @pytest.mark.parametrize("name", ["tetrahedron", "octahedron", "icosahedron"])
    @pytest.mark.parametrize("measure", ["vtk", "length", "dual-area"])
    def test_constant_curvature(self, name, measure):
        """A Platonic solid in general position, its curvatures equal up to rounding only."""
        solid = {"tetrahedron": tetrahedron(), "octahedron": octahedron(), "icosahedron": icosahedron()}[name]
        mesh = solid.with_vertices(0.37 * solid.vertices @ rotation().T + np.array([11.0, -5.0, 3.0]))
        states = run(mesh, replace(PAPER, measure=measure))
        assert states[-1].stop_reason is StopReason.CONSTANT_CURVATURE
        assert states[-1].iteration == 0
        assert (states[-1].vertices == mesh.vertices).all()

    def test_collapsed(self):
        """An animal under the literal method turns inside out; its best state is what remains."""
        mesh = sample("quadruped", 1000)
        config = replace(PAPER, step=0.25 / 5)  # the mesh seen at a mean edge of 5
        states = run(mesh, config)
        last, broke_at = states[-1], states[-2].iteration + 1
        assert last.stop_reason is StopReason.COLLAPSED
        assert f"iteration {broke_at} " in last.stop_detail
        best = max(states, key=lambda state: state.sphericity)
        assert last.iteration == best.iteration == last.best.iteration
        assert (last.vertices == best.vertices).all()
        assert (last.best.vertices == best.vertices).all()
        assert last.sphericity == best.sphericity

    def test_collapsed_by_overflow(self):
        """A step beyond all numbers: caught before anything that is not finite is seen."""
        mesh = jittered(octahedron(), 0.2)
        states = run(mesh, replace(PAPER, step=1e308, step_unit="absolute"))
        assert [state.iteration for state in states] == [0, 0]
        assert states[-1].stop_reason is StopReason.COLLAPSED


class TestMeshesOfEveryKind:
    def test_a_plateau_of_equal_curvature_is_no_reason_to_stop(self):
        """Most vertices of a cube are flat: both percentiles of the window are 0, and the run has to go on."""
        turned = sample("cube", 600)
        turned = turned.with_vertices(turned.vertices @ rotation().T)
        for mesh in (sample("cube", 600), turned):
            assert run(mesh, replace(ROBUST, iterations=60))[-1].sphericity > 0.99

    @pytest.mark.parametrize("name", ["torus", "pinched", "prism", "open"])
    @pytest.mark.parametrize("preset", ["paper", "robust"])
    def test_runs(self, name, preset):
        mesh = {
            "torus": torus(),
            "pinched": jittered(pinched(), 0.1),
            "prism": prism(),
            "open": open_bump(9),
        }[name]
        states = run(mesh, replace(PRESETS[preset].config, iterations=20, boundary="free"))
        assert np.abs(states[-1].vertices - mesh.vertices).max() > 1e-4

    def test_two_components(self):
        one = jittered(icosphere(3), 0.1)
        V = np.concatenate([one.vertices, one.vertices + 5])
        mesh = TriangleMesh.checked(V, np.concatenate([one.faces, one.faces + len(one.vertices)]))
        assert run(mesh, replace(ROBUST, iterations=5))[-1].iteration == 5

    def test_meshes_without_meaning_are_refused_at_once(self):
        ball = icosphere(2)
        third = TriangleMesh.checked(ball.vertices, np.concatenate([ball.faces, ball.faces[:1]]))
        faces = ball.faces.copy()
        faces[0] = faces[0, ::-1]
        for mesh, sentence in (
            (TriangleMesh.checked(ball.vertices, ball.faces[:, ::-1]), "counter-clockwise seen from outside"),
            (ball.with_vertices(ball.vertices * np.array([1, 1, 0])), "enclose some volume"),
            (ball.with_vertices(ball.vertices * 0 + 1), "enclose some volume"),
            (third, "3 edges with more than two faces"),
            (
                TriangleMesh.checked(ball.vertices, faces),
                "3 edges along which both faces run in the same direction",
            ),
            (
                TriangleMesh.checked(np.vstack([ball.vertices, [[0, 0, 0]]]), ball.faces),
                "1 vertices in no face",
            ),
            (TriangleMesh.checked(ball.vertices, np.zeros((0, 3), int)), "no faces"),
        ):
            with pytest.raises(InvalidMeshError, match=sentence):
                flow(mesh, ROBUST)

    def test_an_unknown_engine_is_refused(self):
        with pytest.raises(InvalidConfigError, match="there are reference"):
            flow(icosphere(1), ROBUST, engine="steam")


INVARIANT = replace(ROBUST, iterations=8)
LITERAL = replace(PAPER, iterations=8, step=0.01, schedule=(Stage(2, 2, 1), Stage(1, 1, 2)))


@pytest.mark.parametrize("config", [INVARIANT, LITERAL], ids=["robust", "paper"])
class TestInvariance:
    """The same shape, whatever its place, size, position and numbering."""

    mesh = sample("non-convex-sphere", 252)

    def final(self, mesh, config):
        return run(mesh, config)[-1].vertices

    def test_rotation(self, config):
        turned = self.mesh.with_vertices(self.mesh.vertices @ rotation().T)
        np.testing.assert_allclose(
            self.final(turned, config), self.final(self.mesh, config) @ rotation().T, atol=1e-9
        )

    @pytest.mark.parametrize("distance", [1.0, 1e3, 1e6])
    def test_translation(self, config, distance):
        """The tolerance is what moving away rounds off the mesh itself, grown by the steps: t divides by the window.

        Momentum repeats what was rounded as well.
        """
        shift = distance * np.array([1.0, -2.0, 0.5])
        moved = self.mesh.with_vertices(self.mesh.vertices + shift)
        tolerance = 1e-9 + 2e6 * np.spacing(distance)
        np.testing.assert_allclose(
            self.final(moved, config) - shift, self.final(self.mesh, config), atol=tolerance
        )

    @pytest.mark.parametrize("factor", [1e-6, 3e-3, 7e2, 1e6, 1e-90, 1e90])
    def test_scale(self, config, factor):
        scaled = self.mesh.with_vertices(self.mesh.vertices * factor)
        np.testing.assert_allclose(
            self.final(scaled, config) / factor, self.final(self.mesh, config), atol=1e-9
        )

    def test_scale_by_a_power_of_two_changes_no_bit(self, config):
        scaled = self.mesh.with_vertices(self.mesh.vertices * 2.0**-30)
        assert (self.final(scaled, config) * 2.0**30 == self.final(self.mesh, config)).all()

    def test_relabelling(self, config):
        rng = np.random.default_rng(5)
        n = len(self.mesh.vertices)
        order, faces = rng.permutation(n), rng.permutation(len(self.mesh.faces))
        number = np.argsort(order)
        corners = number[self.mesh.faces[faces]]
        turned = np.stack(
            [np.roll(f, k) for f, k in zip(corners, rng.integers(0, 3, len(corners)), strict=True)]
        )
        relabelled = TriangleMesh.checked(self.mesh.vertices[order], turned)
        np.testing.assert_allclose(
            self.final(relabelled, config), self.final(self.mesh, config)[order], atol=1e-9
        )

    def test_mirror(self, config):
        """Mirrored and wound the other way, so that outside stays outside."""
        flip = np.array([-1.0, 1, 1])
        mirrored = TriangleMesh.checked(self.mesh.vertices * flip, self.mesh.faces[:, ::-1])
        np.testing.assert_allclose(
            self.final(mirrored, config) * flip, self.final(self.mesh, config), atol=1e-9
        )


@pytest.mark.parametrize("name", ["step", "step_bound", "relaxation_exponent", "stop_radius_variation"])
@pytest.mark.parametrize("value", [np.inf, np.nan, -1.0])
def test_parameters_that_no_run_can_have_are_refused(name, value):
    with pytest.raises(InvalidConfigError, match=name):
        FlowConfig(iterations=1, **{name: value})


def test_so_are_those_of_annealing_and_unfolding():
    with pytest.raises(InvalidConfigError, match="min_step"):
        Annealing(patience=1, factor=0.5, min_step=np.inf)
    with pytest.raises(InvalidConfigError, match="exponent"):
        Unfolding(sphericity=0.9, exponent=np.inf, rounds=1)


def test_absolute_steps_follow_the_scale():
    mesh = sample("stone", 200)
    config = FlowConfig(iterations=5, step=0.01, step_unit="absolute")
    one = run(mesh, config)[-1]
    big = run(mesh.with_vertices(1e4 * mesh.vertices), replace(config, step=100.0))[-1]
    np.testing.assert_allclose(big.vertices / 1e4, one.vertices, atol=1e-12)
    assert big.step == pytest.approx(100)
    assert big.metrics().step == pytest.approx(100)


def test_metrics_are_in_the_unit_of_the_mesh():
    mesh = sample("stone", 200)
    powers = {"area": 2, "volume": 3, "curvature_min": -1, "curvature_max": -1, "step": 1}
    one = next(iter(flow(mesh, ROBUST))).metrics().as_dict()
    far = mesh.with_vertices(1000 * mesh.vertices + 70)
    big = next(iter(flow(far, ROBUST))).metrics().as_dict()
    assert big == pytest.approx({name: value * 1000.0 ** powers.get(name, 0) for name, value in one.items()})
    edges = next(iter(flow(far, replace(ROBUST, measure="length")))).metrics()
    assert edges.curvature_max == pytest.approx(
        1000 * next(iter(flow(mesh, replace(ROBUST, measure="length")))).metrics().curvature_max
    )


@pytest.mark.parametrize("rescale", ["area", "volume"])
def test_rescaling_restores_what_it_names_about_the_centroid(rescale):
    mesh = sample("non-convex-sphere", 252)
    first, *_, last = run(mesh, replace(ROBUST, rescale=rescale, iterations=10))
    for name in ("area", "volume"):
        kept = getattr(last.metrics(), name) == pytest.approx(getattr(first.metrics(), name), rel=1e-12)
        assert kept == (name == rescale)


def test_the_same_bits_twice():
    mesh = sample("stone", 400)
    one, two = (run(mesh, replace(ROBUST, iterations=25)) for _ in range(2))
    for a, b in zip(one, two, strict=True):
        assert a.vertices.tobytes() == b.vertices.tobytes()
        assert a.metrics() == b.metrics()


def test_states_stay_what_they_were():
    """A state that is held while the run goes on does not change under its holder."""
    states, copies = [], []
    for state in flow(sample("stone", 200), replace(ROBUST, iterations=12)):
        states.append(state)
        copies.append((state.vertices.copy(), state.checkpoint()["position"].copy()))
    for state, (vertices, position) in zip(states, copies, strict=True):
        assert (state.vertices == vertices).all()
        assert (state.checkpoint()["position"] == position).all()
