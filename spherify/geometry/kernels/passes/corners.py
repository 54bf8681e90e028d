"""One vertex face by face, just as the reference does: for those that the rings cannot serve.

These are vertices on a boundary, vertices where several fans of faces meet, and vertices of a face without area,
whose normal is rounding and nothing else: to be the reference's, it has to come from the same corner of the face.
"""

from __future__ import annotations

import math

import numpy as np

from spherify.geometry.kernels.passes.jit import inner
from spherify.geometry.kernels.passes.types import DUAL_AREA, NONE, VTK, Floats, Index, Indices
from spherify.geometry.measures import ROUNDED


@inner
def face(
    x: Floats, y: Floats, z: Floats, corners: Indices, f: Index
) -> tuple[float, float, float, float, float]:
    """Return unit normal, area and least altitude of a face; zero where there is none."""
    a, b, c = corners[0, f], corners[1, f], corners[2, f]
    ux, uy, uz = x[b] - x[a], y[b] - y[a], z[b] - z[a]
    vx, vy, vz = x[c] - x[a], y[c] - y[a], z[c] - z[a]
    wx, wy, wz = x[c] - x[b], y[c] - y[b], z[c] - z[b]
    nx, ny, nz = 0.5 * (uy * vz - uz * vy), 0.5 * (uz * vx - ux * vz), 0.5 * (ux * vy - uy * vx)
    area = math.sqrt(nx * nx + ny * ny + nz * nz)
    longest = max(
        math.sqrt(ux * ux + uy * uy + uz * uz),
        math.sqrt(vx * vx + vy * vy + vz * vz),
        math.sqrt(wx * wx + wy * wy + wz * wz),
    )
    altitude = 2.0 * area / longest if longest != 0 else 0.0
    if area != 0:
        return nx / area, ny / area, nz / area, area, altitude
    return 0.0 * nx, 0.0 * ny, 0.0 * nz, area, altitude


@inner
def vertex(
    x: Floats, y: Floats, z: Floats, corners: Indices, halfedges: Indices, twins: Indices,
    first: Index, last: Index, measure: int,
    K: Floats, px: Floats, py: Floats, pz: Floats, areas: Floats, altitudes: Floats, p: Index,
) -> None:  # fmt: skip
    """Write K, n_p, area and least altitude of vertex p, from which the half-edges ``first`` … ``last`` start."""
    three = np.uint32(3)
    sx, sy, sz, area, least = 0.0, 0.0, 0.0, 0.0, np.inf
    total, count = 0.0, 0
    for s in range(first, last):
        h = halfedges[s]
        f, k = h // three, h % three
        nx, ny, nz, size, altitude = face(x, y, z, corners, f)
        sx, sy, sz, area = sx + nx, sy + ny, sz + nz, area + size
        least = least if least <= altitude else altitude
        if twins[h] == NONE:
            continue
        q = corners[(k + np.uint32(1)) % three, f]
        gx, gy, gz, other, _ = face(x, y, z, corners, twins[h] // three)
        ex, ey, ez = x[q] - x[p], y[q] - y[p], z[q] - z[p]
        length = math.sqrt(ex * ex + ey * ey + ez * ez)
        sine = (ny * gz - nz * gy) * ex + (nz * gx - nx * gz) * ey + (nx * gy - ny * gx) * ez
        cosine = (nx * gx + ny * gy + nz * gz) * length + 0.0
        if cosine < 0 and abs(sine) <= ROUNDED * length:
            sine = 0.0
        value = length * math.atan2(sine, cosine)
        if measure == VTK:
            value = 1.5 * value / (size + other) if size + other != 0 else 0.0
        total += value
        count += 1
    norm = math.sqrt(sx * sx + sy * sy + sz * sz)
    by = 0.0 if norm <= ROUNDED else 1.0 / norm
    px[p], py[p], pz[p] = sx * by, sy * by, sz * by
    areas[p], altitudes[p] = area, least
    if measure == DUAL_AREA:
        K[p] = 0.25 * total / (area / 3.0) if area != 0 else 0.0
    else:
        K[p] = total / max(count, 1)
