"""Triangulations made smaller and grown again: the same by either engine, all undone, and with room for all."""

from __future__ import annotations

import numpy as np
import pytest

from spherify.geometry import measures
from spherify.geometry.kernels.passes.linking import OUT
from spherify.geometry.kernels.passes.narrow import find
from spherify.geometry.kernels.thinning import CompiledThinning
from spherify.geometry.plain_thinning import PlainThinning
from spherify.geometry.samples.solids import icosphere
from spherify.geometry.thinning import (
    COUNTED,
    TETRAHEDRON,
    pull_of,
)
from tests.geometry.shapes import octahedron, sample, tetrahedron
from tests.geometry.test_reinsertion import MESHES as WITHOUT_LIMBS

MESHES = {**WITHOUT_LIMBS, "limbs": sample("quadruped", 600)}
EITHER = pytest.mark.parametrize("way", [PlainThinning, CompiledThinning])
ANY = pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES.keys())


def tangle(mesh, seed=0):
    """Directions of which many triangles look inward."""
    return measures.normalised(np.random.default_rng(seed).normal(size=mesh.vertices.shape))


@pytest.mark.parametrize("outward_first", [False, True])
@pytest.mark.parametrize("seed", range(2))
@ANY
def test_either_takes_out_the_same_in_the_same_order(mesh, seed, outward_first):
    U = tangle(mesh, seed)
    plain, compiled = PlainThinning(U, mesh.faces), CompiledThinning(U, mesh.faces)
    if outward_first:
        assert plain.until_outward() == compiled.until_outward()
        assert taken_out(compiled) == taken_out(plain)
    plain.until_four()
    compiled.until_four()
    assert taken_out(compiled) == taken_out(plain)
    assert len(compiled._ends) == len(plain.levels)
    assert triangles(compiled) == triangles(plain)


def taken_out(thinning):
    """Return who was, in order."""
    if isinstance(thinning, PlainThinning):
        return [merge.vertex for level in thinning.levels for merge in level]
    t = thinning._t
    return t.heads[t.twins[t.merged[: t.counts[OUT]]]].tolist()


@EITHER
def test_only_what_looks_inward_is_taken_out(way):
    ball = icosphere(6)
    U = ball.vertices.copy()
    U[7] = -U[7]
    thinning = way(U, ball.faces)
    assert thinning.until_outward()
    assert taken_out(thinning) == [7]
    assert 7 not in thinning.left
    untouched = way(ball.vertices, ball.faces)
    assert untouched.until_outward()
    assert not untouched.out


@EITHER
@ANY
def test_what_is_left_then_looks_outward(mesh, way):
    U = tangle(mesh)
    thinning = way(U, mesh.faces)
    if thinning.until_outward():
        assert (volumes(U[thinning.left], thinning.faces()) > 0).all()
    else:
        assert len(thinning.left) == 4


def triangles(thinning):
    """Return the triangles that are left by the numbers of the mesh, each from its least corner on."""
    left = thinning.left
    return {tuple(np.roll(f, -int(f.argmin())).tolist()) for f in left[thinning.faces()]}


@EITHER
@ANY
def test_what_is_left_is_a_triangulation_of_a_sphere_and_all_of_the_mesh_in_the_end(mesh, way):
    n = len(mesh.vertices)
    U = np.zeros((n, 3))
    thinning = way(U, mesh.faces)
    thinning.until_four()
    assert len(thinning.left) == 4
    U[thinning.left[outside(thinning)]] = TETRAHEDRON
    while thinning.out:
        assert thinning.put_back(U)
        thinning.relax(U, 3)
        faces = thinning.faces()
        assert len(faces) == 2 * len(thinning.left) - 4
        edges = {(int(f[k]), int(f[(k + 1) % 3])) for f in faces for k in range(3)}
        assert len(edges) == 3 * len(faces), "no edge twice in one direction"
        assert all((b, a) in edges for a, b in edges)
        assert (volumes(U[thinning.left], faces) > 0).all()
    assert triangles(thinning) == {tuple(np.roll(f, -int(f.argmin())).tolist()) for f in mesh.faces}


def outside(thinning):
    a, b, c = thinning.faces()[0].tolist()
    return [6 - a - b - c, a, b, c]


@ANY
def test_either_gives_the_same_directions(mesh):
    found = []
    for way in (PlainThinning, CompiledThinning):
        U = np.zeros(mesh.vertices.shape)
        thinning = way(U, mesh.faces)
        thinning.until_four()
        U[thinning.left[outside(thinning)]] = TETRAHEDRON
        while thinning.out:
            assert thinning.put_back(U)
            thinning.relax(U, 3)
        found.append(U)
    assert found[0] == pytest.approx(found[1], abs=1e-9)


@EITHER
def test_what_merging_costs_where_nothing_is_narrow(way):
    """Of 5 or 6 neighbours with 6 each: the squares of how many more or fewer there are, and 6 for each above three."""
    ball = icosphere(6)
    thinning = way(ball.vertices, ball.faces)
    degrees = np.bincount(ball.faces.reshape(-1))
    cost = costs(thinning)
    assert set(degrees) == {5, 6}
    assert cost[degrees == 5] == pytest.approx(0.1 * (1 + 1 + 1 - 1) + 6 * 2)
    around = np.array([degrees[ball.faces[(ball.faces == p).any(axis=1)]].min() for p in range(len(degrees))])
    assert cost[around == 6] == pytest.approx(0.1 * (4 + 1 + 1) + 6 * 3)


def costs(thinning):
    """Return what merging each vertex costs."""
    if isinstance(thinning, PlainThinning):
        return np.array([thinning._best(p)[0] for p in thinning.left.tolist()])
    find(thinning._t, thinning._U, thinning.left, thinning._least)
    return thinning._t.cost


@pytest.mark.parametrize("name", ["drum", "coil", "string"])
def test_narrow_places_are_the_rings_that_new_edges_close(name):
    mesh = MESHES[name]
    thinning = PlainThinning(tangle(mesh), mesh.faces)
    seen = set()
    for _ in range(6):
        for p in thinning.left.tolist():
            ring = thinning.triangles.ring(p)
            for k in range(len(ring)):
                way = ring[k:] + ring[:k]
                if thinning._possible(way):
                    found = thinning._narrow(way)
                    assert found == narrow(thinning.triangles, p, way)
                    seen.add(found)
        thinning._none_outward()
        thinning._level(inward=False)
    assert {threes for threes, _ in seen} >= {0, 1}
    assert {fours for _, fours in seen} >= {0, 1}


def narrow(before, p, ring):
    """Count rings of three and four in the graph of edges after merging, each once for each new edge it has."""
    after = [set(x) - {p} for x in before.after]
    q, right, left = ring[0], ring[1], ring[-1]
    for r in ring[1:]:
        after[q].add(r)
        after[r].add(q)
    threes = sum(len(after[q] & after[r]) - 2 for r in ring[2:-1])
    own = set(before.after[q]) - {p, right, left}
    fours = 0
    for x in ring[2:-1]:
        for y in after[x] - after[q] - {q}:
            for z in after[y] & own - after[x]:
                fours += not any({x, y, z} <= after[side] for side in (left, right))
    return min(threes, COUNTED), min(fours, COUNTED)


def volumes(U, F):
    """Return six times the volumes between triangles and the centre."""
    return np.linalg.det(U[F])


def energy(U, F, ring_edges):
    """Return what directions fall by, of all of them."""
    pull = pull_of(len(U))
    a, b = ring_edges
    return 0.5 * pull * ((U[a] - U[b]) ** 2).sum() - np.log(volumes(U, F)).sum()


@EITHER
def test_room_is_made_by_the_energy_that_is_written_down_and_nothing_turns(way):
    ball = icosphere(6)
    F = ball.faces
    edges = np.unique(np.sort(np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]]), axis=1), axis=0).T
    U = ball.vertices.copy()
    near = U @ U[100] > np.cos(0.5)
    U[near] = U[100] + 0.03 * (U[near] - U[100])
    U = measures.normalised(U)
    thinning = way(U, F)
    last = energy(U, F, edges)
    for _ in range(30):
        thinning.relax(U, 1)
        assert (volumes(U, F) > 0).all()
        assert measures.norm(U) == pytest.approx(1, abs=1e-15)
        here = energy(U, F, edges)
        assert here < last
        last = here
    found = volumes(U, F)
    assert found.min() > 0.1 * found.mean()


@EITHER
def test_what_is_in_balance_stays(way):
    for mesh in (tetrahedron(), octahedron(), icosphere(1)):
        U = measures.normalised(mesh.vertices - mesh.vertices.mean(axis=0))
        moved = U.copy()
        way(U, mesh.faces).relax(moved, 5)
        assert moved == pytest.approx(U, abs=1e-14)


def test_in_balance_equilateral_triangles_that_share_the_sphere_pull_as_much_as_they_push():
    m = 2 * 1000 - 4

    def of(a):  # of all triangles of that area
        return m * (0.25 * pull_of(1000) * 4 * np.sqrt(3) * a - np.log(2 * a))

    at, off = 4 * np.pi / m, 1e-6
    assert abs(of(at * (1 + off)) - of(at * (1 - off))) < 1e-6 * m * off
