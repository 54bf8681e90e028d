"""Radii from a centre: momentum and elementary steps along them, and evening them out; directions stay.

See `spherify.geometry.unfolding.evened_out`. Its t is linear in the radius and never cut off: all of its T is one
linear map of the radii, which depends on their mean and extremes only.
"""

from __future__ import annotations

import math

import numpy as np

from spherify.geometry.kernels.passes.jit import entry, inner
from spherify.geometry.kernels.passes.spans import BLOCK, SEGMENT, Span, Sums, begin_sums
from spherify.geometry.kernels.passes.totals import greatest_of, least_of, total_of
from spherify.geometry.kernels.passes.types import Buffers, Floats, Index
from spherify.geometry.kernels.passes.vectors import Vector
from spherify.geometry.unfolding import LEAST_RADIUS

# The passes; a call names one.
AHEAD = 1
STEP = 2
MEASURE = 4
EVEN = 8

TOTAL, LEAST, GREATEST = 0, 1, 2  # sums of MEASURE


@inner
def length(x: float, y: float, z: float) -> float:
    """√(x² + y² + z²)."""
    return math.sqrt(x * x + y * y + z * z)


@inner
def ahead(
    x: Floats, y: Floats, z: Floats, bx: Floats, by: Floats, bz: Floats, centre: Vector, momentum: float,
    low: Index, high: Index,
) -> None:  # fmt: skip
    """Go on by a share of how much further out vertices are than before, r + b Δr for a radius r."""
    for p in range(low, high):
        dx, dy, dz = x[p] - centre[0], y[p] - centre[1], z[p] - centre[2]
        before = length(bx[p] - centre[0], by[p] - centre[1], bz[p] - centre[2])
        share = 1 + momentum * (1 - before / length(dx, dy, dz))
        x[p], y[p], z[p] = centre[0] + dx * share, centre[1] + dy * share, centre[2] + dz * share


@inner
def move_radially(
    x: Floats, y: Floats, z: Floats, K: Floats, K_min: float, K_max: float, step: float, centre: Vector,
    low: Index, high: Index,
) -> None:  # fmt: skip
    """I_C, or, with a negative step, O_C, with the direction from the centre for the normal and without a bound."""
    for p in range(low, high):
        t = (K[p] - K_min) / (K_max - K_min)
        t = 0.0 if t < 0 else t
        t = 1.0 if t > 1 else t
        distance = -(step * t) if step > 0 else -step * (1.0 - t)
        dx, dy, dz = x[p] - centre[0], y[p] - centre[1], z[p] - centre[2]
        share = distance / length(dx, dy, dz)
        x[p] += share * dx
        y[p] += share * dy
        z[p] += share * dz


@inner
def measure(
    x: Floats, y: Floats, z: Floats, radius: Floats, centre: Vector,
    total: Floats, least: Floats, greatest: Floats, low: Index, high: Index,
) -> None:  # fmt: skip
    """Write the radii of a block; sum, least and greatest are kept apart by place in the block."""
    for p in range(low, high):
        j = np.uint32(p - low)
        r = length(x[p] - centre[0], y[p] - centre[1], z[p] - centre[2])
        radius[p] = r
        total[j] += r
        least[j] = r if r < least[j] else least[j]
        greatest[j] = r if r > greatest[j] else greatest[j]


@inner
def even(
    x: Floats, y: Floats, z: Floats, radius: Floats, centre: Vector, factor: float, offset: float,
    low: Index, high: Index,
) -> None:  # fmt: skip
    """Move vertices to the radius factor·r + offset, or LEAST_RADIUS·r if that is more."""
    for p in range(low, high):
        share = factor + offset / radius[p]
        share = share if share > LEAST_RADIUS else LEAST_RADIUS
        x[p] = centre[0] + share * (x[p] - centre[0])
        y[p] = centre[1] + share * (y[p] - centre[1])
        z[p] = centre[2] + share * (z[p] - centre[2])


@entry
def along_radii(
    use: Buffers, sums: Sums, centre: Vector, one: float, two: float, step: float, passes: int, span: Span
) -> None:
    """Do one thread's part of moving ``use.position`` along the radii.

    Args:
        use: AHEAD takes from ``moved`` where vertices were before, STEP K from ``curvature``; MEASURE writes radii to
            ``curvature``, for EVEN.
        sums: of the radii, by MEASURE.
        centre: c.
        one: b for AHEAD, K_min for STEP, the factor for EVEN.
        two: K_max for STEP, the offset for EVEN.
        step: C for STEP, negative outward.
        passes: one of them.
        span: of the thread.

    """
    x, y, z, radius, lanes = use.position[0], use.position[1], use.position[2], use.curvature, sums.lanes
    if passes & AHEAD:
        bx, by, bz = use.moved[0], use.moved[1], use.moved[2]
        ahead(x, y, z, bx, by, bz, centre, one, span.first, span.last)
    if passes & STEP:
        move_radially(x, y, z, radius, one, two, step, centre, span.first, span.last)
    if passes & EVEN:
        even(x, y, z, radius, centre, one, two, span.first, span.last)
    if passes & MEASURE:
        for s in range(span.first_stretch, span.last_stretch):
            begin_sums(lanes, 0.0, np.inf, 0.0)
            low, end = np.uint32(s * SEGMENT), min(np.uint32((s + 1) * SEGMENT), np.uint32(x.size))
            while low < end:
                high = min(np.uint32(low + np.uint32(BLOCK)), end)
                measure(x, y, z, radius, centre, lanes[TOTAL], lanes[LEAST], lanes[GREATEST], low, high)
                low = high
            sums.whole[s, TOTAL] = total_of(lanes[TOTAL, :BLOCK])
            sums.whole[s, LEAST] = least_of(lanes[LEAST, :BLOCK])
            sums.whole[s, GREATEST] = greatest_of(lanes[GREATEST, :BLOCK])
