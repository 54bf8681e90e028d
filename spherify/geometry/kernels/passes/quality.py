"""The triangles one by one: shape, area, which way they look; and how far the vertices are from a centre.

Face by face these are the numbers of the reference to the last bit, from products and sums in the same order: whether
a face without area looks inward is rounding and nothing else.
"""

from __future__ import annotations

import math

import numpy as np

from spherify.geometry.kernels.passes.jit import entry, inner
from spherify.geometry.kernels.passes.shape import BLOCK, SEGMENT
from spherify.geometry.kernels.passes.totals import greatest_of, least_of, total_of
from spherify.geometry.kernels.passes.types import Floats, Index, Indices

QUALITY, AREA, INWARD = 0, 1, 2  # sums
LEAST_QUALITY, LEAST_AREA, NEAREST, FARTHEST = 3, 4, 5, 6
PERFECT = 4 * math.sqrt(3)  # times the area of an equilateral triangle is the sum of the squares of its edges


@inner
def triangles(
    x: Floats, y: Floats, z: Floats, a: Indices, b: Indices, c: Indices, cx: float, cy: float, cz: float,
    qualities: Floats, areas: Floats, inward: Floats, worst: Floats, smallest: Floats, low: Index, high: Index,
) -> None:  # fmt: skip
    """Add a block of faces to sums, and to extremes, kept apart by place in the block."""
    for f in range(low, high):
        j = np.uint32(f - low)
        p, q, r = a[f], b[f], c[f]
        ax, ay, az = x[p], y[p], z[p]
        bx, by, bz = x[q], y[q], z[q]
        dx, dy, dz = x[r], y[r], z[r]
        ux, uy, uz = bx - ax, by - ay, bz - az
        vx, vy, vz = dx - ax, dy - ay, dz - az
        wx, wy, wz = dx - bx, dy - by, dz - bz
        nx, ny, nz = 0.5 * (uy * vz - uz * vy), 0.5 * (uz * vx - ux * vz), 0.5 * (ux * vy - uy * vx)
        area = math.sqrt(nx * nx + ny * ny + nz * nz)
        squares = (
            (ux * ux + uy * uy + uz * uz) + (wx * wx + wy * wy + wz * wz) + (vx * vx + vy * vy + vz * vz)
        )
        quality = PERFECT * area / squares
        quality = quality if squares != 0 else 0.0
        outward = nx * (ax + bx + dx - cx) + ny * (ay + by + dy - cy) + nz * (az + bz + dz - cz)
        qualities[j] += quality
        areas[j] += area
        inward[j] += 1.0 if outward <= 0 else 0.0
        worst[j] = quality if quality < worst[j] else worst[j]
        smallest[j] = area if area < smallest[j] else smallest[j]


@inner
def reach(
    x: Floats, y: Floats, z: Floats, cx: float, cy: float, cz: float, nearest: Floats, farthest: Floats,
    low: Index, high: Index,
) -> None:  # fmt: skip
    """Bring the extremes of |p - c|² up to date, kept apart by place in the block."""
    for p in range(low, high):
        j = np.uint32(p - low)
        dx, dy, dz = x[p] - cx, y[p] - cy, z[p] - cz
        squared = dx * dx + dy * dy + dz * dz
        nearest[j] = squared if squared < nearest[j] else nearest[j]
        farthest[j] = squared if squared > farthest[j] else farthest[j]


@entry
def judge(
    position: Floats, corners: Indices, centre: Floats, lanes: Floats, sums: Floats,
    first_segment: int, last_segment: int, first: Index, last: Index,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Judge one thread's part of the faces, by the segments of `spherify.geometry.kernels.passes.shape`, and vertices.

    Args:
        position: (3, n).
        corners: (3, m).
        centre: (3,) c.
        lanes: (SUMS, BLOCK) scratch of the thread.
        sums: (segments, SUMS) out: sums of quality and area, and the number of faces that look towards c.
        first_segment: of the part.
        last_segment: one behind the part.
        first: vertex of the part.
        last: one behind the part.

    Returns:
        least quality, least area, least and greatest |p - c| of the part.

    """
    x, y, z = position[0], position[1], position[2]
    a, b, c = corners[0], corners[1], corners[2]
    cx, cy, cz = centre[0], centre[1], centre[2]
    qualities, areas, inward = lanes[QUALITY], lanes[AREA], lanes[INWARD]
    worst, smallest, nearest, farthest = (
        lanes[LEAST_QUALITY],
        lanes[LEAST_AREA],
        lanes[NEAREST],
        lanes[FARTHEST],
    )
    for j in range(BLOCK):
        worst[j], smallest[j], nearest[j], farthest[j] = np.inf, np.inf, np.inf, 0.0
    for s in range(first_segment, last_segment):
        for j in range(BLOCK):
            qualities[j], areas[j], inward[j] = 0.0, 0.0, 0.0
        low, end = np.uint32(s * SEGMENT), min(np.uint32((s + 1) * SEGMENT), np.uint32(a.size))
        while low < end:
            high = min(np.uint32(low + np.uint32(BLOCK)), end)
            triangles(
                x, y, z, a, b, c, 3.0 * cx, 3.0 * cy, 3.0 * cz, qualities, areas, inward, worst, smallest, low, high
            )  # fmt: skip
            low = high
        for k in range(3):
            sums[s, k] = total_of(lanes[k, :BLOCK])
    low = first
    while low < last:
        high = min(np.uint32(low + np.uint32(BLOCK)), last)
        reach(x, y, z, cx, cy, cz, nearest, farthest, low, high)
        low = high
    return (
        least_of(worst[:BLOCK]),
        least_of(smallest[:BLOCK]),
        math.sqrt(least_of(nearest[:BLOCK])),
        math.sqrt(greatest_of(farthest[:BLOCK])),
    )
