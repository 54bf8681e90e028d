"""Directions climb to the greatest sphericity; see `spherify.geometry.ascent`, whose formulas these are."""

from __future__ import annotations

import math
from typing import NamedTuple

from spherify.geometry.ascent import BARRIER, GIVEN_UP, HALVINGS, KEPT, LEAST_VOLUME, SHARE
from spherify.geometry.kernels.passes.jit import entry, inner
from spherify.geometry.kernels.passes.types import Floats, Indices
from spherify.geometry.kernels.passes.vectors import Vector, cross, dot, longer


class Climb(NamedTuple):
    """What the pass writes.

    Attributes:
        directions: (n, 4) u, and the radius.
        slopes: (n, 4) the gradient times the area, and the diagonal of the Hessian; after that 1 at whose move is cut.
        moves: (n, 4) where to, and what share of the way.
        moved: (n, 4) directions after it. Before it, the positions an iteration before.
        volumes: (m,) of the triangles of directions and the centre, times six.

    """

    directions: Floats
    slopes: Floats
    moves: Floats
    moved: Floats
    volumes: Floats


@entry
def ascend(position: Floats, corners: Indices, centre: Floats, momentum: float, climb: Climb) -> None:
    """Do what `spherify.geometry.ascent.ascended` does to ``position`` (3, n)."""
    U, moves, moved = climb.directions, climb.moves, climb.moved
    n, m = position.shape[1], corners.shape[1]
    for p in range(n):
        direct(U, p, position[0, p] - centre[0], position[1, p] - centre[1], position[2, p] - centre[2])
        direct(moved, p, moved[p, 0] - centre[0], moved[p, 1] - centre[1], moved[p, 2] - centre[2])
    slope(U, corners, climb.slopes, climb.volumes)
    for p in range(n):
        plan(U, climb.slopes, moves, moved, momentum, p)
    for i in range(HALVINGS + GIVEN_UP):
        for p in range(n):
            share = moves[p, 3]
            direct(
                moved, p,
                U[p, 0] + share * moves[p, 0], U[p, 1] + share * moves[p, 1], U[p, 2] + share * moves[p, 2],
            )  # fmt: skip
            climb.slopes[p, 3] = 0.0  # no corner of a face that would turn, as yet
        turned = 0
        for f in range(m):
            a, b, c = corners[0, f], corners[1, f], corners[2, f]
            if volume_of(moved, a, b, c) < KEPT * climb.volumes[f]:
                turned += 1
                climb.slopes[a, 3] = climb.slopes[b, 3] = climb.slopes[c, 3] = 1.0
        if turned == 0:
            for p in range(n):
                for k in range(3):
                    position[k, p] = centre[k] + U[p, 3] * moved[p, k]
            return
        for p in range(n):
            if climb.slopes[p, 3] > 0:
                moves[p, 3] *= 0.5 if i < HALVINGS else 0.0


@inner
def direct(U: Floats, p: int, x: float, y: float, z: float) -> None:
    """Write the direction of a vector to U (n, 4), 0 if it has none, and its length."""
    length = math.sqrt(x * x + y * y + z * z)
    share = 1 / length if length > 0 else 0.0
    U[p, 0], U[p, 1], U[p, 2], U[p, 3] = share * x, share * y, share * z, length


@inner
def slope(U: Floats, corners: Indices, slopes: Floats, volumes: Floats) -> None:
    """Write the gradient, the diagonal and the volumes."""
    area, volume = 0.0, 0.0
    m = corners.shape[1]
    slopes[:] = 0.0
    for f in range(m):
        a, b, c = corners[0, f], corners[1, f], corners[2, f]
        vector = area_vector(U, a, b, c)
        area += math.sqrt(dot(vector, vector))
        volume += dot(vector, spoke(U, a)) / 3
        volumes[f] = volume_of(U, a, b, c)
    barrier = BARRIER * 4 * math.pi / m * area / m
    outward = 2 / 9 * area / volume
    flatness = 4 * math.pi / 3 / area
    for f in range(m):
        a, b, c = corners[0, f], corners[1, f], corners[2, f]
        ua, ub, uc = direction(U, a), direction(U, b), direction(U, c)
        sa, sb, sc = spoke(U, a), spoke(U, b), spoke(U, c)
        vector = area_vector(U, a, b, c)
        size = math.sqrt(dot(vector, vector))
        half = 0.5 / size if size > 0 else 0.0
        flat = size * flatness
        share = barrier / max(volumes[f], LEAST_VOLUME)
        firm = share * share / barrier
        shed = (-outward * vector[0], -outward * vector[1], -outward * vector[2])
        add(slopes, a, U[a, 3], longer(shed, cross(vector, minus(sc, sb)), half), flat)
        add(slopes, b, U[b, 3], longer(shed, cross(vector, minus(sa, sc)), half), flat)
        add(slopes, c, U[c, 3], longer(shed, cross(vector, minus(sb, sa)), half), flat)
        resist(slopes, a, ua, cross(ub, minus(uc, ub)), share, firm)
        resist(slopes, b, ub, cross(uc, minus(ua, uc)), share, firm)
        resist(slopes, c, uc, cross(ua, minus(ub, ua)), share, firm)


@inner
def add(slopes: Floats, p: int, radius: float, gradient: Vector, flat: float) -> None:
    """Add what sphericity a triangle brings at its corner p; ``flat`` is its area, as the diagonal has it."""
    slopes[p, 0] += radius * gradient[0]
    slopes[p, 1] += radius * gradient[1]
    slopes[p, 2] += radius * gradient[2]
    slopes[p, 3] += flat * radius * radius


@inner
def resist(slopes: Floats, p: int, u: Vector, across: Vector, share: float, firm: float) -> None:
    """Add what a triangle adds as a barrier at its corner p, of direction u, with ``across`` for ∇det."""
    radially = dot(across, u)
    slopes[p, 0] -= share * across[0]
    slopes[p, 1] -= share * across[1]
    slopes[p, 2] -= share * across[2]
    slopes[p, 3] += firm * (dot(across, across) - radially * radially)


@inner
def plan(U: Floats, slopes: Floats, moves: Floats, before: Floats, momentum: float, p: int) -> None:
    """Write the tangential move of a direction, momentum and step, and that all of it is allowed."""
    here = direction(U, p)
    share = -SHARE / slopes[p, 3]
    move = (
        momentum * (here[0] - before[p, 0]) + share * slopes[p, 0],
        momentum * (here[1] - before[p, 1]) + share * slopes[p, 1],
        momentum * (here[2] - before[p, 2]) + share * slopes[p, 2],
    )
    along = dot(move, here)
    for k in range(3):
        moves[p, k] = move[k] - along * here[k]
    moves[p, 3] = 1.0


@inner
def direction(U: Floats, p: int) -> Vector:
    """Return u."""
    return U[p, 0], U[p, 1], U[p, 2]


@inner
def minus(a: Vector, b: Vector) -> Vector:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inner
def spoke(U: Floats, p: int) -> Vector:
    """Return p - c."""
    return U[p, 0] * U[p, 3], U[p, 1] * U[p, 3], U[p, 2] * U[p, 3]


@inner
def area_vector(U: Floats, a: int, b: int, c: int) -> Vector:
    """Return the normal of a triangle, as long as its area is great."""
    p, q, r = spoke(U, a), spoke(U, b), spoke(U, c)
    x, y, z = cross(minus(q, p), minus(r, p))
    return 0.5 * x, 0.5 * y, 0.5 * z


@inner
def volume_of(U: Floats, a: int, b: int, c: int) -> float:
    """Return det(u_a, u_b, u_c)."""
    p, q, r = direction(U, a), direction(U, b), direction(U, c)
    return dot(p, cross(minus(q, p), minus(r, p)))
