"""Triangles on the zero level of a function: surface nets, then tangential smoothing back onto the surface."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from spherify.geometry import measures
from spherify.geometry.errors import InvalidConfigError
from spherify.geometry.mesh import Floats, Ints, TriangleMesh
from spherify.geometry.topology import Topology
from spherify.geometry.transformation import relaxed

Field = Callable[[Floats], Floats]

SMOOTHING_ROUNDS: Final = 60
SHIFTED_GRIDS: Final = 60


@dataclass(frozen=True, slots=True)
class Implicit:
    """A body given by a function, negative inside, that grows about as fast as the distance.

    Attributes:
        field: from points (k, 3) to values (k,).
        low: (3,) corner of a box around the body.
        high: (3,) the opposite corner.
        coarsest: number of vertices below which parts of the body would run together.

    """

    field: Field
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    coarsest: int


def surface(body: Implicit, resolution: int) -> TriangleMesh:
    """Return the surface of a body with about ``resolution`` vertices, at least ``body.coarsest``.

    Raises:
        InvalidConfigError: the body is not closed, connected and of genus 0 at this resolution.

    """
    aim = max(resolution, body.coarsest)
    cell = max(high - low for low, high in zip(body.low, body.high, strict=True)) / 24
    for _ in range(4):  # the number of vertices grows with the inverse square of the cell
        V, F = _surface_net(body, cell)
        if abs(len(V) / aim - 1) < 0.02:
            break
        cell *= math.sqrt(len(V) / aim)
    topology = Topology.of(len(V), F)
    for shift in range(1, SHIFTED_GRIDS):
        if _is_sphere(topology):
            break
        # Four quads met where the surface cut a grid face twice: a grid that lies otherwise mends it.
        V, F = _surface_net(body, cell, shift * 0.618034 % 1)
        topology = Topology.of(len(V), F)
    else:
        raise InvalidConfigError(f"the shape needs more than {len(V)} vertices to be closed and of genus 0")
    for spread in (*np.linspace(0.7, 0.3, SMOOTHING_ROUNDS), 0.0, 0.0, 0.0):
        normals = measures.vertex_normals(measures.face_normals(V, F), F, len(V))
        V = relaxed(V, normals, topology, np.ones(len(V)), float(spread))
        V = V - np.clip(body.field(V), -cell / 2, cell / 2)[:, None] * normals  # back to the surface
    return TriangleMesh.checked(V, F)


def _is_sphere(topology: Topology) -> bool:
    """Whether a surface is closed, manifold, in one piece and of genus 0."""
    defects = (topology.nonmanifold_edges, topology.nonmanifold_vertices, topology.misoriented_edges)
    return (
        topology.closed and topology.n_components == 1 and topology.genus == 0 and not any(map(len, defects))
    )


def _surface_net(body: Implicit, cell: float, shift: float = 0.0) -> tuple[Floats, Ints]:
    """Place a vertex in each grid cell the surface passes through, and a quad across each grid edge it cuts.

    Gibson, "Constrained elastic surface nets", 1998; the vertex is the mean of the cuts of the cell's edges.
    """
    low = np.array(body.low) - cell * (1.37 + shift * np.array([1.0, 0.7, 0.4]))
    counts = np.ceil((np.array(body.high) + cell - low) / cell).astype(np.int64) + 1
    axes = [low[k] + cell * np.arange(counts[k]) for k in range(3)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    values = body.field(grid.reshape(-1, 3)).reshape(counts)
    inside = values < 0
    summed, cuts = np.zeros((*counts, 3)), np.zeros(counts)
    quads: list[Ints] = []
    numbers = np.arange(values.size).reshape(counts)
    for axis in range(3):
        here, there = _shifted(axis, 0), _shifted(axis, 1)
        at = np.argwhere(inside[here] != inside[there])
        start, end = values[here][tuple(at.T)], values[there][tuple(at.T)]
        point = low + cell * at
        point[:, axis] += cell * start / (start - end)
        u, v = (axis + 1) % 3, (axis + 2) % 3
        around = []
        for du, dv in ((0, 0), (1, 0), (1, 1), (0, 1)):
            corner = at.copy()
            corner[:, u] -= du
            corner[:, v] -= dv
            np.add.at(summed, tuple(corner.T), point)
            np.add.at(cuts, tuple(corner.T), 1)
            around.append(numbers[tuple(corner.T)])
        quad = np.stack(around, axis=1)
        quads.append(np.where((start < 0)[:, None], quad, quad[:, ::-1]))
    used, corners = np.unique(np.concatenate(quads), return_inverse=True)
    V = summed.reshape(-1, 3)[used] / cuts.reshape(-1)[used][:, None]
    return V, _halved(V, corners.reshape(-1, 4))


def _shifted(axis: int, by: int) -> tuple[slice, slice, slice]:
    """Select all grid points with a neighbour along ``axis``: themselves, or the neighbours."""
    cut = slice(1, None) if by else slice(None, -1)
    return tuple(cut if k == axis else slice(None) for k in range(3))  # type: ignore[return-value] # of length 3


def _halved(V: Floats, quads: Ints) -> Ints:
    """Cut each quad along its shorter diagonal."""
    a, b, c, d = (quads[:, k] for k in range(4))
    first = measures.norm(V[c] - V[a]) <= measures.norm(V[d] - V[b])
    one = np.where(first[:, None], np.stack([a, b, c], axis=1), np.stack([a, b, d], axis=1))
    two = np.where(first[:, None], np.stack([a, c, d], axis=1), np.stack([b, c, d], axis=1))
    return np.concatenate([one, two])
