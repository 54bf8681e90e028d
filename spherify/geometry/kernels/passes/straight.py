"""Once around vertices of the commonest degrees, each degree as one straight piece of code.

What goes from neighbour to neighbour stays in registers. Otherwise the same as `turn` of
`spherify.geometry.kernels.passes.rings`, which see; the pieces both are made of are here.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from spherify.geometry.kernels.passes.jit import inner, pasted
from spherify.geometry.kernels.passes.types import Floats, Indices
from spherify.geometry.kernels.passes.vectors import Vector, cross, dot, longer, sized

LANES = 8  # numbers in the widest register
BLOCK = 64  # vertices; the scratch of one block fits the first-level cache
FEWEST, MOST = 4, 8  # neighbours for which there is code of its own
FLAT = 1e-6  # sine of an angle below which a corner's normal is lost to rounding

Lane: TypeAlias = np.uint64  # for places; what is narrower may wrap around, and what has a sign be negative
Turned: TypeAlias = tuple[Vector, Vector, float, Vector, float, Vector, Vector, float, np.int64, float, float]


@inner
def is_flat(size: float, dd: float, ff: float) -> np.int64:
    """Whether a face of that |N| between two edges, whose squares are dd and ff, has lost its normal to rounding."""
    return np.int64(0) if size > FLAT * (dd + ff) else np.int64(1)


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
def over(
    e: Vector, d: Vector, dd: float, a: Vector, size: float, b: Vector, size_b: float
) -> tuple[float, float, float, float]:
    """Go over an edge d, from the face a between e and d, as large as ``size``, into the face b.

    Returns:
        sine and cosine of the dihedral angle, each times |d|·|a|·|b|; |a| + |b|; and |d|.

    """
    length = math.sqrt(dd)
    return -length * dot(e, b), dot(a, b), size + size_b, length


def _on(count: int, *, bounded: bool) -> Callable[..., Turned]:
    """Make the piece of code that goes on by so many neighbours: over each edge into the next face.

    What it goes on from, and returns, are the last two edge vectors e and d and d·d, the face between them and its
    |N|, the sums of unit normals, of N and of |N|, whether a face was flat, and the least altitude as of `lower`.
    """
    further = _on(count - 1, bounded=bounded) if count > 1 else None

    @pasted
    def turn(
        ring: Indices, x: Floats, y: Floats, z: Floats, sine: Floats, cosine: Floats, both: Floats, length: Floats,
        p: Vector, i: Lane, step: Lane, k: Lane,
        e: Vector, d: Vector, dd: float, a: Vector, size: float,
        normal: Vector, vector: Vector, area: float, flat: np.int64, least: float, under: float,
    ) -> Turned:  # fmt: skip
        q = ring[i]
        f = (x[q] - p[0], y[q] - p[1], z[q] - p[2])
        ff = dot(f, f)
        b = cross(d, f)
        mm, scale, size_b = sized(b)
        sine[k], cosine[k], both[k], length[k] = over(e, d, dd, a, size, b, size_b)
        if bounded:
            least, under = lower(d, f, mm, least, under)
        normal, flat = longer(normal, b, scale), flat | is_flat(size_b, dd, ff)
        vector = (vector[0] + b[0], vector[1] + b[1], vector[2] + b[2])
        return d, f, ff, b, size_b, normal, vector, area + size_b, flat, least, under

    if further is None:
        return turn

    @pasted
    def turns(
        ring: Indices, x: Floats, y: Floats, z: Floats, sine: Floats, cosine: Floats, both: Floats, length: Floats,
        p: Vector, i: Lane, step: Lane, k: Lane,
        e: Vector, d: Vector, dd: float, a: Vector, size: float,
        normal: Vector, vector: Vector, area: float, flat: np.int64, least: float, under: float,
    ) -> Turned:  # fmt: skip
        e, d, dd, a, size, normal, vector, area, flat, least, under = turn(
            ring, x, y, z, sine, cosine, both, length, p, i, step, k,
            e, d, dd, a, size, normal, vector, area, flat, least, under,
        )  # fmt: skip
        return further(
            ring, x, y, z, sine, cosine, both, length, p, i + step, step, k + Lane(BLOCK),
            e, d, dd, a, size, normal, vector, area, flat, least, under,
        )  # fmt: skip

    return turns


def _sweep(degree: int, *, bounded: bool = False, measured: bool = False) -> Callable[..., None]:
    """Make the pass once around vertices of that degree, as one straight piece of code.

    What goes from neighbour to neighbour stays in registers, and the first face, which is the last as well, is
    computed once. ``bounded``: with the least altitudes; ``measured``: with the volumes. What is not asked for is not
    in the machine code.
    """
    others = _on(degree - 1, bounded=bounded)

    @inner
    def sweep(
        ring: Indices, x: Floats, y: Floats, z: Floats,
        sx: Floats, sy: Floats, sz: Floats, areas: Floats, least_over: Floats, least_under: Floats,
        volume: Floats, flat: NDArray[np.int64], sine: Floats, cosine: Floats, both: Floats, length: Floats,
        low: Lane, wide: Lane, at: Lane, step: Lane, _degree: Lane, _bounded: bool, _measured: bool,
    ) -> None:  # fmt: skip
        for k in range(Lane(0), wide):
            v, i = low + k, at + k
            p = (x[v], y[v], z[v])
            q = ring[i + Lane(degree - 1) * step]
            e = (x[q] - p[0], y[q] - p[1], z[q] - p[2])
            q = ring[i]
            d = (x[q] - p[0], y[q] - p[1], z[q] - p[2])
            a = cross(e, d)
            dd = dot(d, d)
            aa, scale, size = sized(a)
            before, last, ll, b, size_b, normal, vector, area, off, least, under = others(
                ring, x, y, z, sine, cosine, both, length, p, i + step, step, k,
                e, d, dd, a, size, (0.0, 0.0, 0.0), a, 0.0, np.int64(0), np.inf, 1.0,
            )  # fmt: skip
            j = Lane((degree - 1) * BLOCK) + k
            sine[j], cosine[j], both[j], length[j] = over(before, last, ll, b, size_b, a, size)
            if bounded:
                least_over[k], least_under[k] = lower(e, d, aa, least, under)
            if measured:
                volume[k] = dot(p, vector)
            sx[k], sy[k], sz[k] = longer(normal, a, scale)
            areas[k] = area + size
            flat[k] = off | is_flat(size, ll, dd)

    return sweep


def _straight(degree: int) -> Callable[..., None]:
    """Make the choice among the sweeps of that degree and those of the higher ones, up to MOST."""
    plain, with_volume = _sweep(degree), _sweep(degree, measured=True)
    with_altitude = _sweep(degree, bounded=True)
    higher = _straight(degree + 1) if degree < MOST else plain

    @inner
    def around(
        ring: Indices, x: Floats, y: Floats, z: Floats,
        sx: Floats, sy: Floats, sz: Floats, areas: Floats, least_over: Floats, least_under: Floats,
        volume: Floats, flat: NDArray[np.int64], sine: Floats, cosine: Floats, both: Floats, length: Floats,
        low: Lane, wide: Lane, at: Lane, step: Lane, wanted: Lane, bounded: bool, measured: bool,
    ) -> None:  # fmt: skip
        if wanted != degree:
            higher(
                ring, x, y, z, sx, sy, sz, areas, least_over, least_under, volume, flat, sine, cosine, both, length,
                low, wide, at, step, wanted, bounded, measured,
            )  # fmt: skip
        elif bounded:
            with_altitude(
                ring, x, y, z, sx, sy, sz, areas, least_over, least_under, volume, flat, sine, cosine, both, length,
                low, wide, at, step, wanted, bounded, measured,
            )  # fmt: skip
        elif measured:
            with_volume(
                ring, x, y, z, sx, sy, sz, areas, least_over, least_under, volume, flat, sine, cosine, both, length,
                low, wide, at, step, wanted, bounded, measured,
            )  # fmt: skip
        else:
            plain(
                ring, x, y, z, sx, sy, sz, areas, least_over, least_under, volume, flat, sine, cosine, both, length,
                low, wide, at, step, wanted, bounded, measured,
            )  # fmt: skip

    return around


straight: Final = _straight(FEWEST)
"""Go around vertices of a degree from FEWEST to MOST; either ``bounded`` or ``measured`` or neither, see `_sweep`."""
