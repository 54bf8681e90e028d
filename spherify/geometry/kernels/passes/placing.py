"""Vertices put back into a triangulation of directions, and room made for them; see `spherify.geometry.thinning`."""

from __future__ import annotations

import math

import numpy as np

from spherify.geometry.kernels.passes.directions import minus
from spherify.geometry.kernels.passes.jit import entry, inner
from spherify.geometry.kernels.passes.linking import OUT, Numbers, Triangulation, take_out, undo
from spherify.geometry.kernels.passes.narrow import outward
from spherify.geometry.kernels.passes.types import Floats
from spherify.geometry.kernels.passes.vectors import Vector, cross, dot
from spherify.geometry.thinning import BEYOND


@inner
def height(sides: Floats, d: int, x: float, y: float, z: float, enough: float) -> float:
    """Return by how much the direction to a point is within all sides; ``enough`` if that is less, or no number."""
    over = 1.0 / math.sqrt(x * x + y * y + z * z)
    least = np.inf
    for k in range(d):
        here = over * (x * sides[k, 0] + y * sides[k, 1] + z * sides[k, 2])
        if not here > enough:
            return enough
        least = min(least, here)
    return least


@inner
def place(t: Triangulation, U: Floats, p: int, h: int, sides: Floats, shortened: Floats) -> bool:
    """Give a vertex a direction from which all edges of its ring are seen best; whether there is one."""
    q, d = t.heads[h], t.degrees[p]
    qx, qy, qz = U[q, 0], U[q, 1], U[q, 2]
    size, mx, my, mz, g = 0.0, 0.0, 0.0, 0.0, h
    for k in range(d):
        a, b = t.heads[g], t.heads[t.after[g]]
        ax, ay, az, bx, by, bz = U[a, 0], U[a, 1], U[a, 2], U[b, 0], U[b, 1], U[b, 2]
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        over = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
        sides[k, 0], sides[k, 1], sides[k, 2] = over * nx, over * ny, over * nz
        ax, ay, az = ax - qx, ay - qy, az - qz
        size = max(size, ax * ax + ay * ay + az * az)
        mx, my, mz = mx + ax, my + ay, mz + az
        g = t.after[g]
    size = math.sqrt(size)
    last = d - 1
    in_x, in_y, in_z = (
        sides[0, 0] + sides[last, 0],
        sides[0, 1] + sides[last, 1],
        sides[0, 2] + sides[last, 2],
    )
    best, bx, by, bz = 0.0, 0.0, 0.0, 0.0
    for aim in range(3):
        over = 1.0 / (d if aim == 0 else d - 1)
        ax, ay, az = over * mx, over * my, over * mz
        if aim == 2:
            ax, ay, az = size * in_x, size * in_y, size * in_z
        for share in shortened:
            x, y, z = qx + share * ax, qy + share * ay, qz + share * az
            here = height(sides, d, x, y, z, best)
            if here > best:
                best, bx, by, bz = here, x, y, z
    if best > 0:
        over = 1.0 / math.sqrt(bx * bx + by * by + bz * bz)
        U[p, 0], U[p, 1], U[p, 2] = over * bx, over * by, over * bz
    return best > 0


@inner
def at(U: Floats, p: int) -> Vector:
    """Return a direction."""
    return U[p, 0], U[p, 1], U[p, 2]


@inner
def centre(t: Triangulation, U: Floats, p: int, pull: float) -> None:
    """Move one vertex, see `spherify.geometry.thinning.Thinning.relax`; ``pull`` is c."""
    here = at(U, p)
    x, y, z = here
    # Two directions across: of Duff and others, "Building an orthonormal basis, revisited", 2017.
    sign = math.copysign(1.0, z)
    by = -1.0 / (sign + z)
    one = (1.0 + sign * x * x * by, sign * x * y * by, -sign * x)
    other = (x * y * by, sign + y * y * by, -y)
    d, h = t.degrees[p], t.first[p]
    gu, gv, huu, huv, hvv = 0.0, 0.0, float(d), 0.0, float(d)
    a = minus(at(U, t.heads[h]), here)
    for _ in range(d):
        h = t.after[h]
        b = minus(at(U, t.heads[h]), here)
        across = cross(a, b)
        over = 1.0 / dot(here, across)
        side = cross(here, minus(b, a))
        slope = (side[0] + across[0], side[1] + across[1], side[2] + across[2])
        u, v = over * dot(one, slope), over * dot(other, slope)
        gu, gv = gu + u, gv + v
        huu, huv, hvv = huu + u * u, huv + u * v, hvv + v * v
        gu, gv = gu + pull * dot(a, one), gv + pull * dot(a, other)
        bend = pull * (1.0 - 0.5 * dot(a, a))
        huu, hvv = huu + bend, hvv + bend
        a = b
    det = 1.0 / (huu * hvv - huv * huv)
    u, v = det * (hvv * gu - huv * gv), det * (huu * gv - huv * gu)
    damped = BEYOND / (1.0 + BEYOND * math.sqrt(max(u * gu + v * gv, 0.0)))
    u, v = damped * u, damped * v
    x, y, z = x + u * one[0] + v * other[0], y + u * one[1] + v * other[1], z + u * one[2] + v * other[2]
    over = 1.0 / math.sqrt(x * x + y * y + z * z)
    U[p, 0], U[p, 1], U[p, 2] = over * x, over * y, over * z
    for _ in range(d):
        q, r = t.heads[h], t.heads[t.after[h]]
        if not outward(U, p, q, r, 0.0):  # by rounding
            U[p, 0], U[p, 1], U[p, 2] = here
            return
        h = t.after[h]


@entry
def relax(t: Triangulation, U: Floats, left: Numbers, sweeps: int, pull: float) -> None:
    """Let vertices make room for each other, one after another.

    Args:
        t: the triangulation.
        U: (n, 3) directions, in and out.
        left: (k,) the vertices.
        sweeps: how often each.
        pull: c.

    """
    for _ in range(sweeps):
        for p in left:
            centre(t, U, p, pull)


@entry
def put_back(t: Triangulation, U: Floats, until: int, sides: Floats, shortened: Floats) -> bool:
    """Put vertices back, the last first, and give them directions; False as soon as one finds none.

    Args:
        t: the triangulation.
        U: (n, 3) directions, in and out.
        until: so many are merged.
        sides: (n, 3) scratch.
        shortened: shares of the way from the vertex that it was merged into, where a place is looked for.

    """
    while t.counts[OUT] > until:
        h = t.merged[t.counts[OUT] - 1]
        p = t.heads[t.twins[h]]
        undo(t, p, h)
        if not place(t, U, p, h, sides, shortened):
            take_out(t, h)
            return False
    return True
