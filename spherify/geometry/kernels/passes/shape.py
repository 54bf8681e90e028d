"""The surface as a whole: area, volume, centroid, radius variation."""

from __future__ import annotations

import math

import numpy as np

from spherify.geometry.kernels.passes.jit import entry, inner
from spherify.geometry.kernels.passes.types import Floats, Index, Indices

BLOCK = 512
ACCUMULATORS = 8


@inner
def integrate(
    x: Floats, y: Floats, z: Floats, a: Indices, b: Indices, c: Indices, area: Floats,
    areas: Floats, volumes: Floats, mx: Floats, my: Floats, mz: Floats, edges: Floats, low: Index, high: Index,
) -> None:  # fmt: skip
    """Add a block to sums kept apart by place in the block: area, 6·volume, 3·first moments, edge lengths."""
    for f in range(low, high):
        j = np.uint32(f - low)
        p, q, r = a[f], b[f], c[f]
        ax, ay, az = x[p], y[p], z[p]
        bx, by, bz = x[q], y[q], z[q]
        cx, cy, cz = x[r], y[r], z[r]
        ux, uy, uz = bx - ax, by - ay, bz - az
        vx, vy, vz = cx - ax, cy - ay, cz - az
        wx, wy, wz = cx - bx, cy - by, cz - bz
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        here = 0.5 * math.sqrt(nx * nx + ny * ny + nz * nz)
        area[f] = here
        areas[j] += here
        volumes[j] += ax * nx + ay * ny + az * nz
        mx[j] += here * (ax + bx + cx)
        my[j] += here * (ay + by + cy)
        mz[j] += here * (az + bz + cz)
        edges[j] += (
            math.sqrt(ux * ux + uy * uy + uz * uz)
            + math.sqrt(vx * vx + vy * vy + vz * vz)
            + math.sqrt(wx * wx + wy * wy + wz * wz)
        )


@inner
def vector_area(
    x: Floats, y: Floats, z: Floats, a: Indices, b: Indices, c: Indices
) -> tuple[float, float, float]:
    """Σ ½ (b - a) × (c - a): zero on a closed mesh; an open one's volume depends on the origin by it."""
    sx, sy, sz = 0.0, 0.0, 0.0
    for f in range(np.uint32(0), np.uint32(a.size)):
        p, q, r = a[f], b[f], c[f]
        ux, uy, uz = x[q] - x[p], y[q] - y[p], z[q] - z[p]
        vx, vy, vz = x[r] - x[p], y[r] - y[p], z[r] - z[p]
        sx += 0.5 * (uy * vz - uz * vy)
        sy += 0.5 * (uz * vx - ux * vz)
        sz += 0.5 * (ux * vy - uy * vx)
    return sx, sy, sz


@inner
def distances(x: Floats, y: Floats, z: Floats, cx: float, cy: float, cz: float, radius: Floats) -> None:
    """|p - c| of all vertices."""
    for p in range(np.uint32(0), np.uint32(x.size)):
        dx, dy, dz = x[p] - cx, y[p] - cy, z[p] - cz
        radius[p] = math.sqrt(dx * dx + dy * dy + dz * dz)


@inner
def moments(
    a: Indices, b: Indices, c: Indices, area: Floats, radius: Floats, about: float,
    first: Floats, second: Floats, low: Index, high: Index,
) -> None:  # fmt: skip
    """Add Σ A (r - about) and Σ A (r - about)² of the corners of a block of faces, by place in the block."""
    for f in range(low, high):
        j = np.uint32(f - low)
        p, q, r = radius[a[f]] - about, radius[b[f]] - about, radius[c[f]] - about
        first[j] += area[f] * (p + q + r)
        second[j] += area[f] * (p * p + q * q + r * r)


@entry
def measure(
    position: Floats, corners: Indices, area: Floats, radius: Floats, sums: Floats, closed: bool
) -> tuple[float, float, float, float, float, float, float]:
    """Area, volume, centroid, twice the length of all edges that have two faces, radius variation.

    Args:
        position: (3, n).
        corners: (3, m).
        area: (m,) scratch.
        radius: (n,) scratch.
        sums: (8, BLOCK) scratch.
        closed: whether the volume is the same from every origin.

    """
    x, y, z = position[0], position[1], position[2]
    a, b, c = corners[0], corners[1], corners[2]
    sums[:] = 0.0
    count = np.uint32(a.size)
    low = np.uint32(0)
    while low < count:
        high = min(np.uint32(low + BLOCK), count)
        integrate(
            x, y, z, a, b, c, area,
            sums[0], sums[1], sums[2], sums[3], sums[4], sums[5], low, high,
        )  # fmt: skip
        low = high
    whole, volume, edges = sums[0].sum(), sums[1].sum() / 6, sums[5].sum()
    if whole == 0:
        cx, cy, cz = x.mean(), y.mean(), z.mean()
    else:
        cx, cy, cz = sums[2].sum() / (3 * whole), sums[3].sum() / (3 * whole), sums[4].sum() / (3 * whole)
    if not closed:
        vx, vy, vz = vector_area(x, y, z, a, b, c)
        volume -= (cx * vx + cy * vy + cz * vz) / 3
    distances(x, y, z, cx, cy, cz, radius)
    if whole == 0:
        return whole, volume, cx, cy, cz, edges, np.inf
    # The variance about a value near the mean, less the square of what it is off by: no digits are lost.
    about = radius.mean()
    low = np.uint32(0)
    while low < count:
        high = min(np.uint32(low + BLOCK), count)
        moments(a, b, c, area, radius, about, sums[6], sums[7], low, high)
        low = high
    off = sums[6].sum() / (3 * whole)
    variance = sums[7].sum() / (3 * whole) - off * off
    variance = variance if variance > 0 else 0.0 * variance
    return whole, volume, cx, cy, cz, edges, math.sqrt(variance) / (about + off)
