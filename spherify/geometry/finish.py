"""The last of a run that is not round enough: radii and directions climb together, by a method that sees how they meet.

What `spherify.geometry.ascent` and T along the radii end at is where steps by the diagonal get no further, one of them
for directions and the other for radii. On few and uneven triangles there is more to be had. With the positions p from
the centre, u = p / |p| and all of that module's names, the energy

    E = log A - ⅔ log V - LOWER · 4π/m² · Σ log det(u_a, u_b, u_c)

falls in all three coordinates of each vertex, with a tenth of the barrier, by the method of Nocedal, "Updating
quasi-Newton matrices with limited storage", 1980. It begins each step with the diagonal of that module for what is
tangential, and for what is radial with Σ |r - q|²/(4·area)/A, how much the area grows as a vertex leaves its plane.
Moves are halved until E falls, and no triangle passes the barrier: whatever looks outward from the centre still does.
All of it but that method is ours.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from spherify.geometry import measures
from spherify.geometry.mesh import Floats, Ints

LOWER: Final = 0.03  # of the barrier; less leaves triangles of less area, and is no rounder
STEPS: Final = 200  # in an iteration, at most: what is remembered of them does not outlive it
FEWEST: Final = 8
WORK: Final = (
    400_000  # steps times vertices of an iteration, about a second: a run is heard and cancelled between two
)
REMEMBERED: Final = 15
HALVINGS: Final = 30
FALLS: Final = 1e-4  # share of the fall that the slope promises, which is enough
FIRST: Final = 0.1  # of a step by the diagonal, before anything is remembered


class _Energy(NamedTuple):
    """E at some positions; gradient (n, 3) and the diagonals (n, 1) of its Hessian."""

    value: float
    gradient: Floats
    tangential: Floats
    radial: Floats


def steps_of(n: int) -> int:
    """Return how many steps an iteration has of n vertices."""
    return min(max(WORK // n, FEWEST), STEPS)


def finished(
    V: Floats, F: Ints, centre: Floats, *, barrier: float = LOWER, steps: int | None = None
) -> Floats:
    """Return (n, 3) positions of less energy; V as it is where something does not look outward, or nothing falls.

    Args:
        V: (n, 3) positions.
        F: (m, 3) faces, closed, all of which look outward from the centre.
        centre: (3,) c.
        barrier: in the place of LOWER.
        steps: as many; `steps_of` the number of vertices by default.

    """
    size = float(measures.norm(V - centre).mean())
    P = np.asfortranarray((V - centre) / size)
    at = _energy(P, F, barrier)
    pairs: list[tuple[Floats, Floats, float]] = []  # moves, what the gradient changed by, and their product
    for _ in range(steps_of(len(V)) if steps is None else steps):
        if at is None:
            return V
        move = -_solved(at, P, pairs)
        slope = float((move * at.gradient).sum())
        found = _fallen(P, F, at, move, slope, lower=barrier) if slope < 0 else None
        if found is None:
            if not pairs:
                break
            pairs = []
            continue
        moved, there = found
        change = there.gradient - at.gradient
        product = float((change * (moved - P)).sum())
        if product > 0:
            pairs = [*pairs, (moved - P, change, product)][-REMEMBERED:]
        P, at = moved, there
    return np.asfortranarray(centre + size * P)


def _solved(at: _Energy, P: Floats, pairs: list[tuple[Floats, Floats, float]]) -> Floats:
    """(n, 3) the gradient by the inverse of what is known of the Hessian."""
    left, shares = at.gradient, []
    for move, change, product in reversed(pairs):
        shares.append(float((move * left).sum()) / product)
        left = left - shares[-1] * change
    by = FIRST
    if pairs:
        _, change, product = pairs[-1]
        by = product / float((change * _by_diagonal(at, P, change)).sum())
    found = by * _by_diagonal(at, P, left)
    for (move, change, product), share in zip(pairs, reversed(shares), strict=True):
        found = found + (share - float((change * found).sum()) / product) * move
    return found


def _by_diagonal(at: _Energy, P: Floats, vectors: Floats) -> Floats:
    """(n, 3) vectors over the diagonals."""
    U = measures.normalised(P)
    radial = measures.dot(vectors, U)[:, None] * U
    found: Floats = (vectors - radial) / at.tangential + radial / at.radial
    return found


def _fallen(
    P: Floats, F: Ints, at: _Energy, move: Floats, slope: float, *, lower: float
) -> tuple[Floats, _Energy] | None:
    """Return positions along the move at which E is less, and E there."""
    share = 1.0
    for _ in range(HALVINGS):
        moved = P + share * move
        there = _energy(moved, F, lower)
        if there is not None and there.value < at.value + FALLS * share * slope:
            return moved, there
        share /= 2
    return None


def _energy(P: Floats, F: Ints, lower: float) -> _Energy | None:
    """Return E at positions from the centre; None beyond the barrier."""
    n, m = len(P), len(F)
    radii = measures.norm(P)[:, None]
    U = P / radii
    corners = [measures.gather(P, F[:, k]) for k in range(3)]
    directions = [measures.gather(U, F[:, k]) for k in range(3)]
    vectors = 0.5 * measures.cross(corners[1] - corners[0], corners[2] - corners[0])
    areas = measures.norm(vectors)
    area, volume = float(areas.sum()), float(measures.dot(vectors, corners[0]).sum()) / 3
    a, b, c = directions
    volumes = measures.dot(a, measures.cross(b - a, c - a))
    if not (volumes.min() > 0 and areas.min() > 0 and volume > 0):  # of what is not finite too
        return None
    barrier = lower * 4 * np.pi / m**2
    normals = vectors / areas[:, None]
    gradient, pushed = np.zeros((n, 3)), np.zeros((n, 3))
    tangential, radial = np.zeros(n), np.zeros(n)
    for k in range(3):
        u, v, w = (directions[(k + j) % 3] for j in range(3))
        opposite = corners[(k + 2) % 3] - corners[(k + 1) % 3]
        across = measures.cross(v, w - v)
        along = measures.cross(normals, opposite) / (2 * area) - vectors * (2 / (9 * volume))
        gradient += measures.scatter(F[:, k], along, n)
        pushed -= measures.scatter(F[:, k], across * (barrier / volumes)[:, None], n)
        within = measures.dot(across, across) - measures.dot(across, u) ** 2
        stiff = areas * (4 * np.pi / (3 * area**2)) + barrier * within / volumes**2
        tangential += measures.scatter(F[:, k], stiff, n)
        radial += measures.scatter(F[:, k], measures.dot(opposite, opposite) / (4 * area * areas), n)
    gradient += (pushed - measures.dot(pushed, U)[:, None] * U) / radii
    value = np.log(area) - 2 / 3 * np.log(volume) - barrier * float(np.log(volumes).sum())
    return _Energy(float(value), gradient, tangential[:, None], radial[:, None])
