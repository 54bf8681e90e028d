"""The last of a run that is not round enough: what it promises, alone and in a run."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from spherify.geometry import measures
from spherify.geometry.finish import (
    FEWEST,
    LOWER,
    STEPS,
    STIFFENED,
    WORK,
    _Metric,
    energies,
    finished,
    steps_of,
)
from spherify.geometry.flow import FlowState, StopReason, flow
from spherify.geometry.kernels import ENGINES, get_engine
from spherify.geometry.methods import control
from spherify.geometry.methods.control import SHORT, Control, Phase
from spherify.geometry.presets import PRESETS
from spherify.geometry.quality import inward_faces
from spherify.geometry.roundness import sphericity
from spherify.geometry.samples.solids import icosphere
from spherify.geometry.topology import Topology
from tests.geometry.shapes import drum, jittered, uneven_sphere
from tests.geometry.test_covering import wound

ROBUST = PRESETS["robust"].config
CENTRE = np.array([0.01, -0.02, 0.005])
COIL = (0.3, 14, 40)  # 548 vertices, whose best placing that a run found before was of Ψ 0.9948


def roundness(V, mesh):
    return sphericity(
        float(measures.face_areas(V, mesh.faces).sum()), measures.volume(V, mesh.faces, np.zeros(3))
    )


def kernel(mesh, engine):
    return get_engine(engine).prepare(Topology.of(len(mesh.vertices), mesh.faces), ROBUST)


@cache
def run() -> list[FlowState]:
    return list(flow(wound(*COIL), ROBUST, engine="compiled"))


def phase(state):
    return Control(*state.checkpoint()["control"]).phase


@pytest.mark.parametrize("engine", ENGINES)
def test_the_gradient_is_that_of_the_energy(engine):
    mesh = jittered(icosphere(3), 0.05)
    energy = kernel(mesh, engine).energies(mesh.faces, LOWER)
    along = np.random.default_rng(1).normal(size=mesh.vertices.shape)
    step = 1e-6
    ahead, behind = (energy(mesh.vertices + sign * step * along).value for sign in (1, -1))
    slope = float((energy(mesh.vertices).gradient * along).sum())
    assert (ahead - behind) / (2 * step) == pytest.approx(slope, rel=1e-6)


@pytest.mark.parametrize("engine", ENGINES)
def test_the_energy_is_the_sphericity_and_the_barrier(engine):
    mesh = jittered(icosphere(3), 0.05)
    volumes = np.linalg.det(measures.normalised(mesh.vertices)[mesh.faces])
    barrier = 4 * np.pi / len(mesh.faces) ** 2 * np.log(volumes).sum()
    expected = np.log((36 * np.pi) ** (1 / 3)) - np.log(roundness(mesh.vertices, mesh)) - 0.2 * barrier
    assert kernel(mesh, engine).energies(mesh.faces, 0.2)(mesh.vertices).value == pytest.approx(expected)


def test_engines_agree():
    for mesh in (jittered(icosphere(3), 0.05), uneven_sphere(12), drum(300, 3)):
        one, other = (kernel(mesh, engine).energies(mesh.faces, LOWER)(mesh.vertices) for engine in ENGINES)
        assert one.value == pytest.approx(other.value, rel=1e-12)
        assert abs(one.gradient - other.gradient).max() <= 1e-12 * abs(one.gradient).max()
        moved = [
            finished(mesh.vertices, mesh.faces, CENTRE, steps=2, by=kernel(mesh, engine).energies)
            for engine in ENGINES
        ]
        assert abs(moved[0] - moved[1]).max() <= 1e-11


@pytest.mark.parametrize("engine", ENGINES)
def test_volumes_of_which_no_product_is_a_number_have_a_logarithm(engine):
    """As of 30,000 triangles, the product of whose volumes is less than any number."""
    mesh = icosphere(40)
    energy = kernel(mesh, engine).energies(mesh.faces, 1.0)(mesh.vertices).value
    logarithm = np.log(np.linalg.det(measures.normalised(mesh.vertices)[mesh.faces])).mean()
    round_ = np.log((36 * np.pi) ** (1 / 3)) - np.log(roundness(mesh.vertices, mesh))
    assert energy == pytest.approx(round_ - 4 * np.pi / len(mesh.faces) * logarithm, rel=1e-9)


@pytest.mark.parametrize("engine", ENGINES)
def test_there_is_no_energy_beyond_the_barrier(engine):
    mesh = drum(12, 3)
    energy = kernel(mesh, engine).energies(mesh.faces, LOWER)
    assert energy(mesh.vertices) is not None
    assert energy(mesh.vertices - [5, 0, 0]) is None
    assert energy(np.full_like(mesh.vertices, np.nan)) is None


def test_steps_begin_with_the_laplacian_of_what_bounds_the_energy():
    """Solved by the matrix put together triangle by triangle; and the bound, the volume apart, for small moves."""
    mesh, barrier = uneven_sphere(3), 0.3
    P, n, m = mesh.vertices, len(mesh.vertices), len(mesh.faces)
    metric = _Metric(n, mesh.faces, barrier)
    assert metric.refreshed(P)
    share = barrier * 4 * np.pi / m**2
    areas = measures.face_areas(P, mesh.faces)
    L = np.zeros((n, n))
    for face, area in zip(mesh.faces, areas, strict=True):
        for k in range(3):
            p, q, r = face[k], face[(k + 1) % 3], face[(k + 2) % 3]
            cotangent = np.dot(P[q] - P[p], P[r] - P[p]) / (2 * area)
            weight = cotangent / 2 * (1 / areas.sum() + STIFFENED * share / area)
            L[np.ix_([q, r], [q, r])] += weight * np.array([[1, -1], [-1, 1]])
    rng = np.random.default_rng(2)
    moves = rng.normal(size=(n, 3))
    assert L @ metric.solve(moves - moves.mean(axis=0)) == pytest.approx(moves - moves.mean(axis=0), abs=1e-4)
    energy = energies(mesh.faces, barrier)
    for _ in range(20):
        move = rng.normal(size=(n, 3)) * 1e-4
        move -= measures.dot(move, P)[:, None] * P  # along the sphere, where the volume stays to first order
        at, there = energy(P), energy(P + move)
        bent = there.value - at.value - float((at.gradient * move).sum())
        assert 0 < bent <= 0.5 * float((move * (L @ move)).sum())


def test_a_spot_of_tiny_triangles_grows_at_once():
    """What took thousands of steps by the diagonal: all of a limb's triangles in a ten-thousandth of the sphere."""
    mesh = uneven_sphere(12)
    U = measures.normalised(mesh.vertices)
    spot = U[:, 2] > 0.3
    U[spot, :2] *= 0.01
    V = np.asfortranarray(measures.normalised(U))
    begun = measures.face_areas(V, mesh.faces)
    assert begun.min() < 1e-4 * begun.mean()
    assert inward_faces(V, mesh.faces, CENTRE) == 0
    moved = finished(V, mesh.faces, CENTRE)
    assert roundness(moved, mesh) > 0.9985 > roundness(V, mesh) + 0.01
    areas = measures.face_areas(moved, mesh.faces)
    assert areas.min() > 0.05 * areas.mean()


def test_more_vertices_than_factors_have_room_for_stay(monkeypatch):
    mesh = uneven_sphere(6)
    monkeypatch.setattr("spherify.geometry.finish.MOST", len(mesh.vertices) - 1)
    assert finished(mesh.vertices, mesh.faces, CENTRE) is mesh.vertices


def test_it_gets_rounder_and_no_face_is_turned():
    mesh = uneven_sphere(6)
    V = np.asfortranarray(3 * mesh.vertices + CENTRE)
    moved = finished(V, mesh.faces, CENTRE)
    assert roundness(moved, mesh) > roundness(V, mesh) + 1e-4
    assert inward_faces(moved, mesh.faces, CENTRE) == 0
    areas = measures.face_areas(moved, mesh.faces)
    assert areas.min() > 1e-3 * areas.mean()


def test_an_iteration_is_no_longer_on_more_vertices(monkeypatch):
    assert steps_of(500) == STEPS
    assert [steps_of(n) * n for n in (6_000, 60_000)] == [WORK, WORK]
    assert steps_of(10**7) == FEWEST
    mesh = uneven_sphere(6)
    V = np.asfortranarray(mesh.vertices)
    monkeypatch.setattr("spherify.geometry.finish.WORK", 20 * len(V))
    some = finished(V, mesh.faces, CENTRE)
    monkeypatch.undo()
    assert roundness(V, mesh) < roundness(some, mesh) < roundness(finished(V, mesh.faces, CENTRE), mesh)


def test_what_does_not_look_outward_stays_as_it_is():
    mesh = drum(12, 3)
    V = np.asfortranarray(mesh.vertices)
    assert finished(V, mesh.faces, np.array([5.0, 0, 0])) is V


def test_a_coarse_coil_becomes_a_true_sphere():
    """T along the radii and the climb of directions alone leave it short."""
    *states, last = run()
    begun = next(i for i, state in enumerate(states) if phase(state) == Phase.FINISH)
    assert states[begun - 1].sphericity < SHORT
    assert {phase(state) for state in states[begun:]} == {Phase.FINISH}
    areas = measures.face_areas(last.vertices, wound(*COIL).faces)
    assert last.stop_reason == StopReason.STALLED
    assert "together" in last.stop_detail
    assert last.sphericity >= 0.9955
    assert last.metrics().inward_faces == 0
    assert areas.min() > 1e-4 * areas.mean()


def test_it_was_needed(monkeypatch):
    monkeypatch.setattr(control, "SHORT", 0.0)
    *_, last = flow(wound(*COIL), ROBUST, engine="compiled")
    assert last.sphericity < SHORT


def test_it_resumes_bit_by_bit():
    whole = run()
    begun = next(i for i, state in enumerate(whole) if phase(state) == Phase.FINISH)
    for start in (begun - 1, begun, begun + 1):
        resumed = flow(wound(*COIL), ROBUST, engine="compiled", resume=whole[start].checkpoint())
        for state, expected in zip(resumed, whole[start + 1 :], strict=True):
            assert state.vertices.tobytes() == expected.vertices.tobytes()
