"""Vertices put back into a triangulation of directions, and room made for them; see `spherify.geometry.thinning`."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from spherify.geometry.kernels.passes.arithmetic import fma
from spherify.geometry.kernels.passes.directions import minus
from spherify.geometry.kernels.passes.jit import entry, inner
from spherify.geometry.kernels.passes.linking import OUT, Numbers, Triangulation, take_out, undo
from spherify.geometry.kernels.passes.narrow import outward
from spherify.geometry.kernels.passes.types import Floats
from spherify.geometry.kernels.passes.vectors import Vector, dot, longer
from spherify.geometry.thinning import BEYOND

# Where springs pull together, a damped step of length s leaves of each determinant 1/(1 + s) or more: of such beyond
# rounding.
SHORT_STEP: Final = 100.0
SAFE_HEIGHT: Final = 1e-10


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
def across(here: Vector) -> tuple[Vector, Vector]:
    """Two directions at right angles to one and to each other, (one, other, here) right-handed.

    Duff and others, "Building an orthonormal basis, revisited", 2017.
    """
    x, y, z = here
    sign = math.copysign(1.0, z)
    by = -1.0 / (sign + z)
    return (1.0 + sign * x * x * by, sign * x * y * by, -sign * x), (x * y * by, sign + y * y * by, -y)


@inner
def seen_from(U: Floats, q: int, here: Vector, one: Vector, other: Vector) -> Vector:
    """Return a neighbour q as seen from here: q - here along ``one`` and ``other``, and q · here."""
    a = minus(at(U, q), here)
    return dot(a, one), dot(a, other), 1.0 + dot(a, here)


@inner
def centre(t: Triangulation, U: Floats, p: int, pull: float) -> None:
    """Move one vertex, see `spherify.geometry.thinning.Thinning.relax`; ``pull`` is c.

    In the plane that touches the sphere here, a neighbour q is at (a_u, a_v) and q · here = a. Of a triangle with q and
    r the determinant is D = a_u b_v - a_v b_u, and the gradient of log D (a_v b - b_v a, b_u a - a_u b) / D. Half of
    |q - here|² is 1 - a: its gradient is -(a_u, a_v), and its second derivatives are a.
    """
    here = at(U, p)
    one, other = across(here)
    d, h = t.degrees[p], t.first[p]
    gu, gv, huu, huv, hvv = 0.0, 0.0, float(d), 0.0, float(d)
    su, sv, springs, least = 0.0, 0.0, 0.0, np.inf
    au, av, a = seen_from(U, t.heads[h], here, one, other)
    for _ in range(d):
        h = t.after[h]
        bu, bv, b = seen_from(U, t.heads[h], here, one, other)
        height = fma(au, bv, -(av * bu))
        over = 1.0 / height
        u, v = over * fma(av, b, -(bv * a)), over * fma(bu, a, -(au * b))
        gu, gv = gu + u, gv + v
        huu, huv, hvv = fma(u, u, huu), fma(u, v, huv), fma(v, v, hvv)
        su, sv, springs = su + au, sv + av, springs + a
        least = min(least, height)
        au, av, a = bu, bv, b
    gu, gv, huu, hvv = fma(pull, su, gu), fma(pull, sv, gv), fma(pull, springs, huu), fma(pull, springs, hvv)
    det = 1.0 / fma(huu, hvv, -(huv * huv))
    u, v = det * fma(hvv, gu, -(huv * gv)), det * fma(huu, gv, -(huv * gu))
    step = BEYOND * math.sqrt(max(fma(u, gu, v * gv), 0.0))
    damped = BEYOND / (1.0 + step)
    x, y, z = longer(longer(here, one, damped * u), other, damped * v)
    over = 1.0 / math.sqrt(dot((x, y, z), (x, y, z)))
    U[p, 0], U[p, 1], U[p, 2] = over * x, over * y, over * z
    if step < SHORT_STEP and least > SAFE_HEIGHT and springs > 0:
        return
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
