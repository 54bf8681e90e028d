"""The connectivity as the compiled passes read it: renumbered so that what is near on the surface is near in memory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import reverse_cuthill_mckee

from spherify.geometry.kernels.passes.types import Connectivity
from spherify.geometry.kernels.passes.vertices import WINDOW
from spherify.geometry.mesh import Ints
from spherify.geometry.topology import Topology

_Indices = NDArray[np.uint32]


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
        """Give vertices places: by reverse Cuthill-McKee, then within windows by how many edges and faces they have.

        Faces and edges follow the order of their first vertices. Gathers then stay within the cache at any size.
        """
        n = topology.n_vertices
        degrees = np.stack(
            [
                topology.interior_degrees,
                np.bincount(topology.faces.reshape(-1), minlength=n),
                np.bincount(topology.edges.reshape(-1), minlength=n),
            ]
        )
        order = _local_order(topology)
        window = np.arange(n) // WINDOW
        order = order[np.lexsort((degrees[2, order], degrees[0, order], degrees[1, order], window))]
        place = _inverse(order)
        degrees = degrees[:, order]

        faces = place[topology.faces]
        faces_order = np.argsort(faces.min(axis=1), kind="stable")
        faces = faces[faces_order]
        ends = place[topology.interior_edges]
        sides = _inverse(faces_order)[topology.interior_edge_faces]
        edges_order = np.lexsort((ends.max(axis=1), ends.min(axis=1)))
        ends, sides = ends[edges_order], sides[edges_order]
        every = place[topology.edges]

        first, last = _runs(degrees, window)
        columns: list[Ints] = [first, last]
        lists = []
        for degree, owners, entries in (
            (degrees[0], ends.T.reshape(-1), np.tile(np.arange(len(ends)), 2)),
            (degrees[1], faces.T.reshape(-1), np.tile(np.arange(len(faces)), 3)),
            (degrees[2], every.T.reshape(-1), every[:, ::-1].T.reshape(-1)),
        ):
            base, listed = _neighbour_by_neighbour(first, last, degree, owners, entries)
            columns += [degree[first], base]
            lists.append(listed)
        connectivity = Connectivity(
            corners=_rows(faces),
            ends=_rows(ends),
            sides=_rows(sides),
            runs=np.stack(columns, axis=1).astype(np.uint32),
            edges_at=lists[0],
            faces_at=lists[1],
            ring=lists[2],
            held=place[held].astype(np.uint32),
        )
        return cls(order, place, connectivity)


def _local_order(topology: Topology) -> Ints:
    """(n,) vertices in an order in which neighbours are near."""
    n, edges = topology.n_vertices, topology.edges
    pairs = np.concatenate([edges, edges[:, ::-1]])
    links = coo_array((np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    return np.asarray(reverse_cuthill_mckee(links.tocsr(), symmetric_mode=True), dtype=np.int64)


def _inverse(order: Ints) -> Ints:
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    return place


def _runs(degrees: Ints, window: Ints) -> tuple[Ints, Ints]:
    """First vertices of the runs, and those behind their last: same window, same three degrees."""
    keys = np.concatenate([degrees, window[None]])
    starts = np.concatenate([[True], (keys[:, 1:] != keys[:, :-1]).any(axis=0)])
    first = np.flatnonzero(starts)
    return first, np.append(first[1:], len(window))


def _neighbour_by_neighbour(
    first: Ints, last: Ints, degree: Ints, owners: Ints, entries: Ints
) -> tuple[Ints, _Indices]:
    """Lay out lists, run by run: the first entry of each vertex of the run, then the second of each, and so on.

    Args:
        first: (r,) first vertices of the runs.
        last: (r,) those behind their last.
        degree: (n,) lengths of the lists, the same within a run.
        owners: (k,) the vertex of each entry.
        entries: (k,) in any order; a vertex keeps it.

    Returns:
        where each run begins, and all lists.

    """
    sizes = last - first
    base = np.concatenate([[0], np.cumsum(sizes * degree[first])])[:-1]
    by_owner = np.argsort(owners, kind="stable")
    owner = owners[by_owner]
    starts = np.concatenate([[0], np.cumsum(degree)])
    rank = np.arange(len(owner)) - starts[owner]
    run = np.repeat(np.arange(len(first)), sizes)[owner]
    listed = np.empty(len(owner), dtype=np.uint32)
    listed[base[run] + rank * sizes[run] + owner - first[run]] = entries[by_owner]
    return base, listed


def _rows(columns: Ints) -> _Indices:
    """(k, j) indices as (j, k), row by row in memory."""
    return np.ascontiguousarray(columns.T, dtype=np.uint32)
