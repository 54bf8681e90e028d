"""The heart of a step: curvature K and normal n_p of every vertex, straight from the ring of its neighbours.

Once around a vertex p: d_j are the edge vectors to its neighbours in order, N_j = d_j × d_j+1 twice the area vectors of
its faces. Then everything follows without going back to memory:

    n_p  ∝ Σ N_j / |N_j|
    θ_j  = atan2(-|d_j| · (d_j-1 · N_j), N_j-1 · N_j), for N_j-1 × N_j = d_j (d_j-1 · N_j)

Faces and edges are computed anew at each of their vertices, three times and twice. Keeping them would take 84 gathers
a vertex; this takes 18, and calculates in vector registers. The loops go over the vertices of a run, which have as many
neighbours each (`Connectivity.runs`), a block at a time. For the commonest degrees the way around is one straight piece
of code, see `straight`, and the angles have loops of their own: each is short enough for the processor to work on
several rounds of it at once. For the others what goes from neighbour to neighbour lies in scratch rows.

Where the surface bends little over all edges of a block that go to neighbours of one place, as nearly everywhere on a
fine mesh, θ is the arcsine of a sine that the way around gives without a root or a cosine. What else is in a block
depends on the mesh alone, so that the bytes do not depend on the number of threads.

Blocks are computed in whole registers: beyond the end of a run numbers come out that nobody reads.
"""

from __future__ import annotations

import math

import numpy as np

from spherify.geometry.kernels.passes.arithmetic import (
    SLIGHT,
    angle_over,
    bits_of,
    fma,
    from_bits,
    inverse_root,
    over_sine,
)
from spherify.geometry.kernels.passes.jit import inner
from spherify.geometry.kernels.passes.straight import (
    BLOCK,
    FEWEST,
    LANES,
    MOST,
    Lane,
    lower,
    straight,
)
from spherify.geometry.kernels.passes.types import DUAL_AREA, VTK, Floats, Index, Indices
from spherify.geometry.kernels.passes.vectors import cross, dot, longer, sized

STRIDE = (
    BLOCK + LANES
)  # rows that do not begin at equal places within a page, where loads would wait for stores
ROWS = 31
ANGLES = MOST * BLOCK + LANES
ANGLE_ROWS = 7
FLAT = 2e-6  # |N| over the square of the longest edge below which a corner's normal may be lost to rounding
# Two unit normals in a row that look against each other, but for a slight angle, shorten the sum of all by this.
FOLDED = 2 - 2 * math.sin(math.asin(math.sqrt(SLIGHT)) / 2)


@inner
def begin(
    ring: Indices, x: Floats, y: Floats, z: Floats,
    ex: Floats, ey: Floats, ez: Floats, dx: Floats, dy: Floats, dz: Floats, dd: Floats,
    nx: Floats, ny: Floats, nz: Floats, size: Floats,
    sx: Floats, sy: Floats, sz: Floats, areas: Floats, least_over: Floats, least_under: Floats,
    smallest: Floats, longest: Floats, volume: Floats, lengths: Floats,
    low: Lane, wide: Lane, last: Lane, first: Lane,
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
        sx[k], sy[k], sz[k], areas[k] = 0.0, 0.0, 0.0, 0.0
        least_over[k], least_under[k] = np.inf, 1.0
        smallest[k], longest[k], volume[k], lengths[k] = np.inf, 0.0, 0.0, 0.0


@inner
def turn(
    ring: Indices, x: Floats, y: Floats, z: Floats,
    ex: Floats, ey: Floats, ez: Floats, dx: Floats, dy: Floats, dz: Floats, dd: Floats,
    nx: Floats, ny: Floats, nz: Floats, size: Floats,
    sx: Floats, sy: Floats, sz: Floats, areas: Floats, least_over: Floats, least_under: Floats,
    smallest: Floats, longest: Floats, volume: Floats, lengths: Floats, K: Floats,
    by_area: bool, low: Lane, wide: Lane, following: Lane,
) -> None:  # fmt: skip
    """Go on by one neighbour: over the edge d into the face between d and the vector f to the one following."""
    for k in range(Lane(0), wide):
        v = low + k
        q = ring[following + k]
        p = (x[v], y[v], z[v])
        e, d, a = (ex[k], ey[k], ez[k]), (dx[k], dy[k], dz[k]), (nx[k], ny[k], nz[k])
        f = (x[q] - p[0], y[q] - p[1], z[q] - p[2])
        ff = dot(f, f)
        b = cross(d, f)
        mm, scale, size_b = sized(b)
        length = math.sqrt(dd[k])
        angle, inverse = angle_over(-length * dot(e, b), dot(a, b), size[k] + size_b)
        value = length * angle
        K[k] += value * inverse if by_area else value
        least_over[k], least_under[k] = lower(d, f, mm, least_over[k], least_under[k])
        sx[k], sy[k], sz[k] = longer((sx[k], sy[k], sz[k]), b, scale)
        areas[k] += size_b
        volume[k] += dot(p, b)
        lengths[k] += length
        smallest[k] = size_b if size_b < smallest[k] else smallest[k]
        longest[k] = ff if ff > longest[k] else longest[k]
        ex[k], ey[k], ez[k] = d
        dx[k], dy[k], dz[k] = f
        nx[k], ny[k], nz[k] = b
        dd[k], size[k] = ff, size_b


@inner
def any_folded(sx: Floats, sy: Floats, sz: Floats, degree: Lane, count: Lane) -> bool:
    """Whether two faces in a row may look against each other at a vertex of the block, of so many neighbours each."""
    least = (float(degree) - FOLDED) ** 2
    found = np.int64(0)
    for k in range(Lane(0), count):
        n = (sx[k], sy[k], sz[k])
        found |= np.int64(0) if dot(n, n) > least else np.int64(1)
    return bool(found != 0)


@inner
def all_slight(squared: Floats, at: Lane, count: Lane) -> bool:
    """Whether the surface bends little over these edges, unless it is folded.

    Bits of what is not negative are in the order of the numbers, and the greatest of integers vectorises.
    """
    most = np.int64(0)
    for k in range(Lane(0), count):
        bits = bits_of(squared[at + k])
        most = bits if bits > most else most
    return from_bits(most) <= SLIGHT


@inner
def bend_slightly(
    sine: Floats, squared: Floats, size: Floats, K: Floats, by_area: bool, at: Lane, before: Lane, wide: Lane
) -> None:
    """Add l·θ of an edge each, where `all_slight`, over the |N| of its faces if ``by_area``."""
    for k in range(Lane(0), wide):
        j = at + k
        value = sine[j] / (size[before + k] + size[j]) if by_area else sine[j]
        K[k] = fma(-value, over_sine(squared[j]), K[k])


@inner
def bend(
    sine: Floats, edge: Floats, nx: Floats, ny: Floats, nz: Floats, size: Floats,
    K: Floats, by_area: bool, at: Lane, before: Lane, wide: Lane,
) -> None:  # fmt: skip
    """Do the same whatever the angles: tan θ = -(e · N_b) |d| / (N_a · N_b)."""
    for k in range(Lane(0), wide):
        i, j = before + k, at + k
        length = math.sqrt(edge[j])
        cosine = length * dot((nx[i], ny[i], nz[i]), (nx[j], ny[j], nz[j]))
        angle, inverse = angle_over(-sine[j] * (size[i] * size[j]), cosine, size[i] + size[j])
        value = length * angle
        K[k] += value * inverse if by_area else value


@inner
def end(
    sx: Floats, sy: Floats, sz: Floats, sum_K: Floats, areas: Floats, least_over: Floats, least_under: Floats,
    K: Floats, px: Floats, py: Floats, pz: Floats, area: Floats, altitude: Floats,
    scale: float, dual: bool, full: bool, measured: bool, low: Lane, count: Lane,
) -> None:  # fmt: skip
    """Write K and n_p of each vertex, and what else is wanted; ``areas`` are twice the areas."""
    for k in range(Lane(0), count):
        p = low + k
        n = (sx[k], sy[k], sz[k])
        by = inverse_root(dot(n, n))
        px[p], py[p], pz[p] = sx[k] * by, sy[k] * by, sz[k] * by
        K[p] = 1.5 * sum_K[k] / areas[k] if dual else scale * sum_K[k]
    if full or measured:
        for k in range(Lane(0), count):
            area[low + k] = 0.5 * areas[k]
    if full:
        for k in range(Lane(0), count):
            altitude[low + k] = math.sqrt(least_over[k] / least_under[k])


@inner
def is_flat(smallest: float, longest: float) -> bool:
    """Whether a face of that |N| may have lost its normal to rounding beside an edge of that square."""
    return not smallest > FLAT * longest


@inner
def any_flat(smallest: Floats, longest: Floats, count: Index) -> bool:
    """Whether a vertex of the block has a face that is flat to rounding."""
    found = np.int64(0)
    for k in range(np.uint32(0), count):
        found |= np.int64(1) if is_flat(smallest[k], longest[k]) else np.int64(0)
    return bool(found != 0)


@inner
def ring_block(
    ring: Indices, x: Floats, y: Floats, z: Floats,
    K: Floats, px: Floats, py: Floats, pz: Floats, area: Floats, altitude: Floats,
    sx: Floats, sy: Floats, sz: Floats, areas: Floats, least_over: Floats, least_under: Floats,
    smallest: Floats, longest: Floats, volume: Floats, lengths: Floats, sum_K: Floats,
    ex: Floats, ey: Floats, ez: Floats, dx: Floats, dy: Floats, dz: Floats, dd: Floats,
    nx: Floats, ny: Floats, nz: Floats, size: Floats,
    sine: Floats, squared: Floats, edge: Floats, ax: Floats, ay: Floats, az: Floats, sizes: Floats,
    measure: int, full: bool, measured: bool, low: Lane, count: Lane, degree: Lane, at: Lane, step: Lane,
) -> None:  # fmt: skip
    """Compute a block of at most BLOCK vertices of the same degree.

    Their neighbours of place j lie at ``ring[at + j·step]`` and behind. The rows are given one by one: taking them
    from an array, for each block, costs more than adding up its angles. ``full``: with areas and altitudes;
    ``measured``, unless ``full``: with areas, ``volume``, Σ p · N_j, and ``lengths``, Σ |d_j|.
    """
    wide = (count + Lane(LANES - 1)) // Lane(LANES) * Lane(LANES)
    for k in range(Lane(0), wide):
        sum_K[k] = 0.0
    if Lane(FEWEST) <= degree <= Lane(MOST):
        straight(
            ring, x, y, z, sx, sy, sz, areas, least_over, least_under, smallest, longest, volume, lengths,
            sine, squared, edge, ax, ay, az, sizes, low, wide, at, step, degree, full, measured,
        )  # fmt: skip
        folded = any_folded(sx, sy, sz, degree, count)
        before = (degree - Lane(1)) * Lane(BLOCK)
        for j in range(Lane(0), degree):
            here = j * Lane(BLOCK)
            if not folded and all_slight(squared, here, count):
                bend_slightly(sine, squared, sizes, sum_K, measure == VTK, here, before, wide)
            else:
                bend(sine, edge, ax, ay, az, sizes, sum_K, measure == VTK, here, before, wide)
            before = here
    else:
        begin(
            ring, x, y, z, ex, ey, ez, dx, dy, dz, dd, nx, ny, nz, size,
            sx, sy, sz, areas, least_over, least_under, smallest, longest, volume, lengths,
            low, wide, at + (degree - Lane(1)) * step, at,
        )  # fmt: skip
        for j in range(Lane(1), degree + Lane(1)):
            turn(
                ring, x, y, z, ex, ey, ez, dx, dy, dz, dd, nx, ny, nz, size,
                sx, sy, sz, areas, least_over, least_under, smallest, longest, volume, lengths, sum_K,
                measure == VTK, low, wide, at if j == degree else at + j * step,
            )  # fmt: skip
    scale = (3.0 if measure == VTK else 1.0) / degree
    end(
        sx, sy, sz, sum_K, areas, least_over, least_under, K, px, py, pz, area, altitude,
        scale, measure == DUAL_AREA, full, measured, low, count,
    )  # fmt: skip
