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
        halfedges: (3m,) the half-edges edge by edge, those of one edge in ascending order.
        interior: (e,) edges with exactly two faces that run along them in opposite directions.

    """

    n_vertices: int
    faces: Ints
    edges: Ints
    face_count: Ints
    halfedges: Ints
    interior: Bools

    @classmethod
    def of(cls, n_vertices: int, faces: Ints) -> Topology:
        """Build the topology of ``faces`` (m, 3), whose indices lie in 0 … n_vertices - 1."""
        # Column by column in memory: the measures gather one corner of all faces, one end of all edges at a time.
        columns = np.asfortranarray(faces)
        # Arrays in the place of others where that can be: for new memory the system works longer than numpy does.
        tails, heads = _ends(faces)
        ascends = tails < heads
        keys = np.minimum(tails, heads)
        keys *= n_vertices
        keys += np.maximum(tails, heads, out=heads)
        del heads
        keys, halfedges = _sorted(keys, n_vertices)
        new = np.ones(len(keys) + 1, dtype=np.bool_)
        np.not_equal(keys[1:], keys[:-1], out=new[1:-1])
        first = np.flatnonzero(new)  # and where the last ends
        face_count = first[1:] - first[:-1]
        first = first[:-1]
        keys = keys[first]
        edges = np.empty((2, len(keys)), dtype=np.int64)
        np.floor_divide(keys, max(n_vertices, 1), out=edges[0])
        np.multiply(edges[0], n_vertices, out=edges[1])
        np.subtract(keys, edges[1], out=edges[1])
        # Of two half-edges one runs from its smaller to its larger vertex; of two from a vertex to itself none does.
        ascends = ascends.take(halfedges)
        interior = ascends.take(first) != ascends[1:].take(first, mode="clip")
        interior &= face_count == 2
        return cls(n_vertices, columns, edges.T, face_count, halfedges, interior)

    @cached_property
    def halfedge_edges(self) -> Ints:
        """(3m,) the edge each half-edge lies on."""
        edges = np.empty_like(self.halfedges)
        edges[self.halfedges] = np.repeat(np.arange(len(self.edges)), self.face_count)
        return edges

    @cached_property
    def edge_faces(self) -> Ints:
        """(e, 2) first face that runs along the edge from its smaller to its larger vertex, and first the other way.

        -1 where there is none.
        """
        edge_faces = np.full((2, len(self.edges)), -1)
        tails, heads = _ends(self.faces)
        for side, runs in enumerate((tails < heads, tails > heads)):
            halfedges = np.flatnonzero(runs)[::-1]  # backwards, so that the first face is the one that stays
            edge_faces[side, self.halfedge_edges[halfedges]] = halfedges // 3
        return edge_faces.T

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
        # Column by column, as they lie in memory: one after another they would be copied first.
        return np.flatnonzero(np.bincount(self.faces.T.reshape(-1), minlength=self.n_vertices) == 0)

    @cached_property
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
        edge = np.repeat(np.arange(len(self.edges)), self.face_count)
        together = edge[:-1] == edge[1:]
        one, other = self.halfedges[:-1][together], self.halfedges[1:][together]
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


def _ends(faces: Ints) -> tuple[Ints, Ints]:
    """(3m,) the vertices that each half-edge runs from and to."""
    return faces.reshape(-1), faces.take([1, 2, 0], axis=1).reshape(-1)


def _sorted(keys: Ints, n: int) -> tuple[Ints, Ints]:
    """Sort keys in 0 … n² - 1, (k,), which are used up: in ascending order, and where each was, the first first.

    Keys of neighbours ascend together, which numpy's stable sort makes use of. It is done the sooner the less it
    moves: key and place as one number, where they fit into 63 bits, as they do up to a million vertices.
    """
    bits = len(keys).bit_length()
    if n * n << bits >= 1 << 63:
        order = np.argsort(keys, kind="stable")
        return keys[order], order
    keys <<= bits
    places = np.arange(len(keys))
    keys |= places
    keys.sort(kind="stable")
    np.bitwise_and(keys, (1 << bits) - 1, out=places)
    keys >>= bits
    return keys, places


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
