"""The connectivity as the compiled passes read it: renumbered so that what is near on the surface is near in memory."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from spherify.geometry.kernels.passes.fans import walk
from spherify.geometry.kernels.passes.levels import by_levels
from spherify.geometry.kernels.passes.types import NONE, RING, Connectivity
from spherify.geometry.kernels.passes.wide import LANES
from spherify.geometry.mesh import Ints
from spherify.geometry.topology import Topology

WINDOW = 1024  # vertices that are sorted by degree: few enough to stay near, enough for runs of some length
_Indices = NDArray[np.uint32]
Index = TypeVar("Index", np.int64, np.uint32)


class Part(NamedTuple):
    """What one thread works on: vertices ``first`` … ``last``, which are the runs ``first_run`` … ``last_run``."""

    first: np.uint32
    last: np.uint32
    first_run: int
    last_run: int


@dataclass(frozen=True, eq=False, slots=True)
class Numbering:
    """Vertices in the order of the passes.

    Attributes:
        order: (n,) the vertex of the mesh at each place.
        place: (n,) the place of each vertex of the mesh.
        connectivity: in places.

    """

    order: Ints
    place: Ints
    connectivity: Connectivity

    @classmethod
    def of(cls, topology: Topology, held: Ints) -> Numbering:
        """Give vertices places: breadth first, then within windows by how many neighbours they have.

        Faces follow the order of their first vertices. Gathers then stay within the cache at any size.
        """
        n = topology.n_vertices
        twins = _twins(topology)
        rings = _Rings.of(topology, twins)
        order = rings.by_levels()
        window = np.arange(n) // WINDOW
        order = order[np.lexsort((rings.degrees[order], rings.closed[order], window))]
        place = _inverse(order)
        runs, ring = rings.laid_out(order, place, window)
        del rings, window

        faces = place.astype(np.uint32)[topology.faces]
        faces_order = np.argsort(faces.min(axis=1), kind="stable").astype(np.uint32)
        faces = np.ascontiguousarray(faces[faces_order])
        old = np.repeat(np.uint32(3) * faces_order, 3)  # the half-edge at each new place
        old += np.tile(np.arange(3, dtype=np.uint32), len(faces_order))
        twins = twins[old]
        new = _inverse(old)
        has_none, twins = twins == NONE, new[np.minimum(twins, np.uint32(len(new) - 1))]
        twins[has_none] = NONE
        del old, new, faces_order
        tails = faces.reshape(-1)
        connectivity = Connectivity(
            corners=np.ascontiguousarray(faces.T),
            twins=twins,
            first=_starts(np.bincount(tails, minlength=n)),
            halfedges=np.argsort(tails, kind="stable").astype(np.uint32),
            runs=runs,
            ring=ring,
            held=place[held].astype(np.uint32),
        )
        return cls(order, place, connectivity)

    def parts(self, count: int) -> list[Part]:
        """Cut the vertices into parts of nearly the same size, between runs; fewer where there are not as many runs."""
        runs, n = self.connectivity.runs, len(self.order)
        cuts = np.searchsorted(runs[:, 0], np.arange(count) * n // count)
        cuts = np.append(np.unique(cuts[cuts < len(runs)]), len(runs))
        starts = np.append(runs[:, 0], np.uint32(n))
        return [Part(starts[low], starts[high], int(low), int(high)) for low, high in pairwise(cuts)]


@dataclass(frozen=True, eq=False, slots=True)
class _Rings:
    """The neighbours of each vertex of the mesh; 32 bits each, for all of them at once take much memory.

    Attributes:
        degrees: (n,) how many.
        closed: (n,) whether they are in order, counter-clockwise and all around.
        neighbours: vertex by vertex.

    """

    degrees: Ints
    closed: NDArray[np.bool_]
    neighbours: _Indices

    @classmethod
    def of(cls, topology: Topology, twins: _Indices) -> _Rings:
        n = topology.n_vertices
        faces = np.ascontiguousarray(topology.faces, dtype=np.uint32)
        tails, heads = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
        first = _starts(np.bincount(tails, minlength=n))
        halfedges = np.argsort(tails, kind="stable").astype(np.uint32)
        circle = np.empty(len(tails), dtype=np.uint32)
        closed = np.empty(n, dtype=np.bool_)
        walk(heads, twins, first, halfedges, circle, closed)
        del faces, tails, heads, halfedges

        ends = topology.edges.T.reshape(-1).astype(np.uint32)
        degrees = np.bincount(ends, minlength=n)
        by_vertex = np.argsort(ends, kind="stable")
        neighbours = topology.edges[:, ::-1].T.reshape(-1).astype(np.uint32)[by_vertex]
        neighbours[closed[ends[by_vertex]]] = circle[np.repeat(closed, np.diff(first))]
        return cls(degrees, closed, neighbours)

    def by_levels(self) -> Ints:
        """(n,) the vertices breadth first, see `spherify.geometry.kernels.passes.levels`."""
        n = len(self.degrees)
        order = np.empty(n, dtype=np.uint32)
        by_levels(_starts(self.degrees), self.neighbours, order, np.zeros(n, dtype=np.bool_))
        return order.astype(np.int64)

    def laid_out(self, order: Ints, place: Ints, window: Ints) -> tuple[_Indices, _Indices]:
        """Return `Connectivity.runs` and `Connectivity.ring` for vertices in that order."""
        degrees, closed = self.degrees[order], self.closed[order]
        keys = np.stack([degrees, closed, window])
        first = np.flatnonzero(np.concatenate([[True], (keys[:, 1:] != keys[:, :-1]).any(axis=0)]))
        last = np.append(first[1:], len(order))
        sizes = last - first
        base = np.cumsum(sizes * degrees[first]) - sizes * degrees[first]
        # The entry of a vertex's j-th neighbour lies j times the size of its run behind that of its first.
        run = np.repeat(np.arange(len(first)), sizes)[
            place
        ]  # of each vertex of the mesh, as are the neighbours
        start = (base[run] + place - first[run]).astype(np.uint32)
        rank = np.arange(len(self.neighbours), dtype=np.uint32)
        rank -= np.repeat(_starts(self.degrees)[:-1], self.degrees)
        rank *= np.repeat(sizes[run].astype(np.uint32), self.degrees)
        rank += np.repeat(start, self.degrees)
        ring = np.zeros(len(self.neighbours) + LANES, dtype=np.uint32)  # some are read beyond the end
        ring[rank] = place.astype(np.uint32)[self.neighbours]
        marks = np.where(closed[first], RING, 0)
        runs = np.stack(
            [first, last, marks, degrees[first], base, *_reaches(first, base, degrees, ring)], axis=1
        )
        return runs.astype(np.uint32), ring


def _reaches(first: Ints, base: Ints, degrees: Ints, ring: _Indices) -> tuple[Ints, Ints]:
    """Return the columns BACK and ON of `Connectivity.runs`, for runs that begin at ``first``."""
    own = np.arange(len(first))
    some = np.flatnonzero(degrees[first])
    low, high = own.copy(), own.copy()
    for reach, extreme in ((low, np.minimum), (high, np.maximum)):
        farthest = extreme.reduceat(ring[:-LANES], base[some]) if len(some) else base[some]
        reach[some] = extreme(own[some], np.searchsorted(first, farthest, side="right") - 1)
    return np.minimum.accumulate(low[::-1])[::-1], np.maximum.accumulate(high) + 1


def _twins(topology: Topology) -> _Indices:
    """(3m,) the half-edge against each half-edge, NONE where there is none."""
    inside = np.repeat(topology.interior, topology.face_count)
    order = topology.halfedges[inside].reshape(-1, 2)
    twins = np.full(len(topology.halfedges), NONE, dtype=np.uint32)
    twins[order[:, 0]], twins[order[:, 1]] = order[:, 1], order[:, 0]
    return twins


def _starts(counts: Ints) -> _Indices:
    """(n + 1,) where each of n lists begins, and where the last ends."""
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.uint32)


def _inverse(order: NDArray[Index]) -> NDArray[Index]:
    place = np.empty_like(order)
    place[order] = np.arange(len(order), dtype=order.dtype)
    return place
