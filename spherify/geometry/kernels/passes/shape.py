"""The surface as a whole: area, volume, centroid, radius variation.

Sums go by segments of faces, which are the same whoever adds them up: the bytes do not depend on the number of threads.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from spherify.geometry.kernels.passes.arithmetic import fma
from spherify.geometry.kernels.passes.jit import entry, inner
from spherify.geometry.kernels.passes.totals import total_of
from spherify.geometry.kernels.passes.types import CENTRE, INTEGRATE, RADII, VARIATION, Floats, Index, Indices
from spherify.geometry.kernels.passes.whole import centre, length, variation

BLOCK = 128  # faces; each of its places has sums of its own, so that none waits for another
SEGMENT = 64 * BLOCK
PER_FACE: Final = 6.0  # the weights, twice the area for each of the corners, over the area

MOMENTS: Final = 512  # a pass between RADII and VARIATION


@inner
def integrate(
    x: Floats, y: Floats, z: Floats, a: Indices, b: Indices, c: Indices, area: Floats,
    areas: Floats, volumes: Floats, mx: Floats, my: Floats, mz: Floats, edges: Floats, low: Index, high: Index,
) -> None:  # fmt: skip
    """Add a block to sums kept apart by place in the block: 2·area, 6·volume, 6·first moments, edge lengths."""
    for f in range(low, high):
        j = np.uint32(f - low)
        p, q, r = a[f], b[f], c[f]
        ax, ay, az = x[p], y[p], z[p]
        bx, by, bz = x[q], y[q], z[q]
        cx, cy, cz = x[r], y[r], z[r]
        ux, uy, uz = bx - ax, by - ay, bz - az
        vx, vy, vz = cx - ax, cy - ay, cz - az
        nx, ny, nz = fma(uy, vz, -(uz * vy)), fma(uz, vx, -(ux * vz)), fma(ux, vy, -(uy * vx))
        here = length(nx, ny, nz)
        area[f] = here
        areas[j] += here
        volumes[j] = fma(ax, nx, fma(ay, ny, fma(az, nz, volumes[j])))
        mx[j] = fma(here, ax + bx + cx, mx[j])
        my[j] = fma(here, ay + by + cy, my[j])
        mz[j] = fma(here, az + bz + cz, mz[j])
        edges[j] += length(ux, uy, uz) + length(vx, vy, vz) + length(cx - bx, cy - by, cz - bz)


@inner
def moments(
    a: Indices, b: Indices, c: Indices, area: Floats, radius: Floats, about: float,
    first: Floats, second: Floats, low: Index, high: Index,
) -> None:  # fmt: skip
    """Add Σ A (r - about) and Σ A (r - about)² of the corners of a block of faces, by place in the block."""
    for f in range(low, high):
        j = np.uint32(f - low)
        p, q, r = radius[a[f]] - about, radius[b[f]] - about, radius[c[f]] - about
        first[j] = fma(area[f], p + q + r, first[j])
        second[j] = fma(area[f], fma(p, p, fma(q, q, r * r)), second[j])


@inner
def distances(
    x: Floats, y: Floats, z: Floats, cx: float, cy: float, cz: float, radius: Floats, low: Index, high: Index
) -> None:
    """|p - c| of some vertices."""
    for p in range(low, high):
        radius[p] = length(x[p] - cx, y[p] - cy, z[p] - cz)


@inner
def vector_area(
    x: Floats, y: Floats, z: Floats, a: Indices, b: Indices, c: Indices
) -> tuple[float, float, float]:
    """Σ (b - a) × (c - a): zero on a closed mesh; an open one's volume depends on the origin by it."""
    sx, sy, sz = 0.0, 0.0, 0.0
    for f in range(np.uint32(0), np.uint32(a.size)):
        p, q, r = a[f], b[f], c[f]
        ux, uy, uz = x[q] - x[p], y[q] - y[p], z[q] - z[p]
        vx, vy, vz = x[r] - x[p], y[r] - y[p], z[r] - z[p]
        sx += uy * vz - uz * vy
        sy += uz * vx - ux * vz
        sz += ux * vy - uy * vx
    return sx, sy, sz


@entry
def measure(
    position: Floats, corners: Indices, area: Floats, radius: Floats, lanes: Floats, sums: Floats,
    result: Floats, closed: bool, passes: int, first_segment: int, last_segment: int, first: Index, last: Index,
) -> None:  # fmt: skip
    """Measure a surface, or do one thread's part of one pass of that.

    Args:
        position: (3, n).
        corners: (3, m).
        area: (m,) scratch.
        radius: (n,) scratch.
        lanes: (SUMS, BLOCK) scratch of the thread.
        sums: (segments, SUMS) scratch.
        result: (RESULTS,) out: area, volume, centroid, the lengths of all edges, once for each face at them, radius
            variation; and a radius.
        closed: whether the volume is the same from every origin.
        passes: INTEGRATE + …; all of them for one thread, one at a time for several.
        first_segment: of the part.
        last_segment: one behind the part.
        first: vertex of the part.
        last: one behind the part.

    """
    x, y, z = position[0], position[1], position[2]
    a, b, c = corners[0], corners[1], corners[2]
    n, m = np.uint32(x.size), np.uint32(a.size)
    for s in range(first_segment, last_segment):
        if passes & INTEGRATE:
            lanes[:6] = 0.0
            low, end = np.uint32(s * SEGMENT), min(np.uint32((s + 1) * SEGMENT), m)
            while low < end:
                high = min(np.uint32(low + np.uint32(BLOCK)), end)
                integrate(
                    x,
                    y,
                    z,
                    a,
                    b,
                    c,
                    area,
                    lanes[0],
                    lanes[1],
                    lanes[2],
                    lanes[3],
                    lanes[4],
                    lanes[5],
                    low,
                    high,
                )
                low = high
            for k in range(6):
                sums[s, k] = total_of(lanes[k])
            sums[s, 0] *= 3
    if passes & CENTRE:
        centre(position, sums, PER_FACE, result)
        if not closed:
            vx, vy, vz = vector_area(x, y, z, a, b, c)
            result[1] -= (result[2] * vx + result[3] * vy + result[4] * vz) / 6
    if passes & RADII:
        distances(x, y, z, result[2], result[3], result[4], radius, first, min(last, n))
    for s in range(first_segment, last_segment):
        if passes & MOMENTS:
            lanes[6:8] = 0.0
            low, end = np.uint32(s * SEGMENT), min(np.uint32((s + 1) * SEGMENT), m)
            while low < end:
                high = min(np.uint32(low + np.uint32(BLOCK)), end)
                moments(a, b, c, area, radius, result[7], lanes[6], lanes[7], low, high)
                low = high
            sums[s, 6], sums[s, 7] = total_of(lanes[6]), total_of(lanes[7])
    if passes & VARIATION:
        variation(sums, PER_FACE, result)
