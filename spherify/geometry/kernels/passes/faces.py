"""Faces: unit normals, areas, least altitudes."""

from __future__ import annotations

import math

import numpy as np

from spherify.geometry.kernels.passes.jit import inner
from spherify.geometry.kernels.passes.types import Floats, Index, Indices


@inner
def area_vectors(
    x: Floats, y: Floats, z: Floats, a: Indices, b: Indices, c: Indices,
    nx: Floats, ny: Floats, nz: Floats, low: Index, high: Index,
) -> None:  # fmt: skip
    """½ (b - a) × (c - a) of the faces ``low`` … ``high``."""
    for f in range(low, high):
        p, q, r = a[f], b[f], c[f]
        ux, uy, uz = x[q] - x[p], y[q] - y[p], z[q] - z[p]
        vx, vy, vz = x[r] - x[p], y[r] - y[p], z[r] - z[p]
        nx[f] = 0.5 * (uy * vz - uz * vy)
        ny[f] = 0.5 * (uz * vx - ux * vz)
        nz[f] = 0.5 * (ux * vy - uy * vx)


@inner
def longest_edges(
    x: Floats, y: Floats, z: Floats, a: Indices, b: Indices, c: Indices,
    squared: Floats, low: Index, high: Index,
) -> None:  # fmt: skip
    """Square of the longest edge of each face."""
    for f in range(low, high):
        p, q, r = a[f], b[f], c[f]
        ux, uy, uz = x[q] - x[p], y[q] - y[p], z[q] - z[p]
        vx, vy, vz = x[r] - x[q], y[r] - y[q], z[r] - z[q]
        wx, wy, wz = x[p] - x[r], y[p] - y[r], z[p] - z[r]
        u = ux * ux + uy * uy + uz * uz
        v = vx * vx + vy * vy + vz * vz
        w = wx * wx + wy * wy + wz * wz
        uv = u if u > v else v
        squared[f] = uv if uv > w else w


@inner
def normals_and_areas(nx: Floats, ny: Floats, nz: Floats, area: Floats, low: Index, high: Index) -> None:
    """Split area vectors into unit normals n_f and areas; the normal of a face without area is zero."""
    for f in range(low, high):
        length = math.sqrt(nx[f] * nx[f] + ny[f] * ny[f] + nz[f] * nz[f])
        scale = 1.0 / length if length != 0 else 0.0
        nx[f] *= scale
        ny[f] *= scale
        nz[f] *= scale
        area[f] = length


@inner
def altitudes(area: Floats, squared: Floats, low: Index, high: Index) -> None:
    """Turn squares of longest edges into least altitudes, 2·area / longest edge; 0 for a point."""
    for f in range(low, high):
        longest = squared[f]
        squared[f] = 2.0 * area[f] / math.sqrt(longest) if longest != 0 else 0.0


BLOCK = np.uint32(512)  # faces; what they write and read again fits the first-level cache


@inner
def face_pass(
    x: Floats, y: Floats, z: Floats, a: Indices, b: Indices, c: Indices,
    nx: Floats, ny: Floats, nz: Floats, area: Floats, altitude: Floats, bounded: bool,
) -> None:  # fmt: skip
    """Compute normals and areas of all faces; their least altitudes too if ``bounded``."""
    count = np.uint32(a.size)
    low = np.uint32(0)
    while low < count:
        high = min(np.uint32(low + BLOCK), count)
        area_vectors(x, y, z, a, b, c, nx, ny, nz, low, high)
        normals_and_areas(nx, ny, nz, area, low, high)
        if bounded:
            longest_edges(x, y, z, a, b, c, altitude, low, high)
            altitudes(area, altitude, low, high)
        low = high
