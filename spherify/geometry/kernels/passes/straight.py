"""Once around vertices of the commonest degrees, each degree as one straight piece of code.

What goes from neighbour to neighbour stays in registers. Otherwise the same as `turn` of
`spherify.geometry.kernels.passes.rings`, which see; the pieces both are made of are here.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, TypeAlias

import numpy as np

from spherify.geometry.kernels.passes.jit import inner, pasted
from spherify.geometry.kernels.passes.types import Floats, Indices
from spherify.geometry.kernels.passes.vectors import Vector, cross, dot, longer, sized

LANES = 8  # numbers in the widest register
BLOCK = 64  # vertices; the scratch of one block fits the first-level cache
FEWEST, MOST = 4, 8  # neighbours for which there is code of its own

Lane: TypeAlias = np.uint64  # for places; what is narrower may wrap around, and what has a sign be negative
Face: TypeAlias = tuple[Vector, float, float]
"""N, |N| and 1/|N|."""
Sums: TypeAlias = tuple[Vector, float, float, float, float, float, Vector, float]
"""Of unit normals; of |N|; the least |N| and the greatest d·d; the least altitude as of `lower`; of N; of |d|."""
Turned: TypeAlias = tuple[Vector, Vector, float, Face, Sums]


@inner
def lower(e: Vector, d: Vector, mm: float, least: float, under: float) -> tuple[float, float]:
    """Return the lesser of a fraction and the squared altitude of a face: |N|² over the square of its longest edge."""
    g = (d[0] - e[0], d[1] - e[1], d[2] - e[2])
    gg, ee, dd = dot(g, g), dot(e, e), dot(d, d)
    longest = ee if ee > gg else gg
    longest = longest if longest > dd else dd
    less = mm * under < least * longest
    return (mm if less else least), (longest if less else under)


@inner
def over(e: Vector, dd: float, a: Face, b: Face) -> tuple[float, float]:
    """Go over an edge d from the face a, between e and d, into the face b.

    Returns:
        -|d|·sin θ and sin²θ of the dihedral angle: e · N_b is -|d|·|N_a|·|N_b|·sin θ / d².

    """
    per_length = dot(e, b[0]) * (a[2] * b[2])
    sine = dd * per_length
    return sine, sine * per_length


def _on(count: int, *, full: bool, measured: bool) -> Callable[..., Turned]:
    """Make the piece of code that goes on by so many neighbours: over each edge into the next face.

    What it goes on from, and returns, are the last two edge vectors e and d and d·d, the face between them, and sums.
    What it writes of each edge are the two numbers of `over` and d·d, and of the face behind it N and |N|.
    """
    further = _on(count - 1, full=full, measured=measured) if count > 1 else None

    @pasted
    def turn(
        ring: Indices, x: Floats, y: Floats, z: Floats,
        sine: Floats, squared: Floats, edge: Floats, nx: Floats, ny: Floats, nz: Floats, size: Floats,
        p: Vector, i: Lane, step: Lane, k: Lane, e: Vector, d: Vector, dd: float, a: Face, sums: Sums,
    ) -> Turned:  # fmt: skip
        normal, area, smallest, longest, least, under, vector, lengths = sums
        q = ring[i]
        f = (x[q] - p[0], y[q] - p[1], z[q] - p[2])
        ff = dot(f, f)
        n = cross(d, f)
        mm, scale, size_n = sized(n)
        b = (n, size_n, scale)
        sine[k], squared[k] = over(e, dd, a, b)
        edge[k], nx[k], ny[k], nz[k], size[k] = dd, n[0], n[1], n[2], size_n
        if full:
            least, under = lower(d, f, mm, least, under)
        if full or measured:
            area += size_n
        if measured:
            vector = (vector[0] + n[0], vector[1] + n[1], vector[2] + n[2])
            lengths += math.sqrt(dd)
        smallest = size_n if size_n < smallest else smallest
        longest = ff if ff > longest else longest
        return d, f, ff, b, (longer(normal, n, scale), area, smallest, longest, least, under, vector, lengths)

    if further is None:
        return turn

    @pasted
    def turns(
        ring: Indices, x: Floats, y: Floats, z: Floats,
        sine: Floats, squared: Floats, edge: Floats, nx: Floats, ny: Floats, nz: Floats, size: Floats,
        p: Vector, i: Lane, step: Lane, k: Lane, e: Vector, d: Vector, dd: float, a: Face, sums: Sums,
    ) -> Turned:  # fmt: skip
        e, d, dd, a, sums = turn(
            ring, x, y, z, sine, squared, edge, nx, ny, nz, size, p, i, step, k, e, d, dd, a, sums
        )
        return further(
            ring, x, y, z, sine, squared, edge, nx, ny, nz, size, p, i + step, step, k + Lane(BLOCK),
            e, d, dd, a, sums,
        )  # fmt: skip

    return turns


def _sweep(degree: int, *, full: bool = False, measured: bool = False) -> Callable[..., None]:
    """Make the pass once around vertices of that degree, as one straight piece of code.

    What goes from neighbour to neighbour stays in registers, and the first face, which is the last as well, is
    computed once. ``full``: with areas and least altitudes; ``measured``: with areas, volumes and lengths. What is
    not asked for is not in the machine code.
    """
    others = _on(degree - 1, full=full, measured=measured)

    @inner
    def sweep(
        ring: Indices, x: Floats, y: Floats, z: Floats,
        sx: Floats, sy: Floats, sz: Floats, areas: Floats, least_over: Floats, least_under: Floats,
        smallest: Floats, longest: Floats, volume: Floats, lengths: Floats,
        sine: Floats, squared: Floats, edge: Floats, nx: Floats, ny: Floats, nz: Floats, size: Floats,
        low: Lane, wide: Lane, at: Lane, step: Lane, _degree: Lane, _full: bool, _measured: bool,
    ) -> None:  # fmt: skip
        for k in range(Lane(0), wide):
            v, i = low + k, at + k
            p = (x[v], y[v], z[v])
            q = ring[i + Lane(degree - 1) * step]
            e = (x[q] - p[0], y[q] - p[1], z[q] - p[2])
            q = ring[i]
            d = (x[q] - p[0], y[q] - p[1], z[q] - p[2])
            n = cross(e, d)
            dd = dot(d, d)
            mm, scale, size_n = sized(n)
            a = (n, size_n, scale)
            nothing = (0.0, 0.0, 0.0)
            before, _, ll, b, sums = others(
                ring, x, y, z, sine, squared, edge, nx, ny, nz, size, p, i + step, step, k,
                e, d, dd, a, (longer(nothing, n, scale), size_n, size_n, dd, np.inf, 1.0, n, 0.0),
            )  # fmt: skip
            normal, area, smallest[k], longest[k], least, under, vector, all_lengths = sums
            j = Lane((degree - 1) * BLOCK) + k
            sine[j], squared[j] = over(before, ll, b, a)
            edge[j], nx[j], ny[j], nz[j], size[j] = ll, n[0], n[1], n[2], size_n
            sx[k], sy[k], sz[k] = normal
            if full:
                least_over[k], least_under[k] = lower(e, d, mm, least, under)
            if full or measured:
                areas[k] = area
            if measured:
                volume[k], lengths[k] = dot(p, vector), all_lengths + math.sqrt(ll)

    return sweep


def _straight(degree: int) -> Callable[..., None]:
    """Make the choice among the sweeps of that degree and those of the higher ones, up to MOST."""
    plain, with_volume, with_altitude = (
        _sweep(degree),
        _sweep(degree, measured=True),
        _sweep(degree, full=True),
    )
    higher = _straight(degree + 1) if degree < MOST else plain

    @inner
    def around(
        ring: Indices, x: Floats, y: Floats, z: Floats,
        sx: Floats, sy: Floats, sz: Floats, areas: Floats, least_over: Floats, least_under: Floats,
        smallest: Floats, longest: Floats, volume: Floats, lengths: Floats,
        sine: Floats, squared: Floats, edge: Floats, nx: Floats, ny: Floats, nz: Floats, size: Floats,
        low: Lane, wide: Lane, at: Lane, step: Lane, wanted: Lane, full: bool, measured: bool,
    ) -> None:  # fmt: skip
        if wanted != degree:
            higher(
                ring, x, y, z, sx, sy, sz, areas, least_over, least_under, smallest, longest, volume, lengths,
                sine, squared, edge, nx, ny, nz, size, low, wide, at, step, wanted, full, measured,
            )  # fmt: skip
        elif full:
            with_altitude(
                ring, x, y, z, sx, sy, sz, areas, least_over, least_under, smallest, longest, volume, lengths,
                sine, squared, edge, nx, ny, nz, size, low, wide, at, step, wanted, full, measured,
            )  # fmt: skip
        elif measured:
            with_volume(
                ring, x, y, z, sx, sy, sz, areas, least_over, least_under, smallest, longest, volume, lengths,
                sine, squared, edge, nx, ny, nz, size, low, wide, at, step, wanted, full, measured,
            )  # fmt: skip
        else:
            plain(
                ring, x, y, z, sx, sy, sz, areas, least_over, least_under, smallest, longest, volume, lengths,
                sine, squared, edge, nx, ny, nz, size, low, wide, at, step, wanted, full, measured,
            )  # fmt: skip

    return around


straight: Final = _straight(FEWEST)
"""Go around vertices of a degree from FEWEST to MOST; either ``full`` or ``measured`` or neither, see `_sweep`."""
