"""Directions from a centre, and the triangles they make: which way those look, and how small they are."""

from __future__ import annotations

import math

import numpy as np

from spherify.geometry.kernels.passes.arithmetic import angle_over
from spherify.geometry.kernels.passes.jit import entry, inner, pasted
from spherify.geometry.kernels.passes.spans import BLOCK, SEGMENT, Span, Sums, begin_sums, end_sums
from spherify.geometry.kernels.passes.totals import least_of
from spherify.geometry.kernels.passes.types import Buffers, Connectivity, Floats, Index, Indices
from spherify.geometry.kernels.passes.vectors import Vector, cross, dot

# The passes of `see`; a call names some.
DIRECT = 1
FOLDS = 2
COVER = 4

INWARD, AREA, LEAST = 0, 1, 2  # sums of FOLDS
ANGLE, TURNED = 0, 1  # sums of COVER


@inner
def direct(x: Floats, y: Floats, z: Floats, radius: Floats, centre: Vector, low: Index, high: Index) -> None:
    """Turn positions into directions, 0 where there is none, and radii."""
    for p in range(low, high):
        dx, dy, dz = x[p] - centre[0], y[p] - centre[1], z[p] - centre[2]
        r = math.sqrt(dx * dx + dy * dy + dz * dz)
        by = 1.0 / (r if r != 0 else 1.0)
        x[p], y[p], z[p], radius[p] = by * dx, by * dy, by * dz, r


@inner
def copy(
    x: Floats, y: Floats, z: Floats, mx: Floats, my: Floats, mz: Floats, low: Index, high: Index
) -> None:
    """Copy vectors to (mx, my, mz)."""
    for p in range(low, high):
        mx[p], my[p], mz[p] = x[p], y[p], z[p]


@inner
def back(x: Floats, y: Floats, z: Floats, radius: Floats, centre: Vector, low: Index, high: Index) -> None:
    """Turn directions into positions again, c + r·u."""
    for p in range(low, high):
        r = radius[p]
        x[p], y[p], z[p] = centre[0] + r * x[p], centre[1] + r * y[p], centre[2] + r * z[p]


@inner
def back_from(
    ux: Floats, uy: Floats, uz: Floats, x: Floats, y: Floats, z: Floats, radius: Floats, centre: Vector,
    low: Index, high: Index,
) -> None:  # fmt: skip
    """Write the positions c + r·u."""
    for p in range(low, high):
        r = radius[p]
        x[p], y[p], z[p] = centre[0] + r * ux[p], centre[1] + r * uy[p], centre[2] + r * uz[p]


@pasted
def point(x: Floats, y: Floats, z: Floats, p: Index) -> Vector:
    """Return a vector."""
    return x[p], y[p], z[p]


@inner
def minus(a: Vector, b: Vector) -> Vector:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inner
def triangle(a: Vector, b: Vector, c: Vector) -> tuple[float, float]:
    """Return the area of a triangle of directions, and a number that is positive where it looks outward."""
    ux, uy, uz = minus(b, a)
    vx, vy, vz = minus(c, a)
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return 0.5 * math.sqrt(x * x + y * y + z * z), x * a[0] + y * a[1] + z * a[2]


@inner
def look(
    x: Floats, y: Floats, z: Floats, a: Indices, b: Indices, c: Indices,
    inward: Floats, areas: Floats, least: Floats, low: Index, high: Index,
) -> None:  # fmt: skip
    """Add a block of triangles to sums kept apart by place in the block."""
    for f in range(low, high):
        j = np.uint32(f - low)
        area, facing = triangle(point(x, y, z, a[f]), point(x, y, z, b[f]), point(x, y, z, c[f]))
        inward[j] += 1.0 if facing <= 0 else 0.0
        areas[j] += area
        least[j] = area if area < least[j] else least[j]


@inner
def outcome(x: Floats, y: Floats, z: Floats, corners: Indices, sums: Sums, span: Span) -> None:
    """Sum up the triangles of directions: how many look inward, their area, and the least of their areas."""
    a, b, c, lanes = corners[0], corners[1], corners[2], sums.lanes
    for s in range(span.first_segment, span.last_segment):
        begin_sums(lanes, 0.0, 0.0, np.inf)
        low, end = np.uint32(s * SEGMENT), min(np.uint32((s + 1) * SEGMENT), np.uint32(a.size))
        while low < end:
            high = min(np.uint32(low + np.uint32(BLOCK)), end)
            look(x, y, z, a, b, c, lanes[INWARD], lanes[AREA], lanes[LEAST], low, high)
            low = high
        end_sums(lanes, sums.whole[s])
        sums.whole[s, LEAST] = least_of(lanes[LEAST, :BLOCK])


@inner
def cover(
    x: Floats, y: Floats, z: Floats, a: Indices, b: Indices, c: Indices, centre: Vector,
    angles: Floats, turned: Floats, low: Index, high: Index,
) -> None:  # fmt: skip
    """Add the solid angles of a block of triangles, as `spherify.geometry.covering.covering` does."""
    for f in range(low, high):
        j = np.uint32(f - low)
        p = minus(point(x, y, z, a[f]), centre)
        q = minus(point(x, y, z, b[f]), centre)
        r = minus(point(x, y, z, c[f]), centre)
        pp, qq, rr = math.sqrt(dot(p, p)), math.sqrt(dot(q, q)), math.sqrt(dot(r, r))
        sine = dot(p, cross(q, r))
        cosine = pp * qq * rr + dot(p, q) * rr + dot(q, r) * pp + dot(r, p) * qq
        half, _ = angle_over(sine, cosine if sine != 0 or cosine != 0 else 1.0, 1.0)
        angles[j] += 2 * half
        turned[j] -= 2 * half if half < 0 else 0.0


@entry
def see(mesh: Connectivity, use: Buffers, sums: Sums, centre: Vector, passes: int, span: Span) -> None:
    """Do one thread's part of looking at ``use.position`` from the centre, which stays as it is.

    Args:
        mesh: who touches whom.
        use: DIRECT writes directions to ``moved`` and radii to ``curvature``.
        sums: those of FOLDS, of ``moved``; or of COVER.
        centre: c.
        passes: DIRECT and FOLDS, or COVER.
        span: of the thread.

    """
    x, y, z = use.position[0], use.position[1], use.position[2]
    mx, my, mz = use.moved[0], use.moved[1], use.moved[2]
    if passes & DIRECT:
        copy(x, y, z, mx, my, mz, span.first, span.last)
        direct(mx, my, mz, use.curvature, centre, span.first, span.last)
    if passes & FOLDS:
        outcome(mx, my, mz, mesh.corners, sums, span)
    if passes & COVER:
        a, b, c, lanes = mesh.corners[0], mesh.corners[1], mesh.corners[2], sums.lanes
        for s in range(span.first_segment, span.last_segment):
            begin_sums(lanes, 0.0, 0.0, 0.0)
            low, end = np.uint32(s * SEGMENT), min(np.uint32((s + 1) * SEGMENT), np.uint32(a.size))
            while low < end:
                high = min(np.uint32(low + np.uint32(BLOCK)), end)
                cover(x, y, z, a, b, c, centre, lanes[ANGLE], lanes[TURNED], low, high)
                low = high
            end_sums(lanes, sums.whole[s])
