"""Unfolding on the sphere; see `spherify.geometry.unfolding`."""

from __future__ import annotations

import math

import numpy as np

from spherify.geometry.kernels.passes.arithmetic import fma
from spherify.geometry.kernels.passes.directions import back, back_from, direct, outcome, point, triangle
from spherify.geometry.kernels.passes.jit import entry, inner
from spherify.geometry.kernels.passes.rings import BLOCK
from spherify.geometry.kernels.passes.spans import SEGMENT, Span, Sums
from spherify.geometry.kernels.passes.types import Buffers, Connectivity, Floats, Index, Indices, Scratch
from spherify.geometry.kernels.passes.vectors import Vector
from spherify.geometry.unfolding import FRACTION, LEAST_AREA, LEAST_LOG_WEIGHT

# The passes, in this order; a call names some.
DIRECT = 1
AREAS = 2
LEVEL = 4
SMOOTH = 8
APPROACH = 16
WEIGH = 32
DRAW = 64
LOOK = 128
BACK = 256
ALL = 2 * BACK - 1


@inner
def gather_two(
    ring: Indices, w: Floats, x: Floats, y: Floats, z: Floats,
    sx: Floats, sy: Floats, sz: Floats, total: Floats, begin: bool, one: Index, two: Index, count: Index,
) -> None:  # fmt: skip
    """Add w and w·(x, y, z) of two neighbours each, to sums or, with ``begin``, to zero."""
    for k in range(np.uint32(0), count):
        q = ring[np.uint32(one + k)]
        r = ring[np.uint32(two + k)]
        u, v = w[q], w[r]
        total[k] = (0.0 if begin else total[k]) + (u + v)
        sx[k] = fma(v, x[r], fma(u, x[q], 0.0 if begin else sx[k]))
        sy[k] = fma(v, y[r], fma(u, y[q], 0.0 if begin else sy[k]))
        sz[k] = fma(v, z[r], fma(u, z[q], 0.0 if begin else sz[k]))


@inner
def gather_one(
    ring: Indices, w: Floats, x: Floats, y: Floats, z: Floats,
    sx: Floats, sy: Floats, sz: Floats, total: Floats, begin: bool, one: Index, count: Index,
) -> None:  # fmt: skip
    """Add w and w·(x, y, z) of one neighbour each."""
    for k in range(np.uint32(0), count):
        q = ring[np.uint32(one + k)]
        u = w[q]
        total[k] = (0.0 if begin else total[k]) + u
        sx[k] = fma(u, x[q], 0.0 if begin else sx[k])
        sy[k] = fma(u, y[q], 0.0 if begin else sy[k])
        sz[k] = fma(u, z[q], 0.0 if begin else sz[k])


@inner
def areas_of(
    x: Floats, y: Floats, z: Floats, a: Indices, b: Indices, c: Indices, areas: Floats, low: Index, high: Index
) -> None:  # fmt: skip
    """Write the areas of some triangles of directions."""
    for f in range(low, high):
        area, _ = triangle(point(x, y, z, a[f]), point(x, y, z, b[f]), point(x, y, z, c[f]))
        areas[f] = area


@inner
def level_of(mesh: Connectivity, areas: Floats, level: Floats, low: Index, high: Index) -> None:
    """Write the logarithms of the areas around vertices."""
    for p in range(low, high):
        total = 0.0
        for i in range(mesh.first[p], mesh.first[np.uint32(p + np.uint32(1))]):
            total += areas[mesh.halfedges[i] // np.uint32(3)]
        level[p] = math.log(max(total, LEAST_AREA))


@inner
def add_levels(ring: Indices, level: Floats, total: Floats, begin: bool, at: Index, count: Index) -> None:
    """Add the level of one neighbour each, to sums or, with ``begin``, to zero."""
    for k in range(np.uint32(0), count):
        total[k] = (0.0 if begin else total[k]) + level[ring[np.uint32(at + k)]]


@inner
def meet(level: Floats, total: Floats, by: float, smooth: Floats, low: Index, count: Index) -> None:
    """Write the level of each vertex and the mean of its neighbours, half and half."""
    for k in range(np.uint32(0), count):
        p = np.uint32(low + k)
        smooth[p] = 0.5 * (level[p] + total[k] / by)


@inner
def smoothed(
    mesh: Connectivity, scratch: Scratch, level: Floats, smooth: Floats, first_run: int, last_run: int
) -> None:
    """Smooth the levels of the vertices of some runs once."""
    total = scratch.rows[0]
    for run in range(first_run, last_run):
        low, last, degree, at = mesh.runs[run, 0], mesh.runs[run, 1], mesh.runs[run, 3], mesh.runs[run, 4]
        step = np.uint32(last - low)
        while low < last:
            count = min(np.uint32(BLOCK), np.uint32(last - low))
            for j in range(np.uint32(0), degree):
                add_levels(mesh.ring, level, total, j == np.uint32(0), np.uint32(at + j * step), count)
            meet(level, total, np.float64(degree), smooth, low, count)
            low = np.uint32(low + count)
            at = np.uint32(at + count)


@inner
def approach(
    log_weights: Floats, level: Floats, damping: float, exponent: float, low: Index, high: Index
) -> float:
    """Bring the logarithms of the weights nearer to e times the levels; return the greatest."""
    greatest = -np.inf
    for p in range(low, high):
        log_weights[p] += damping * (exponent * level[p] - log_weights[p])
        greatest = max(greatest, log_weights[p])
    return greatest


@inner
def weights_of(log_weights: Floats, greatest: float, weights: Floats, low: Index, high: Index) -> None:
    """Make 1 the greatest weight."""
    for p in range(low, high):
        log_weights[p] = max(log_weights[p] - greatest, LEAST_LOG_WEIGHT)
        weights[p] = math.exp(log_weights[p])


@inner
def draw(
    x: Floats, y: Floats, z: Floats, sx: Floats, sy: Floats, sz: Floats, total: Floats,
    tx: Floats, ty: Floats, tz: Floats, low: Index, count: Index,
) -> None:  # fmt: skip
    """Write directions drawn to the weighted means of their neighbours."""
    for k in range(np.uint32(0), count):
        p = np.uint32(low + k)
        by = 1.0 / total[k]
        mx, my, mz = sx[k] * by, sy[k] * by, sz[k] * by
        ux, uy, uz = x[p], y[p], z[p]
        along = mx * ux + my * uy + mz * uz
        ux += FRACTION * (mx - along * ux)
        uy += FRACTION * (my - along * uy)
        uz += FRACTION * (mz - along * uz)
        over = 1.0 / math.sqrt(fma(ux, ux, fma(uy, uy, uz * uz)))
        tx[p], ty[p], tz[p] = over * ux, over * uy, over * uz


@inner
def drawn(
    mesh: Connectivity, scratch: Scratch, w: Floats, x: Floats, y: Floats, z: Floats,
    tx: Floats, ty: Floats, tz: Floats, first_run: int, last_run: int,
) -> None:  # fmt: skip
    """Draw the directions of the vertices of some runs once."""
    sx, sy, sz, total = scratch.rows[0], scratch.rows[1], scratch.rows[2], scratch.rows[3]
    ring = mesh.ring
    for run in range(first_run, last_run):
        low, last, degree, at = mesh.runs[run, 0], mesh.runs[run, 1], mesh.runs[run, 3], mesh.runs[run, 4]
        step = np.uint32(last - low)
        while low < last:
            count = min(np.uint32(BLOCK), np.uint32(last - low))
            odd = degree & np.uint32(1)
            if odd:
                gather_one(ring, w, x, y, z, sx, sy, sz, total, True, at, count)
            for j in range(odd, degree, np.uint32(2)):
                one = np.uint32(at + j * step)
                two = np.uint32(one + step)
                gather_two(
                    ring, w, x, y, z, sx, sy, sz, total, j == np.uint32(0), one, two, count
                )  # fmt: skip
            draw(x, y, z, sx, sy, sz, total, tx, ty, tz, low, count)
            low = np.uint32(low + count)
            at = np.uint32(at + count)


@entry
def unfold(  # noqa: PLR0912 - one entry, for each takes time to load
    mesh: Connectivity, use: Buffers, scratch: Scratch, areas: Floats, sums: Sums, centre: Vector,
    exponent: float, damping: float, greatest: float,
    smoothings: tuple[int, int], rounds: tuple[int, int], passes: int, span: Span,
) -> float:  # fmt: skip
    """Do one thread's part of what `spherify.geometry.unfolding.unfolded` does to ``use.position``.

    Args:
        mesh: of a closed surface.
        use: ``chosen[1]`` has log w, in and out; ``curvature`` the radii, ``altitude`` and ``chosen[0]`` in turn the
            levels, ``area`` the weights, ``position`` and ``moved`` in turn the directions.
        scratch: of the thread.
        areas: (m,) of the triangles.
        sums: what LOOK sums up, see `spherify.geometry.kernels.passes.directions.outcome`.
        centre: c.
        exponent: e.
        damping: share of the way the weights go.
        greatest: log w, for WEIGH; -inf if APPROACH is among the passes.
        smoothings: which of them: from the first to one before the last.
        rounds: likewise; the second of both is how many there are, if LEVEL, LOOK or BACK are among the passes.
        passes: DIRECT + …; all of them for one thread, one at a time for several.
        span: of the thread.

    Returns:
        the greatest log w after APPROACH.

    """
    x, y, z, radius = use.position[0], use.position[1], use.position[2], use.curvature
    mx, my, mz = use.moved[0], use.moved[1], use.moved[2]
    one, other, log_weights = use.altitude, use.chosen[0], use.chosen[1]
    first, last, m = span.first, span.last, np.uint32(areas.size)
    if passes & DIRECT:
        direct(x, y, z, radius, centre, first, last)
    if passes & AREAS:
        low = np.uint32(span.first_segment * SEGMENT)
        high = min(np.uint32(span.last_segment * SEGMENT), m)
        areas_of(x, y, z, mesh.corners[0], mesh.corners[1], mesh.corners[2], areas, low, high)
    if passes & LEVEL:
        level_of(mesh, areas, one, first, last)
    if passes & SMOOTH:
        for i in range(smoothings[0], smoothings[1]):
            if i % 2 == 0:
                smoothed(mesh, scratch, one, other, span.first_run, span.last_run)
            else:
                smoothed(mesh, scratch, other, one, span.first_run, span.last_run)
    if passes & APPROACH:
        level = one if smoothings[1] % 2 == 0 else other
        greatest = max(greatest, approach(log_weights, level, damping, exponent, first, last))
    if passes & WEIGH:
        weights_of(log_weights, greatest, use.area, first, last)
    if passes & DRAW:
        for i in range(rounds[0], rounds[1]):
            if i % 2 == 0:
                drawn(mesh, scratch, use.area, x, y, z, mx, my, mz, span.first_run, span.last_run)
            else:
                drawn(mesh, scratch, use.area, mx, my, mz, x, y, z, span.first_run, span.last_run)
    if passes & LOOK:
        if rounds[1] % 2 == 0:
            outcome(x, y, z, mesh.corners, sums, span)
        else:
            outcome(mx, my, mz, mesh.corners, sums, span)
    if passes & BACK:
        if rounds[1] % 2 == 0:
            back(x, y, z, radius, centre, first, last)
        else:
            back_from(mx, my, mz, x, y, z, radius, centre, first, last)
    return greatest
