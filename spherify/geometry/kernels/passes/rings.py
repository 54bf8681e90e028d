"""The heart of a step: curvature K and normal n_p of every vertex, straight from the ring of its neighbours.

Once around a vertex p: d_j are the edge vectors to its neighbours in order, N_j = d_j × d_j+1 twice the area vectors of
its faces. Then everything follows without going back to memory:

    n_p  ∝ Σ N_j / |N_j|
    θ_j  = atan2(-|d_j| · (d_j-1 · N_j), N_j-1 · N_j), for N_j-1 × N_j = d_j (d_j-1 · N_j)

Faces and edges are computed anew at each of their vertices, three times and twice. Keeping them would take 84 gathers
a vertex, which is what a step's time went into; this takes 21, and calculates in vector registers. The inner loops go
over the vertices of a run, which have as many neighbours each (`Connectivity.runs`), a block at a time; what goes
from neighbour to neighbour lies in scratch rows that stay in the first-level cache. Computing the vectors and
computing the angles are two loops: each is short enough for the processor to work on several rounds of it at once.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from spherify.geometry.kernels.passes.arithmetic import angle_over, fma, inverse_root
from spherify.geometry.kernels.passes.jit import inner
from spherify.geometry.kernels.passes.types import DUAL_AREA, VTK, Floats, Index, Indices

BLOCK = 128  # vertices; the scratch of one block fits the first-level cache
STRIDE = (
    BLOCK + 8
)  # its rows do not begin at equal places within a page, which would make loads wait for stores
ROWS = 25
FLAT = 1e-12  # square of the sine of an angle below which a corner's normal is lost to rounding


@inner
def begin(
    ring: Indices, x: Floats, y: Floats, z: Floats,
    ex: Floats, ey: Floats, ez: Floats, dx: Floats, dy: Floats, dz: Floats, dd: Floats,
    nx: Floats, ny: Floats, nz: Floats, area: Floats,
    sx: Floats, sy: Floats, sz: Floats, K: Floats, areas: Floats, flat: NDArray[np.int64],
    low: Index, count: Index, last: Index, first: Index,
) -> None:  # fmt: skip
    """Start at the last and the first neighbour: e = d_-1, d = d_0, N = e × d, and all sums 0."""
    for k in range(np.uint32(0), count):
        p = np.uint32(low + k)
        q = ring[np.uint32(last + k)]
        ax, ay, az = x[q] - x[p], y[q] - y[p], z[q] - z[p]
        q = ring[np.uint32(first + k)]
        bx, by, bz = x[q] - x[p], y[q] - y[p], z[q] - z[p]
        mx, my, mz = fma(ay, bz, -(az * by)), fma(az, bx, -(ax * bz)), fma(ax, by, -(ay * bx))
        mm = fma(mx, mx, fma(my, my, mz * mz))
        ex[k], ey[k], ez[k] = ax, ay, az
        dx[k], dy[k], dz[k], dd[k] = bx, by, bz, fma(bx, bx, fma(by, by, bz * bz))
        nx[k], ny[k], nz[k], area[k] = mx, my, mz, mm * inverse_root(mm)
        sx[k], sy[k], sz[k], K[k], areas[k], flat[k] = 0.0, 0.0, 0.0, 0.0, 0.0, 0


@inner
def turn(
    ring: Indices, x: Floats, y: Floats, z: Floats,
    ex: Floats, ey: Floats, ez: Floats, dx: Floats, dy: Floats, dz: Floats, dd: Floats,
    nx: Floats, ny: Floats, nz: Floats, area: Floats,
    sx: Floats, sy: Floats, sz: Floats, areas: Floats, flat: NDArray[np.int64],
    sine: Floats, cosine: Floats, both: Floats, length: Floats,
    low: Index, count: Index, following: Index,
) -> None:  # fmt: skip
    """Go on by one neighbour: over the edge d into the face between d and the vector f to the one following.

    Leaves sine and cosine of the edge's dihedral angle, |N| + |N'| of its faces, and its length.
    """
    for k in range(np.uint32(0), count):
        p = np.uint32(low + k)
        q = ring[np.uint32(following + k)]
        fx, fy, fz = x[q] - x[p], y[q] - y[p], z[q] - z[p]
        cx, cy, cz, cc = dx[k], dy[k], dz[k], dd[k]
        mx, my, mz = fma(cy, fz, -(cz * fy)), fma(cz, fx, -(cx * fz)), fma(cx, fy, -(cy * fx))
        mm = fma(mx, mx, fma(my, my, mz * mz))
        ff = fma(fx, fx, fma(fy, fy, fz * fz))
        scale = inverse_root(mm)
        size = mm * scale
        sx[k], sy[k], sz[k] = fma(mx, scale, sx[k]), fma(my, scale, sy[k]), fma(mz, scale, sz[k])
        areas[k] += size
        edge = math.sqrt(cc)
        sine[k] = -edge * fma(ex[k], mx, fma(ey[k], my, ez[k] * mz))
        cosine[k] = fma(nx[k], mx, fma(ny[k], my, nz[k] * mz))
        both[k] = area[k] + size
        length[k] = edge
        widest = cc + ff
        flat[k] |= np.int64(0) if mm > FLAT * (widest * widest) else np.int64(1)
        ex[k], ey[k], ez[k] = cx, cy, cz
        dx[k], dy[k], dz[k], dd[k] = fx, fy, fz, ff
        nx[k], ny[k], nz[k], area[k] = mx, my, mz, size


@inner
def bend(
    sine: Floats, cosine: Floats, both: Floats, length: Floats, K: Floats, by_area: bool, count: Index
) -> None:
    """Add l·θ of an edge each, over the |N| of its faces if ``by_area``."""
    for k in range(np.uint32(0), count):
        angle, inverse = angle_over(sine[k], cosine[k], both[k])
        value = length[k] * angle
        K[k] += value * inverse if by_area else value


@inner
def lower(
    ex: Floats, ey: Floats, ez: Floats, dx: Floats, dy: Floats, dz: Floats, dd: Floats,
    nx: Floats, ny: Floats, nz: Floats, least_over: Floats, least_under: Floats, first: bool, count: Index,
) -> None:  # fmt: skip
    """Keep the least altitude of the faces so far, as a fraction of squares: |N|² over the longest edge's."""
    for k in range(np.uint32(0), count):
        gx, gy, gz = dx[k] - ex[k], dy[k] - ey[k], dz[k] - ez[k]
        g = fma(gx, gx, fma(gy, gy, gz * gz))
        e = fma(ex[k], ex[k], fma(ey[k], ey[k], ez[k] * ez[k]))
        longest = e if e > g else g
        longest = longest if longest > dd[k] else dd[k]
        mm = fma(nx[k], nx[k], fma(ny[k], ny[k], nz[k] * nz[k]))
        less = first or mm * least_under[k] < least_over[k] * longest
        least_over[k] = mm if less else least_over[k]
        least_under[k] = longest if less else least_under[k]


@inner
def end(
    sx: Floats, sy: Floats, sz: Floats, sum_K: Floats, areas: Floats, least_over: Floats, least_under: Floats,
    K: Floats, px: Floats, py: Floats, pz: Floats, area: Floats, altitude: Floats,
    scale: float, dual: bool, bounded: bool, low: Index, count: Index,
) -> None:  # fmt: skip
    """Write K, n_p, the area and the least altitude of each vertex; ``areas`` are twice the areas."""
    for k in range(np.uint32(0), count):
        p = np.uint32(low + k)
        by = inverse_root(fma(sx[k], sx[k], fma(sy[k], sy[k], sz[k] * sz[k])))
        px[p], py[p], pz[p] = sx[k] * by, sy[k] * by, sz[k] * by
        K[p] = 1.5 * sum_K[k] / areas[k] if dual else scale * sum_K[k]
        area[p] = 0.5 * areas[k]
    if bounded:
        for k in range(np.uint32(0), count):
            altitude[np.uint32(low + k)] = math.sqrt(least_over[k] / least_under[k])


@inner
def any_flat(flat: NDArray[np.int64], count: Index) -> bool:
    """Whether a vertex of the block has a face that is flat to rounding."""
    found = np.int64(0)
    for k in range(np.uint32(0), count):
        found |= flat[k]
    return bool(found != 0)


@inner
def ring_block(
    ring: Indices, x: Floats, y: Floats, z: Floats,
    K: Floats, px: Floats, py: Floats, pz: Floats, area: Floats, altitude: Floats,
    scratch: Floats, flat: NDArray[np.int64],
    measure: int, bounded: bool, low: Index, count: Index, degree: Index, at: Index, step: Index,
) -> None:  # fmt: skip
    """Compute a block of at most BLOCK vertices of the same degree.

    Their neighbours of place j lie at ``ring[at + j·step]`` and behind.
    """
    ex, ey, ez, dx, dy, dz, dd = (
        scratch[0], scratch[1], scratch[2], scratch[3], scratch[4], scratch[5], scratch[6],
    )  # fmt: skip
    nx, ny, nz, size = scratch[7], scratch[8], scratch[9], scratch[10]
    sx, sy, sz, sum_K, areas = scratch[11], scratch[12], scratch[13], scratch[14], scratch[15]
    sine, cosine, both, length = scratch[16], scratch[17], scratch[18], scratch[19]
    over, under = scratch[20], scratch[21]
    one = np.uint32(1)
    begin(
        ring, x, y, z, ex, ey, ez, dx, dy, dz, dd, nx, ny, nz, size, sx, sy, sz, sum_K, areas, flat,
        low, count, np.uint32(at + (degree - one) * step), at,
    )  # fmt: skip
    for j in range(one, np.uint32(degree + one)):
        following = at if j == degree else np.uint32(at + j * step)
        turn(
            ring, x, y, z, ex, ey, ez, dx, dy, dz, dd, nx, ny, nz, size, sx, sy, sz, areas, flat,
            sine, cosine, both, length, low, count, following,
        )  # fmt: skip
        bend(sine, cosine, both, length, sum_K, measure == VTK, count)
        if bounded:
            lower(ex, ey, ez, dx, dy, dz, dd, nx, ny, nz, over, under, j == one, count)
    scale = (3.0 if measure == VTK else 1.0) / degree
    end(
        sx, sy, sz, sum_K, areas, over, under, K, px, py, pz, area, altitude,
        scale, measure == DUAL_AREA, bounded, low, count,
    )  # fmt: skip
