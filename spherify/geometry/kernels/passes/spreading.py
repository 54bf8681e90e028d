"""Vanishing triangles are drawn apart; see `spherify.geometry.unfolding.spread`, whose formulas these are."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from spherify.geometry.kernels.passes.directions import AREA, back, direct, outcome, point, triangle
from spherify.geometry.kernels.passes.jit import entry, inner
from spherify.geometry.kernels.passes.spans import SEGMENT, Span, Sums
from spherify.geometry.kernels.passes.totals import total_of
from spherify.geometry.kernels.passes.types import Buffers, Connectivity, Floats, Index, Indices
from spherify.geometry.kernels.passes.vectors import Vector
from spherify.geometry.unfolding import CROWDED, LEAST_ALTITUDE, LEAST_AREA, NO_FLIP, SPREAD

Flags: TypeAlias = NDArray[np.uint16]

# The passes, in this order; a call names some.
DIRECT = 1
LOOK = 2
MARK = 4
PRESS = 8
YIELD = 16
BACK = 32
ALL = 2 * BACK - 1


@inner
def mark(
    x: Floats, y: Floats, z: Floats, a: Indices, b: Indices, c: Indices, least: float, crowded: Flags,
    low: Index, high: Index,
) -> None:  # fmt: skip
    """Mark the corners of triangles below the least area; whichever thread does, writes the same."""
    for f in range(low, high):
        area, _ = triangle(point(x, y, z, a[f]), point(x, y, z, b[f]), point(x, y, z, c[f]))
        if area < least:
            crowded[a[f]] = crowded[b[f]] = crowded[c[f]] = 1


@inner
def tangents(x: float, y: float, z: float) -> tuple[float, float, float, float, float, float]:
    """Return two orthonormal tangents of the sphere at a direction."""
    if abs(x) < 0.6:
        ax, ay, az = 0.0, z, -y
    else:
        ax, ay, az = -z, 0.0, x
    length = math.sqrt(ax * ax + ay * ay + az * az)
    ax, ay, az = ax / length, ay / length, az / length
    return ax, ay, az, y * az - z * ay, z * ax - x * az, x * ay - y * ax


@inner
def opposite(u: Vector, q: Vector, r: Vector) -> tuple[float, float, float, float, float]:
    """Return the distance of u from the great circle through q and r, and the normal of that, with its length."""
    dx, dy, dz = r[0] - q[0], r[1] - q[1], r[2] - q[2]
    x, y, z = q[1] * dz - q[2] * dy, q[2] * dx - q[0] * dz, q[0] * dy - q[1] * dx
    length = max(math.sqrt(x * x + y * y + z * z), LEAST_AREA)
    altitude = (x * (u[0] - q[0]) + y * (u[1] - q[1]) + z * (u[2] - q[2])) / length
    return max(altitude, LEAST_ALTITUDE), x, y, z, length


@inner
def pressed(mesh: Connectivity, x: Floats, y: Floats, z: Floats, p: Index) -> Vector:
    """Return where the triangles around p lead its direction."""
    three, u = np.uint32(3), point(x, y, z, p)
    ax, ay, az, bx, by, bz = tangents(u[0], u[1], u[2])
    g, h, a, b, c, least = 0.0, 0.0, 0.0, 0.0, 0.0, np.inf
    for i in range(mesh.first[p], mesh.first[np.uint32(p + np.uint32(1))]):
        halfedge = mesh.halfedges[i]
        f, at = halfedge // three, halfedge % three
        v = point(x, y, z, mesh.corners[(at + np.uint32(1)) % three, f])
        w = point(x, y, z, mesh.corners[(at + np.uint32(2)) % three, f])
        altitude, nx, ny, nz, length = opposite(u, v, w)
        share = 1 / (length * altitude)
        one, two = share * (nx * ax + ny * ay + nz * az), share * (nx * bx + ny * by + nz * bz)
        g += one
        h += two
        a += one * one
        b += one * two
        c += two * two
        beside, _, _, _, _ = opposite(v, w, u)
        behind, _, _, _, _ = opposite(w, u, v)
        least = min(least, altitude, beside, behind)
    determinant = max(a * c - b * b, LEAST_AREA)
    one, two = (c * g - b * h) / determinant, (a * h - b * g) / determinant
    share = min(SPREAD, NO_FLIP * least / max(math.sqrt(one * one + two * two), LEAST_AREA))
    one, two = share * one, share * two
    tx, ty, tz = u[0] + one * ax + two * bx, u[1] + one * ay + two * by, u[2] + one * az + two * bz
    length = math.sqrt(tx * tx + ty * ty + tz * tz)
    return tx / length, ty / length, tz / length


@inner
def press(
    mesh: Connectivity, x: Floats, y: Floats, z: Floats, tx: Floats, ty: Floats, tz: Floats, crowded: Flags,
    low: Index, high: Index,
) -> None:  # fmt: skip
    """Write where the marked directions are led."""
    for p in range(low, high):
        if crowded[p] != 0:
            tx[p], ty[p], tz[p] = pressed(mesh, x, y, z, np.uint32(p))


@inner
def give(
    x: Floats, y: Floats, z: Floats, tx: Floats, ty: Floats, tz: Floats, crowded: Flags,
    low: Index, high: Index,
) -> None:  # fmt: skip
    """Move them there; none is marked any more."""
    for p in range(low, high):
        if crowded[p] != 0:
            x[p], y[p], z[p] = tx[p], ty[p], tz[p]
        crowded[p] = 0


@entry
def spread(
    mesh: Connectivity, use: Buffers, sums: Sums, centre: Vector, rounds: int, passes: int, span: Span
) -> None:
    """Do one thread's part of what `spherify.geometry.unfolding.spread` does to ``use.position``.

    Args:
        mesh: of a closed surface.
        use: ``curvature`` has the radii, ``position`` the directions, ``moved`` where they are led, ``bins`` the marks.
        sums: see `spherify.geometry.kernels.passes.directions.outcome`.
        centre: c.
        rounds: of LOOK, MARK, PRESS and YIELD; with none of them LOOK only looks.
        passes: DIRECT + …; all of them for one thread, one at a time for several.
        span: of the thread.

    """
    x, y, z, radius, crowded = use.position[0], use.position[1], use.position[2], use.curvature, use.bins
    tx, ty, tz = use.moved[0], use.moved[1], use.moved[2]
    first, last, m = span.first, span.last, np.uint32(mesh.corners.shape[1])
    if passes & DIRECT:
        direct(x, y, z, radius, centre, first, last)
        for p in range(first, last):
            crowded[p] = 0
    for _ in range(rounds):
        if passes & LOOK:
            outcome(x, y, z, mesh.corners, sums, span)
        if passes & MARK:
            least = CROWDED * total_of(sums.whole[:, AREA]) / m
            low = np.uint32(span.first_segment * SEGMENT)
            high = min(np.uint32(span.last_segment * SEGMENT), m)
            mark(x, y, z, mesh.corners[0], mesh.corners[1], mesh.corners[2], least, crowded, low, high)
        if passes & PRESS:
            press(mesh, x, y, z, tx, ty, tz, crowded, first, last)
        if passes & YIELD:
            give(x, y, z, tx, ty, tz, crowded, first, last)
    if passes & LOOK:
        outcome(x, y, z, mesh.corners, sums, span)
    if passes & BACK:
        back(x, y, z, radius, centre, first, last)
