"""The heart of a step: curvature K and normal n_p of every vertex, straight from the ring of its neighbours.

Once around a vertex p: d_j are the edge vectors to its neighbours in order, N_j = d_j × d_j+1 twice the area vectors of
its faces. Then everything follows without going back to memory:

    n_p  ∝ Σ N_j / |N_j|
    θ_j  = atan2(-|d_j| · (d_j-1 · N_j), N_j-1 · N_j), for N_j-1 × N_j = d_j (d_j-1 · N_j)

Faces and edges are computed anew at each of their vertices, three times and twice. Keeping them would take 84 gathers
a vertex; this takes 18, and calculates in vector registers. The loops go over the vertices of a run, which have as many
neighbours each (`Connectivity.runs`), a block at a time. For the commonest degrees the way around is one straight piece
of code, see `straight`; for the others what goes from neighbour to neighbour lies in scratch rows. The angles have
loops of their own: each is short enough for the processor to work on several rounds of it at once.

Blocks are computed in whole registers: beyond the end of a run numbers come out that nobody reads.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from spherify.geometry.kernels.passes.arithmetic import (
    angle_over,
    inverse_root,
    is_slight,
    slight_angle_over,
)
from spherify.geometry.kernels.passes.jit import inner
from spherify.geometry.kernels.passes.straight import (
    BLOCK,
    FEWEST,
    LANES,
    MOST,
    Lane,
    is_flat,
    lower,
    over,
    straight,
)
from spherify.geometry.kernels.passes.types import DUAL_AREA, VTK, Floats, Index, Indices
from spherify.geometry.kernels.passes.vectors import cross, dot, longer, sized

STRIDE = (
    BLOCK + LANES
)  # rows that do not begin at equal places within a page, where loads would wait for stores
ROWS = 29
ANGLES = MOST * BLOCK + LANES


@inner
def begin(
    ring: Indices, x: Floats, y: Floats, z: Floats,
    ex: Floats, ey: Floats, ez: Floats, dx: Floats, dy: Floats, dz: Floats, dd: Floats,
    nx: Floats, ny: Floats, nz: Floats, size: Floats,
    sx: Floats, sy: Floats, sz: Floats, areas: Floats, least_over: Floats, least_under: Floats,
    flat: NDArray[np.int64], low: Lane, wide: Lane, last: Lane, first: Lane,
) -> None:  # fmt: skip
    """Start at the last and the first neighbour: e = d_-1, d = d_0, N = e × d, and all sums 0."""
    for k in range(Lane(0), wide):
        p = low + k
        q = ring[last + k]
        e = (x[q] - x[p], y[q] - y[p], z[q] - z[p])
        q = ring[first + k]
        d = (x[q] - x[p], y[q] - y[p], z[q] - z[p])
        ex[k], ey[k], ez[k] = e
        dx[k], dy[k], dz[k] = d
        dd[k] = dot(d, d)
        a = cross(e, d)
        nx[k], ny[k], nz[k] = a
        _, _, size[k] = sized(a)
        sx[k], sy[k], sz[k], areas[k], flat[k] = 0.0, 0.0, 0.0, 0.0, 0
        least_over[k], least_under[k] = np.inf, 1.0


@inner
def turn(
    ring: Indices, x: Floats, y: Floats, z: Floats,
    ex: Floats, ey: Floats, ez: Floats, dx: Floats, dy: Floats, dz: Floats, dd: Floats,
    nx: Floats, ny: Floats, nz: Floats, size: Floats,
    sx: Floats, sy: Floats, sz: Floats, areas: Floats, least_over: Floats, least_under: Floats,
    flat: NDArray[np.int64], sine: Floats, cosine: Floats, both: Floats, length: Floats,
    low: Lane, wide: Lane, following: Lane,
) -> None:  # fmt: skip
    """Go on by one neighbour: over the edge d into the face between d and the vector f to the one following."""
    for k in range(Lane(0), wide):
        p = low + k
        q = ring[following + k]
        e, d, a = (ex[k], ey[k], ez[k]), (dx[k], dy[k], dz[k]), (nx[k], ny[k], nz[k])
        f = (x[q] - x[p], y[q] - y[p], z[q] - z[p])
        ff = dot(f, f)
        b = cross(d, f)
        mm, scale, size_b = sized(b)
        sine[k], cosine[k], both[k], length[k] = over(e, d, dd[k], a, size[k], b, size_b)
        least_over[k], least_under[k] = lower(d, f, mm, least_over[k], least_under[k])
        sx[k], sy[k], sz[k] = longer((sx[k], sy[k], sz[k]), b, scale)
        areas[k] += size_b
        flat[k] |= is_flat(size_b, dd[k], ff)
        ex[k], ey[k], ez[k] = d
        dx[k], dy[k], dz[k] = f
        nx[k], ny[k], nz[k] = b
        dd[k], size[k] = ff, size_b


@inner
def all_slight(sine: Floats, cosine: Floats, at: Lane, count: Lane) -> bool:
    """Whether the surface bends little over these edges, as nearly everywhere on a fine mesh."""
    others = np.int64(0)
    for k in range(Lane(0), count):
        others |= np.int64(0) if is_slight(sine[at + k], cosine[at + k]) else np.int64(1)
    return bool(others == 0)


@inner
def bend(
    sine: Floats, cosine: Floats, both: Floats, length: Floats, K: Floats, by_area: bool,
    at: Lane, count: Lane, wide: Lane,
) -> None:  # fmt: skip
    """Add l·θ of an edge each, over the |N| of its faces if ``by_area``; the same bits either way."""
    if all_slight(sine, cosine, at, count):
        for k in range(Lane(0), wide):
            j = at + k
            angle, inverse = slight_angle_over(sine[j], cosine[j], both[j])
            value = length[j] * angle
            K[k] += value * inverse if by_area else value
    else:
        for k in range(Lane(0), wide):
            j = at + k
            angle, inverse = angle_over(sine[j], cosine[j], both[j])
            value = length[j] * angle
            K[k] += value * inverse if by_area else value


@inner
def end(
    sx: Floats, sy: Floats, sz: Floats, sum_K: Floats, areas: Floats, least_over: Floats, least_under: Floats,
    K: Floats, px: Floats, py: Floats, pz: Floats, area: Floats, altitude: Floats,
    scale: float, dual: bool, bounded: bool, low: Lane, count: Lane,
) -> None:  # fmt: skip
    """Write K, n_p, the area and the least altitude of each vertex; ``areas`` are twice the areas."""
    for k in range(Lane(0), count):
        p = low + k
        n = (sx[k], sy[k], sz[k])
        by = inverse_root(dot(n, n))
        px[p], py[p], pz[p] = sx[k] * by, sy[k] * by, sz[k] * by
        K[p] = 1.5 * sum_K[k] / areas[k] if dual else scale * sum_K[k]
        area[p] = 0.5 * areas[k]
    if bounded:
        for k in range(Lane(0), count):
            altitude[low + k] = math.sqrt(least_over[k] / least_under[k])


@inner
def add_volumes(
    x: Floats, y: Floats, z: Floats, nx: Floats, ny: Floats, nz: Floats, volume: Floats, low: Lane, wide: Lane
) -> None:  # fmt: skip
    """Add p · N of a face each."""
    for k in range(Lane(0), wide):
        p = low + k
        volume[k] += dot((x[p], y[p], z[p]), (nx[k], ny[k], nz[k]))


@inner
def add_lengths(length: Floats, lengths: Floats, at: Lane, wide: Lane) -> None:
    """Add the length of an edge each."""
    for k in range(Lane(0), wide):
        lengths[k] += length[at + k]


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
    sx: Floats, sy: Floats, sz: Floats, areas: Floats, least_over: Floats, least_under: Floats, sum_K: Floats,
    ex: Floats, ey: Floats, ez: Floats, dx: Floats, dy: Floats, dz: Floats, dd: Floats,
    nx: Floats, ny: Floats, nz: Floats, size: Floats, volume: Floats, lengths: Floats,
    flat: NDArray[np.int64], sine: Floats, cosine: Floats, both: Floats, length: Floats,
    measure: int, bounded: bool, measured: bool, low: Lane, count: Lane, degree: Lane, at: Lane, step: Lane,
) -> None:  # fmt: skip
    """Compute a block of at most BLOCK vertices of the same degree.

    Their neighbours of place j lie at ``ring[at + j·step]`` and behind. The rows are given one by one: taking them
    from an array, for each block, costs more than adding up its angles. ``measured``, unless ``bounded``: fill also
    ``volume``, Σ p · N_j, and ``lengths``, Σ |d_j|.
    """
    wide = (count + Lane(LANES - 1)) // Lane(LANES) * Lane(LANES)
    for k in range(Lane(0), wide):
        sum_K[k] = 0.0
    if measured:
        for k in range(Lane(0), wide):
            volume[k], lengths[k] = 0.0, 0.0
    if Lane(FEWEST) <= degree <= Lane(MOST):
        straight(
            ring, x, y, z, sx, sy, sz, areas, least_over, least_under, volume, flat, sine, cosine, both, length,
            low, wide, at, step, degree, bounded, measured,
        )  # fmt: skip
        for j in range(Lane(0), degree):
            bend(sine, cosine, both, length, sum_K, measure == VTK, j * Lane(BLOCK), count, wide)
            if measured:
                add_lengths(length, lengths, j * Lane(BLOCK), wide)
    else:
        begin(
            ring, x, y, z, ex, ey, ez, dx, dy, dz, dd, nx, ny, nz, size,
            sx, sy, sz, areas, least_over, least_under, flat, low, wide, at + (degree - Lane(1)) * step, at,
        )  # fmt: skip
        for j in range(Lane(1), degree + Lane(1)):
            turn(
                ring, x, y, z, ex, ey, ez, dx, dy, dz, dd, nx, ny, nz, size,
                sx, sy, sz, areas, least_over, least_under, flat, sine, cosine, both, length,
                low, wide, at if j == degree else at + j * step,
            )  # fmt: skip
            bend(sine, cosine, both, length, sum_K, measure == VTK, Lane(0), count, wide)
            if measured:
                add_volumes(x, y, z, nx, ny, nz, volume, low, wide)
                add_lengths(length, lengths, Lane(0), wide)
    scale = (3.0 if measure == VTK else 1.0) / degree
    end(
        sx, sy, sz, sum_K, areas, least_over, least_under, K, px, py, pz, area, altitude,
        scale, measure == DUAL_AREA, bounded, low, count,
    )  # fmt: skip
