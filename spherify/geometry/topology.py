"""Who touches whom: edges with their faces, boundaries, components, Euler's number; built once a mesh.

Works on any triangles, broken ones too, so that a reader can say exactly what is wrong with them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from spherify.geometry.mesh import Ints

Bools = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Topology:
    """Connectivity of triangles.

    Half-edge ``h = 3·f + k`` runs from corner k of face f to the next corner of that face.

    Attributes:
        n_vertices: number of vertices, those in no face included.
        faces: (m, 3) vertex indices.
        edges: (e, 2) vertex indices, the smaller first, in ascending order.
        face_count: (e,) number of faces at each edge.
        edge_faces: (e, 2) the first face that runs along the edge from its smaller to its larger vertex, and the
            first that runs the other way; -1 where there is none.
        halfedge_edges: (3m,) the edge each half-edge lies on.

    """

    n_vertices: int
    faces: Ints
    edges: Ints
    face_count: Ints
    edge_faces: Ints
    halfedge_edges: Ints

    @classmethod
    def of(cls, n_vertices: int, faces: Ints) -> Topology:
        """Build the topology of ``faces`` (m, 3), whose indices lie in 0 … n_vertices - 1."""
        keys, sides = _edge_keys(n_vertices, faces)
        # As numpy's `unique` does, but stable: keys of neighbours ascend together, which that sort makes use of.
        order = np.argsort(keys, kind="stable")
        keys = keys[order]
        new = np.concatenate([[True], keys[1:] != keys[:-1]])[: len(keys)]
        halfedge_edges = np.empty_like(order)
        halfedge_edges[order] = np.cumsum(new) - 1
        del order
        face_count = np.diff(np.flatnonzero(new), append=len(keys))
        keys = keys[new]
        # Column by column in memory: the measures gather one corner of all faces, one end of all edges at a time.
        edges, edge_faces = np.empty((2, len(keys)), dtype=np.int64), np.full((2, len(keys)), -1)
        np.floor_divide(keys, max(n_vertices, 1), out=edges[0])
        np.subtract(keys, n_vertices * edges[0], out=edges[1])
        del keys, new
        for side, runs in enumerate(sides):
            halfedges = np.flatnonzero(runs)[::-1]  # backwards, so that the first face is the one that stays
            edge_faces[side, halfedge_edges[halfedges]] = halfedges // 3
        return cls(n_vertices, np.asfortranarray(faces), edges.T, face_count, edge_faces.T, halfedge_edges)

    @cached_property
    def interior(self) -> Bools:
        """(e,) edges with exactly two faces that run along them in opposite directions."""
        interior: Bools = (self.face_count == 2) & (self.edge_faces[:, 0] >= 0) & (self.edge_faces[:, 1] >= 0)
        return interior

    @cached_property
    def interior_edges(self) -> Ints:
        """(i, 2) vertices of the `interior` edges, in ascending order."""
        return np.asfortranarray(self.edges[self.interior])

    @cached_property
    def interior_edge_faces(self) -> Ints:
        """(i, 2) the faces of the `interior` edges: the one that runs along the edge, and the one against it."""
        return np.asfortranarray(self.edge_faces[self.interior])

    @cached_property
    def interior_degrees(self) -> Ints:
        """(n,) number of `interior` edges at each vertex."""
        return np.bincount(self.interior_edges.reshape(-1), minlength=self.n_vertices)

    @cached_property
    def boundary_edges(self) -> Ints:
        """Indices of the edges with one face only."""
        return np.flatnonzero(self.face_count == 1)

    @cached_property
    def nonmanifold_edges(self) -> Ints:
        """Indices of the edges with more than two faces."""
        return np.flatnonzero(self.face_count > 2)

    @cached_property
    def misoriented_edges(self) -> Ints:
        """Indices of the edges whose two faces run along them in the same direction."""
        return np.flatnonzero((self.face_count == 2) & ~self.interior)

    @cached_property
    def boundary_vertices(self) -> Ints:
        """Indices of the vertices on an edge with one face only, ascending."""
        return np.unique(self.edges[self.boundary_edges])

    @cached_property
    def unreferenced_vertices(self) -> Ints:
        """Indices of the vertices in no face, ascending."""
        return np.flatnonzero(np.bincount(self.faces.reshape(-1), minlength=self.n_vertices) == 0)

    @property
    def closed(self) -> bool:
        """Whether every edge has exactly two faces, and there is at least one."""
        return len(self.faces) > 0 and bool((self.face_count == 2).all())

    @cached_property
    def face_components(self) -> Ints:
        """(m,) number of the component of each face, 0 the one of face 0; faces that share a vertex belong together."""
        labels = connected_labels(self.n_vertices, self.edges)
        return _renumbered(labels[self.faces[:, 0]])

    @cached_property
    def n_components(self) -> int:
        """Number of components, counted over faces: two bodies that share one vertex are one."""
        return int(self.face_components.max(initial=-1)) + 1

    @cached_property
    def fans(self) -> Ints:
        """(3m,) number of the fan of each corner ``3·f + k``.

        The corners at a vertex fall into fans: runs of faces joined by shared edges. At a manifold vertex there is
        exactly one, a full circle or, on the boundary, an arc.
        """
        tails = self.faces.reshape(-1)
        following = np.roll(np.arange(len(tails)).reshape(-1, 3), -1, axis=1).reshape(-1)
        order = np.argsort(self.halfedge_edges, kind="stable")
        one, other = order[:-1], order[1:]
        together = self.halfedge_edges[one] == self.halfedge_edges[other]
        one, other = one[together], other[together]
        opposed = tails[one] != tails[other]
        # A half-edge starts at its own corner and ends at the next one of its face.
        at_start = np.stack([one, np.where(opposed, following[other], other)], axis=1)
        at_end = np.stack([following[one], np.where(opposed, other, following[other])], axis=1)
        return _renumbered(connected_labels(len(tails), np.concatenate([at_start, at_end])))

    @cached_property
    def nonmanifold_vertices(self) -> Ints:
        """Indices of the vertices with more than one fan (pinch vertices), ascending."""
        _, first_corner = np.unique(self.fans, return_index=True)
        per_vertex = np.bincount(self.faces.reshape(-1)[first_corner], minlength=self.n_vertices)
        return np.flatnonzero(per_vertex > 1)

    @cached_property
    def boundary_loops(self) -> int:
        """Number of closed curves the boundary edges form; at a pinch vertex each fan has its own."""
        n_fans = int(self.fans.max(initial=-1)) + 1
        single = np.flatnonzero((self.face_count == 1)[self.halfedge_edges])
        ends = np.where(single % 3 == 2, single - 2, single + 1)
        pairs = np.stack([self.fans[single], self.fans[ends]], axis=1)
        labels = connected_labels(n_fans, pairs)
        return len(np.unique(labels[pairs[:, 0]]))

    @property
    def euler(self) -> int:
        """Euler's number V - E + F, over the vertices that are in a face."""
        return self.n_vertices - len(self.unreferenced_vertices) - len(self.edges) + len(self.faces)

    @cached_property
    def genus(self) -> int:
        """Handles of an oriented surface, summed over its components, holes filled and pinch vertices cut apart.

        2 - 2g - loops = χ for each component. Means nothing unless edges are manifold and consistently oriented.
        """
        n_fans = int(self.fans.max(initial=-1)) + 1
        following = np.where(np.arange(len(self.fans)) % 3 == 2, -2, 1) + np.arange(len(self.fans))
        labels = connected_labels(n_fans, np.stack([self.fans, self.fans[following]], axis=1))
        components = len(np.unique(labels))
        euler = n_fans - len(self.edges) + len(self.faces)
        return (2 * components - self.boundary_loops - euler) // 2


def _edge_keys(n: int, faces: Ints) -> tuple[Ints, tuple[Bools, Bools]]:
    """(3m,) low·n + high of the vertices of each half-edge, and which run from low to high, which from high to low."""
    tails, heads = faces.reshape(-1), faces.take([1, 2, 0], axis=1).reshape(-1)
    keys = np.minimum(tails, heads)
    keys *= n
    keys += np.maximum(tails, heads)
    return keys, (tails < heads, tails > heads)


def connected_labels(n: int, pairs: Ints) -> Ints:
    """Label each of n nodes by the smallest node it is connected to through ``pairs`` (k, 2)."""
    labels = np.arange(n)
    while True:
        one, other = labels[pairs[:, 0]], labels[pairs[:, 1]]
        low, high = np.minimum(one, other), np.maximum(one, other)
        if (low == high).all():
            return labels
        np.minimum.at(labels, high, low)
        while not np.array_equal(labels, shorter := labels[labels]):
            labels = shorter


def _renumbered(labels: Ints) -> Ints:
    """Renumber labels as 0, 1, 2, … in the order of their value."""
    return np.unique(labels, return_inverse=True)[1].astype(np.int64)
