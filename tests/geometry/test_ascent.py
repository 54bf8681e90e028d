"""The climb to the greatest sphericity: the gradient by an oracle, what it must leave alone, and what it brings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spherify.geometry import measures
from spherify.geometry.ascent import BARRIER, KEPT
from spherify.geometry.flow import flow
from spherify.geometry.kernels import ENGINES, get_engine
from spherify.geometry.kernels.passes.types import RING
from spherify.geometry.methods.control import Control, Phase
from spherify.geometry.presets import PRESETS
from spherify.geometry.quality import inward_faces
from spherify.geometry.roundness import shape_of
from spherify.geometry.samples.solids import icosphere
from spherify.geometry.topology import Topology
from spherify.geometry.unfolding import folds
from tests.geometry.shapes import ROUNDING, drum

ROBUST = PRESETS["robust"].config
CENTRE = np.array([0.01, -0.02, 0.005])


def kernel(mesh, engine):
    return get_engine(engine).prepare(Topology.of(len(mesh.vertices), mesh.faces), ROBUST)


def uneven(n=5, by=0.3):
    """A sphere about CENTRE with vertices shifted along it, all faces outward, and with uneven radii."""
    mesh, random = icosphere(n), np.random.default_rng(5)
    edge = measures.norm(mesh.vertices[mesh.faces[0, 0]] - mesh.vertices[mesh.faces[0, 1]][None])[0]
    U = measures.normalised(mesh.vertices + by * edge * random.uniform(-1, 1, mesh.vertices.shape))
    radii = 1 + 0.01 * random.uniform(-1, 1, (len(U), 1))
    return mesh.with_vertices(np.asfortranarray(CENTRE + radii * U))


def energy(V, mesh):
    """log A - 2/3 log V and the barrier, with no formula of the module."""
    U = measures.normalised(V - CENTRE)
    shape = shape_of(V, Topology.of(len(V), mesh.faces))
    barrier = BARRIER * 4 * np.pi / len(mesh.faces) ** 2
    return (
        np.log(shape.area)
        - 2 / 3 * np.log(shape.volume)
        - barrier * np.log(np.linalg.det(U[mesh.faces])).sum()
    )


@pytest.mark.parametrize("engine", ENGINES)
def test_every_direction_goes_down_the_slope(engine):
    """Its tangential gradient, by differences: each move is a negative multiple of it."""
    mesh = uneven()
    V = mesh.vertices
    moves = measures.normalised(kernel(mesh, engine).ascend(V, V, CENTRE, 0.0) - CENTRE)
    moves -= measures.normalised(V - CENTRE)
    for p in range(0, len(V), 17):
        spoke = V[p] - CENTRE
        one = np.cross(spoke, [0.3, -0.5, 0.8])
        one /= np.linalg.norm(one)
        two = np.cross(spoke / np.linalg.norm(spoke), one)
        slopes = []
        for tangent in (one, two):
            ends = []
            for by in (1e-5, -1e-5):
                turned = spoke + by * tangent
                moved = V.copy()
                moved[p] = CENTRE + turned / np.linalg.norm(turned) * np.linalg.norm(spoke)
                ends.append(energy(moved, mesh))
            slopes.append(ends[0] - ends[1])
        gradient, move = np.array(slopes), np.array([moves[p] @ one, moves[p] @ two])
        assert move @ gradient < 0
        across = move[0] * gradient[1] - move[1] * gradient[0]
        assert abs(across) < 1e-3 * np.linalg.norm(move) * np.linalg.norm(gradient)


@pytest.mark.parametrize("momentum", [0.0, 0.9, 30.0])
def test_both_engines_agree(momentum):
    """With and without a momentum that halves moves."""
    mesh = uneven()
    V = mesh.vertices
    previous = np.asfortranarray(V + 0.003 * np.random.default_rng(2).normal(size=V.shape))
    one, other = (kernel(mesh, engine).ascend(V, previous, CENTRE, momentum) for engine in ENGINES)
    assert np.abs(one - V).max() > 1e-3
    assert np.abs(one - other).max() < 10 * ROUNDING


def test_vertices_are_computed_alike_by_their_rings_and_face_by_face():
    """The latter is for vertices at which the surface touches itself, which have no ring."""
    mesh = uneven()
    by_rings, by_faces = kernel(mesh, "compiled"), kernel(mesh, "compiled")
    connectivity = by_faces._sphere._mesh
    runs = connectivity.runs.copy()
    assert (runs[:, 2] == RING).all()
    runs[:, 2] = 0
    by_faces._sphere._mesh = connectivity._replace(runs=runs)
    one, other = (k.ascend(mesh.vertices, mesh.vertices, CENTRE, 0.0) for k in (by_rings, by_faces))
    assert np.abs(one - mesh.vertices).max() > 1e-3
    assert 0 < np.abs(one - other).max() < ROUNDING


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("momentum", [0.0, 1.0, 100.0, 1e6])
def test_no_face_turns_or_vanishes_and_radii_stay(engine, momentum):
    """However long the moves would be."""
    mesh = uneven()
    V = mesh.vertices
    assert inward_faces(V, mesh.faces, CENTRE) == 0
    previous = np.asfortranarray(V + 0.01 * np.random.default_rng(3).normal(size=V.shape))
    moved = kernel(mesh, engine).ascend(V, previous, CENTRE, momentum)
    before, after = (np.linalg.det(measures.normalised(X - CENTRE)[mesh.faces]) for X in (V, moved))
    assert (after > (KEPT - ROUNDING) * before).all()
    assert inward_faces(moved, mesh.faces, CENTRE) == 0
    np.testing.assert_allclose(measures.norm(moved - CENTRE), measures.norm(V - CENTRE), rtol=1e-12)


@pytest.mark.parametrize("engine", ENGINES)
def test_sphericity_rises_and_triangles_keep_apart(engine):
    mesh = uneven(by=0.35)
    climbing, V = kernel(mesh, engine), mesh.vertices
    radius = measures.norm(V - CENTRE).mean()
    V = np.asfortranarray(CENTRE + radius * measures.normalised(V - CENTRE))
    before, least = climbing.shape(V).sphericity, folds(measures.normalised(V - CENTRE), mesh.faces)[1]
    previous = V
    for _ in range(60):
        previous, V = V, climbing.ascend(V, previous, CENTRE, 0.8)
    assert climbing.shape(V).sphericity > before + 1e-3
    assert folds(measures.normalised(V - CENTRE), mesh.faces)[1] > max(2 * least, 0.3)


def test_fans_become_true_spheres():
    """Their long triangles cut off more of the ball than even ones: T makes radii equal, and leaves it at that."""
    mesh = drum(80, 8)
    *states, last = flow(mesh, ROBUST, engine="compiled")
    assert {Control(*s.checkpoint()["control"]).phase for s in states[::10]} > {Phase.NORMALS, Phase.STAR}
    star = next(s for s in states if Control(*s.checkpoint()["control"]).phase == Phase.STAR)
    assert star.sphericity < 0.995 < last.sphericity
    areas = measures.face_areas(last.vertices, mesh.faces)
    assert last.metrics().inward_faces == 0
    assert areas.min() > 1e-3 * areas.mean()


def test_a_run_of_the_reference_engine_climbs_as_well():
    mesh = drum(24, 4)
    config = replace(ROBUST, iterations=160)
    ends = [list(flow(mesh, config, engine=engine))[-1] for engine in ENGINES]
    assert all(Control(*end.checkpoint()["control"]).phase == Phase.STAR for end in ends)
    assert ends[0].sphericity == pytest.approx(ends[1].sphericity, abs=1e-3)
