"""The energy that the last of a run falls by, its gradient; see `spherify.geometry.finish`.

Face by face, each of which adds to the sums of its three vertices, in their order: there is one thread. What all of the
surface has a part in, area and volume, multiplies those sums in the end, so that faces are gone through once.
"""

from __future__ import annotations

import math
from typing import Final, TypeAlias

import numpy as np

from spherify.geometry.kernels.passes.directions import minus
from spherify.geometry.kernels.passes.jit import entry, inner, pasted
from spherify.geometry.kernels.passes.types import Floats, Index, Indices
from spherify.geometry.kernels.passes.vectors import Vector, cross, dot

Place: TypeAlias = np.uint64

SUMS: Final = 9  # of a vertex; in this order:
AREAS: Final = 0  # twice the gradient of the area of its faces
VOLUMES: Final = 3  # their area vectors
APART: Final = 6  # what the barrier pushes by

SMALL: Final = 1e-100  # a product of volumes, whose logarithm is taken before it vanishes


@pasted
def row(v: Floats, at: Place) -> Vector:
    """Return three numbers after each other."""
    return v[at], v[np.uint64(at + np.uint64(1))], v[np.uint64(at + np.uint64(2))]


@pasted
def add(sums: Floats, at: Place, v: Vector, by: float) -> None:
    """Add by·v to three numbers after each other."""
    one, two = np.uint64(at + np.uint64(1)), np.uint64(at + np.uint64(2))
    sums[at] += by * v[0]
    sums[one] += by * v[1]
    sums[two] += by * v[2]


@inner
def direct(P: Floats, U: Floats) -> None:
    """Write directions."""
    p = np.uint64(0)
    while p < P.size:
        at = row(P, p)
        over = 1.0 / math.sqrt(dot(at, at))
        U[p], U[p + np.uint64(1)], U[p + np.uint64(2)] = over * at[0], over * at[1], over * at[2]
        p += np.uint64(3)


@inner
def corner(
    sums: Floats, p: Index, opposite: Vector, normal: Vector, vector: Vector, across: Vector, share: float
) -> None:
    """Add what a face brings one of its vertices.

    Args:
        sums: (SUMS·n,).
        p: the vertex.
        opposite: the edge opposite it, counter-clockwise.
        normal: of the face.
        vector: its area vector.
        across: gradient of the volume between the directions of its vertices and the centre, det(u, v, w).
        share: one over that.

    """
    at = np.uint64(SUMS) * np.uint64(p)
    add(sums, at, cross(normal, opposite), 1.0)
    add(sums, np.uint64(at + np.uint64(VOLUMES)), vector, 1.0)
    add(sums, np.uint64(at + np.uint64(APART)), across, -share)


@inner
def by_faces(P: Floats, U: Floats, F: Indices, sums: Floats) -> tuple[float, float, float]:
    """Add up what all faces bring their vertices; return area, three times the volume, and the sum of log det.

    The area is none if a face has none, or does not look outward.
    """
    three = np.uint64(3)
    area, volume, logarithms, product = 0.0, 0.0, 0.0, 1.0
    sums[:] = 0.0
    for f in range(np.uint64(0), np.uint64(F.size), three):
        i, j, k = F[f], F[f + np.uint64(1)], F[f + np.uint64(2)]
        pi, pj, pk = three * np.uint64(i), three * np.uint64(j), three * np.uint64(k)
        a, b, c = row(P, pi), row(P, pj), row(P, pk)
        from_a, from_b, from_c = minus(b, a), minus(c, b), minus(a, c)
        x, y, z = cross(from_c, from_a)
        vector = (0.5 * x, 0.5 * y, 0.5 * z)
        here = math.sqrt(dot(vector, vector))
        u, v, w = row(U, pi), row(U, pj), row(U, pk)
        across = cross(v, minus(w, v))
        inside = dot(minus(u, v), across)
        if not (inside > 0 and here > 0):
            return 0.0, 0.0, 0.0
        area += here
        volume += dot(vector, a)
        product *= inside
        if product < SMALL:
            logarithms += math.log(product)
            product = 1.0
        over, share = 1.0 / here, 1.0 / inside
        normal = (over * vector[0], over * vector[1], over * vector[2])
        corner(sums, i, from_b, normal, vector, across, share)
        corner(sums, j, from_c, normal, vector, cross(w, minus(u, w)), share)
        corner(sums, k, from_a, normal, vector, cross(u, minus(v, u)), share)
    return area, volume, logarithms + math.log(product)


@inner
def gather(
    P: Floats, U: Floats, sums: Floats, outward: float, along: float, barrier: float, gradient: Floats
) -> None:
    """Write the gradient.

    Args:
        P: (3n,) positions.
        U: (3n,) directions.
        sums: (SUMS·n,).
        outward: 1 / (2·area).
        along: 2 / (3·volume), over the 3 that area vectors are longer than the gradient of the volume.
        barrier: the factor of Σ log det.
        gradient: (3n,) out.

    """
    p, at = np.uint64(0), np.uint64(0)
    while p < P.size:
        position, u = row(P, p), row(U, p)
        areas, volumes = row(sums, at), row(sums, np.uint64(at + np.uint64(VOLUMES)))
        apart = row(sums, np.uint64(at + np.uint64(APART)))
        off, by = dot(apart, u), barrier / dot(position, u)
        gradient[p] = outward * areas[0] - along * volumes[0] + by * (apart[0] - off * u[0])
        gradient[p + np.uint64(1)] = outward * areas[1] - along * volumes[1] + by * (apart[1] - off * u[1])
        gradient[p + np.uint64(2)] = outward * areas[2] - along * volumes[2] + by * (apart[2] - off * u[2])
        p += np.uint64(3)
        at += np.uint64(SUMS)


@entry
def energy(P: Floats, F: Indices, barrier: float, U: Floats, sums: Floats, gradient: Floats) -> float:
    """Return E at some positions; inf beyond the barrier.

    Args:
        P: (3n,) positions from the centre; vectors are three numbers after each other.
        F: (3m,) faces.
        barrier: before it is shared out among the faces.
        U: (3n,) scratch.
        sums: (SUMS·n,) scratch.
        gradient: (3n,) out, of E.

    """
    direct(P, U)
    area, volume, logarithms = by_faces(P, U, F, sums)
    volume /= 3
    if not (area > 0 and volume > 0):
        return np.inf
    m = F.size / 3
    share = barrier * 4 * math.pi / (m * m)
    gather(P, U, sums, 0.5 / area, 2 / (9 * volume), share, gradient)
    return math.log(area) - 2 / 3 * math.log(volume) - share * logarithms
