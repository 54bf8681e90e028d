"""Edges, boundaries, components, genus and pinch vertices, on sound meshes and on broken ones."""

from __future__ import annotations

import numpy as np
import pytest

from spherify.geometry.samples.solids import icosphere
from spherify.geometry.topology import Topology, connected_labels
from tests.geometry.shapes import octahedron, open_bump, pinched, torus


def of(mesh):
    return Topology.of(len(mesh.vertices), mesh.faces)


def double_torus_faces():
    """Two tori joined along the rim of one removed triangle each."""
    mesh = torus()
    n, faces = len(mesh.vertices), mesh.faces
    second = faces + n
    a, b = faces[0], second[0]
    merged = np.concatenate([faces[1:], second[1:]])
    for one, other in zip(b, a[[0, 2, 1]], strict=True):
        merged[merged == one] = other
    return merged


def test_a_closed_surface():
    topology = of(octahedron())
    assert topology.closed
    assert len(topology.edges) == 12
    assert (topology.face_count == 2).all()
    assert topology.interior.all()
    assert topology.euler == 2
    assert topology.genus == 0
    assert topology.n_components == 1
    assert topology.boundary_loops == 0
    for defects in (
        topology.boundary_edges,
        topology.nonmanifold_edges,
        topology.misoriented_edges,
        topology.boundary_vertices,
        topology.unreferenced_vertices,
        topology.nonmanifold_vertices,
    ):
        assert len(defects) == 0


def test_each_edge_knows_the_face_that_runs_along_it_and_the_one_against_it():
    mesh = icosphere(3)
    topology = of(mesh)
    for (a, b), faces in zip(topology.edges, topology.edge_faces, strict=True):
        for (tail, head), face in zip(((a, b), (b, a)), faces, strict=True):
            f = list(mesh.faces[face])
            assert f[(f.index(tail) + 1) % 3] == head
    halves = topology.edges[topology.halfedge_edges].reshape(-1, 3, 2)
    assert (np.sort(np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=-1)) == halves).all()


@pytest.mark.parametrize("n", [12, 2_000_000])
def test_half_edges_edge_by_edge_however_many_vertices(n):
    """Key and place of a half-edge fit into one number, and from about a million vertices on they do not."""
    # Edges of any number of faces, and loops.
    faces = np.random.default_rng(4).integers(0, 12, (40, 3)) + n - 12
    topology = Topology.of(n, faces)
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2))
    edges, of_halfedge, count = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    assert np.array_equal(topology.edges, edges)
    assert np.array_equal(topology.face_count, count)
    assert np.array_equal(topology.halfedge_edges, of_halfedge)
    assert np.array_equal(topology.halfedges, np.argsort(of_halfedge, kind="stable"))
    one_each_way = (topology.edge_faces >= 0).all(axis=1) & (count == 2)
    assert np.array_equal(topology.interior, one_each_way)
    assert 0 < one_each_way.sum() < len(edges)


@pytest.mark.parametrize(("faces", "genus"), [(torus().faces, 1), (double_torus_faces(), 2)])
def test_handles_are_counted(faces, genus):
    topology = Topology.of(int(faces.max()) + 1, faces)
    assert topology.closed
    assert topology.genus == genus
    assert topology.euler == 2 - 2 * genus


def test_a_pinch_vertex_is_found_though_every_edge_is_sound():
    topology = of(pinched())
    assert topology.closed
    assert topology.euler == 3
    assert topology.n_components == 1
    assert topology.genus == 0
    (pinch,) = topology.nonmanifold_vertices
    assert np.bincount(topology.faces.reshape(-1))[pinch] == 10


def test_an_open_sheet():
    topology = of(open_bump(7))
    assert not topology.closed
    assert topology.boundary_loops == 1
    assert len(topology.boundary_edges) == 24
    assert len(topology.boundary_vertices) == 24
    assert topology.genus == 0
    assert len(topology.nonmanifold_vertices) == 0


def test_two_holes_are_two_loops_even_if_they_touch():
    mesh = icosphere(4)
    at = int(mesh.faces[0, 0])
    around = np.flatnonzero((mesh.faces == at).any(axis=1))
    apart = np.flatnonzero(~(np.isin(mesh.faces, mesh.faces[around[0]])).any(axis=1))
    holes = Topology.of(len(mesh.vertices), np.delete(mesh.faces, [around[0], apart[0]], axis=0))
    assert holes.boundary_loops == 2
    assert holes.genus == 0
    opposite = next(f for f in around if len(np.intersect1d(mesh.faces[f], mesh.faces[around[0]])) == 1)
    touching = Topology.of(len(mesh.vertices), np.delete(mesh.faces, [around[0], opposite], axis=0))
    assert list(touching.nonmanifold_vertices) == [at]
    assert len(touching.boundary_edges) == 6


def test_a_third_face_at_an_edge():
    mesh = octahedron()
    faces = np.concatenate([mesh.faces, [[0, 2, 6]]])
    topology = Topology.of(7, faces)
    assert [tuple(topology.edges[e]) for e in topology.nonmanifold_edges] == [(0, 2)]
    assert len(topology.boundary_edges) == 2
    assert not topology.closed


def test_a_face_wound_the_wrong_way():
    mesh = octahedron()
    faces = mesh.faces.copy()
    faces[3] = faces[3, ::-1]
    topology = Topology.of(6, faces)
    assert {tuple(topology.edges[e]) for e in topology.misoriented_edges} == {(0, 3), (0, 4), (3, 4)}
    assert len(topology.nonmanifold_vertices) == 0


def test_components_and_vertices_in_no_face():
    mesh = octahedron()
    topology = Topology.of(15, np.concatenate([mesh.faces + 7, mesh.faces]))
    assert topology.n_components == 2
    assert list(topology.unreferenced_vertices) == [6, 13, 14]
    assert topology.euler == 4
    assert topology.genus == 0
    assert len(set(topology.face_components[:8])) == 1
    assert set(topology.face_components) == {0, 1}


def test_no_faces_at_all():
    topology = Topology.of(3, np.zeros((0, 3), dtype=np.int64))
    assert not topology.closed
    assert topology.n_components == 0
    assert topology.boundary_loops == 0
    assert len(topology.nonmanifold_vertices) == 0


def test_labels_of_a_long_chain():
    n = 5000
    order = np.random.default_rng(1).permutation(n)
    chain = np.stack([order[:-1], order[1:]], axis=1)
    assert (connected_labels(n, chain) == 0).all()
    cut = np.delete(chain, n // 2, axis=0)
    assert len(np.unique(connected_labels(n, cut))) == 2
