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
def share(
    u: Vector, q: Vector, r: Vector, ax: float, ay: float, az: float, bx: float, by: float, bz: float
) -> tuple[float, float]:
    """Return m/h for the corner u of a triangle u, q, r, along the tangents a and b."""
    dx, dy, dz = r[0] - q[0], r[1] - q[1], r[2] - q[2]
    x, y, z = q[1] * dz - q[2] * dy, q[2] * dx - q[0] * dz, q[0] * dy - q[1] * dx
    length = max(math.sqrt(x * x + y * y + z * z), LEAST_AREA)
    altitude = max((x * (u[0] - q[0]) + y * (u[1] - q[1]) + z * (u[2] - q[2])) / length, LEAST_ALTITUDE)
    over = 1 / (length * altitude)
    return over * (x * ax + y * ay + z * az), over * (x * bx + y * by + z * bz)


@inner
def pressed(mesh: Connectivity, x: Floats, y: Floats, z: Floats, p: Index) -> Vector:
    """Return where the triangles around p lead its direction."""
    three, u = np.uint32(3), point(x, y, z, p)
    ax, ay, az, bx, by, bz = tangents(u[0], u[1], u[2])
    g, h, a, b, c, shortest = 0.0, 0.0, 0.0, 0.0, 0.0, np.inf
    first, last = mesh.first[p], mesh.first[np.uint32(p + np.uint32(1))]
    for i in range(first, last):
        f, at = mesh.halfedges[i] // three, mesh.halfedges[i] % three
        v = point(x, y, z, mesh.corners[(at + np.uint32(1)) % three, f])
        w = point(x, y, z, mesh.corners[(at + np.uint32(2)) % three, f])
        one, two = share(u, v, w, ax, ay, az, bx, by, bz)
        g += one
        h += two
        a += one * one
        b += one * two
        c += two * two
        dx, dy, dz = v[0] - u[0], v[1] - u[1], v[2] - u[2]
        shortest = min(shortest, dx * dx + dy * dy + dz * dz)
    determinant = max(a * c - b * b, LEAST_AREA)
    s, t = (c * g - b * h) / determinant, (a * h - b * g) / determinant
    nearer = LEAST_AREA
    for i in range(first, last):
        f, at = mesh.halfedges[i] // three, mesh.halfedges[i] % three
        v = point(x, y, z, mesh.corners[(at + np.uint32(1)) % three, f])
        w = point(x, y, z, mesh.corners[(at + np.uint32(2)) % three, f])
        one, two = share(u, v, w, ax, ay, az, bx, by, bz)
        nearer = max(nearer, -(one * s + two * t))
    far = max(math.sqrt(s * s + t * t), LEAST_AREA)
    moved = min(SPREAD, NO_FLIP * min(1 / nearer, math.sqrt(shortest) / far))
    one, two = moved * s, moved * t
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
