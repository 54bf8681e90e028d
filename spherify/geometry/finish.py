"""The last of a run that is not round enough: radii and directions climb together, by a method that sees how they meet.

`spherify.geometry.ascent`, for directions, and T along the radii, for radii, both end where steps by the diagonal of
the Hessian make no further progress. On few and uneven triangles there is more to gain. With the positions p from the
centre, u = p / |p| and all of that module's names, the energy

    E = log A - ⅔ log V - BARRIER · 4π/m² · Σ log det(u_a, u_b, u_c)

falls in all three coordinates of each vertex, with a tenth of the barrier there, by the method of Nocedal, "Updating
quasi-Newton matrices with limited storage", 1980. What is left in it of a limb is a spot of tiny triangles, which have
to grow together: steps by the diagonal take thousands for that, each vertex waiting for the others. So a step begins
with the Hessian of an energy that is quadratic and, near a round surface, bends about as E does or more, the volume
apart: the area is at most the Dirichlet energy by the cotangents of the triangles (Pinkall and Polthier, "Computing
discrete minimal surfaces and their conjugates", 1993), and -log a of a flat triangle of area a bends at most as its
Dirichlet energy over a does. The barrier's are the triangles of directions, each laid flat across its middle: a is
det/2 then, but for how far that is from the centre, and as small as det on what is seen edge-on. Both together are one
Laplacian, for which a triangle has the weights ½ cot/A, and ½ cot · BARRIER · 4π/m²/a of directions; it is the same for
all three coordinates, and factorised once an iteration. As in Kovalsky, Galun and Lipman, "Accelerated quadratic proxy
for geometric optimization", 2016, whose Laplacian stays that of the start.

Where triangles differ by more than the digits of a number the factors are noise: if no share of a step that is by them
alone falls, steps are by the diagonal until the next iteration. Moves are halved until E falls, and no triangle
passes the barrier: whatever looks outward from the centre still does. The energy and its Laplacian are ours.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np

from spherify.geometry import measures
from spherify.geometry.laplacian import cotangents
from spherify.geometry.mesh import Floats, Ints

LOWER: Final = 0.03  # of the barrier; less leaves triangles of less area, and is no rounder
STEPS: Final = 30  # in an iteration, at most; Laplacian and memory of moves are for that long
FEWEST: Final = 8
WORK: Final = 600_000  # steps times vertices of an iteration: a third of a second; it is heard between two
MOST: Final = 100_000  # vertices; factors of more take too long and too much memory
REMEMBERED: Final = 20  # moves
HALVINGS: Final = 30
FALLS: Final = 1e-4  # share of the fall that the slope promises, which is enough
ABOUT: Final = 0.01  # of the mean radius, that the centroid is off the centre at most, for it to stay there
ANCHORED: Final = 1e-6  # of its diagonal, added to the Laplacian, which else would be singular


class Energy(NamedTuple):
    """E at some positions, and its gradient (n, 3)."""

    value: float
    gradient: Floats


Energies = Callable[[Ints, float], Callable[[Floats], Energy | None]]
"""Makes, of faces (m, 3) and a barrier, what returns E at positions (n, 3) from the centre; None beyond the barrier."""


def steps_of(n: int) -> int:
    """Return how many steps an iteration has of n vertices."""
    return min(max(WORK // n, FEWEST), STEPS)


def energies(F: Ints, barrier: float) -> Callable[[Floats], Energy | None]:
    """See `Energies`."""
    m = len(F)
    share = barrier * 4 * np.pi / m**2

    def energy(P: Floats) -> Energy | None:
        n = len(P)
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
        normals = vectors / areas[:, None]
        gradient, pushed = np.zeros((n, 3)), np.zeros((n, 3))
        for k in range(3):
            v, w = (directions[(k + j) % 3] for j in (1, 2))
            opposite = corners[(k + 2) % 3] - corners[(k + 1) % 3]
            across = measures.cross(v, w - v)
            along = measures.cross(normals, opposite) / (2 * area) - vectors * (2 / (9 * volume))
            gradient += measures.scatter(F[:, k], along, n)
            pushed -= measures.scatter(F[:, k], across * (share / volumes)[:, None], n)
        gradient += (pushed - measures.dot(pushed, U)[:, None] * U) / radii
        value = np.log(area) - 2 / 3 * np.log(volume) - share * float(np.log(volumes).sum())
        return Energy(float(value), gradient)

    return energy


class Finish:
    """The last of a run on one mesh; the order in which its Laplacians are factorised is found once."""

    def __init__(self, n: int, F: Ints, *, by: Energies = energies) -> None:
        """Begin it for n vertices and closed faces F (m, 3); ``by``: who computes energies."""
        self._n, self._F = n, F
        self._energy = by(F, LOWER)

    @cached_property
    def _metric(self) -> _Metric:
        return _Metric(self._n, self._F, LOWER)

    def advanced(self, V: Floats, centre: Floats, *, steps: int | None = None) -> Floats:
        """Return (n, 3) positions of less energy.

        V as it is where something does not look outward, nothing falls, or there are more than MOST vertices.

        Args:
            V: (n, 3) positions.
            centre: (3,) c.
            steps: as many; `steps_of` the number of vertices by default.

        """
        size = float(measures.norm(V - centre).mean())
        start = P = np.ascontiguousarray((V - centre) / size)
        at = self._energy(P)
        if at is None or self._n > MOST or not self._metric.refreshed(P):
            return V
        metric, memory = self._metric, _Memory()
        for _ in range(steps_of(self._n) if steps is None else steps):
            move = -memory.solved(at.gradient, metric)
            found = _fallen(P, at, move, self._energy)
            if found is None:
                if not memory.pairs and metric.by_diagonal:
                    break
                metric.by_diagonal, memory = metric.by_diagonal or not memory.pairs, _Memory()
                continue
            moved, there = found
            memory.remember(moved - P, there.gradient - at.gradient)
            P, at = moved, there
        return V if P is start else np.asfortranarray(centre + size * P)


class _Metric:
    """The Laplacian that steps begin with."""

    def __init__(self, n: int, F: Ints, barrier: float) -> None:
        # Loads scipy's solvers, which take longer than a small mesh does: only when they are needed.
        from spherify.geometry.sparse import SymmetricSolver  # noqa: PLC0415

        self._n, self._F = n, F
        self._share = barrier * 4 * np.pi / len(F) ** 2
        tails, heads = F.reshape(-1), np.roll(F, -1, axis=1).reshape(-1)
        keys, self._edge = np.unique(
            np.minimum(tails, heads) * n + np.maximum(tails, heads), return_inverse=True
        )
        self._edges = np.stack([keys // n, keys % n], axis=1)
        self._solver = SymmetricSolver(n, self._edges)
        self._factors: Callable[[Floats], Floats]
        self._diagonal: Floats
        self._shares: Floats  # (n, 1) of what moves all alike
        self.by_diagonal = False  # for triangles that differ by more than factors have digits

    def refreshed(self, P: Floats) -> bool:
        """Make it anew for positions (n, 3) from the centre; whether it can be factorised."""
        seen, flat = _as_seen(P, self._F)
        squares = measures.dot(P, P)[self._F].mean(axis=1)
        apart = self._share / (measures.face_areas(seen, flat) * squares)
        areas = measures.face_areas(P, self._F)
        by_corner = cotangents(P, self._F) / float(areas.sum())
        by_corner += cotangents(seen, flat) * apart[:, None]
        from_corner = np.roll(by_corner, 1, axis=1)  # the edge from corner k is opposite corner k - 1
        weights = measures.scatter(self._edge, 0.5 * from_corner.reshape(-1), len(self._edges))
        tails, heads = (measures.scatter(self._edges[:, k], weights, self._n) for k in range(2))
        diagonal = tails + heads
        factors = self._solver.factorised((1 + ANCHORED) * diagonal, -weights)
        if factors is not None:
            at_vertices = measures.sum_at_vertices(areas, self._F, self._n)
            centroid = (at_vertices[:, None] * P).sum(axis=0) / at_vertices.sum()
            held = at_vertices if (abs(centroid) < ABOUT).all() else diagonal
            self._factors, self._diagonal = factors, diagonal[:, None]
            self._shares = (held / held.sum())[:, None]
            self.by_diagonal = False
        return factors is not None

    def solve(self, B: Floats) -> Floats:
        """(n, 3) X of L X = B, but for what would move all alike, of which L knows nothing.

        A centroid that is the centre stays it; another one may come nearer. With ``by_diagonal`` L is its diagonal.
        """
        B = B - self._shares * B.sum(axis=0)
        X = B / self._diagonal if self.by_diagonal else self._factors(B)
        moves: Floats = X - (self._shares * X).sum(axis=0)
        return moves


def _as_seen(P: Floats, F: Ints) -> tuple[Floats, Ints]:
    """Return corners (3m, 3) of the triangles of directions, each flat across its middle one, and faces (m, 3) of them.

    The plane triangle of three directions near a great circle stands upright, and has an area however small det is.
    """
    U = measures.normalised(P)
    corners = [measures.gather(U, F[:, k]) for k in range(3)]
    middle = measures.normalised(corners[0] + corners[1] + corners[2])
    flat = [corner - measures.dot(corner, middle)[:, None] * middle for corner in corners]
    return np.concatenate(flat), np.arange(F.size).reshape(3, -1).T


class _Memory:
    """The last moves, what the gradient changed by with each, and their products."""

    def __init__(self) -> None:
        self.pairs: deque[tuple[Floats, Floats, float]] = deque(maxlen=REMEMBERED)

    def remember(self, move: Floats, change: Floats) -> None:
        """Remember a move (n, 3), but for one along which the gradient falls."""
        product = float((change * move).sum())
        if product > 0:
            self.pairs.append((move, change, product))

    def solved(self, gradient: Floats, metric: _Metric) -> Floats:
        """(n, 3) the gradient by the inverse of what is known of the Hessian."""
        left, shares = gradient, []
        for move, change, product in reversed(self.pairs):
            shares.append(float((move * left).sum()) / product)
            left = left - shares[-1] * change
        found = metric.solve(left)
        for (move, change, product), share in zip(self.pairs, reversed(shares), strict=True):
            found = found + (share - float((change * found).sum()) / product) * move
        return found


def _fallen(
    P: Floats, at: Energy, move: Floats, energy: Callable[[Floats], Energy | None]
) -> tuple[Floats, Energy] | None:
    """Return positions along the move at which E is less, and E there."""
    slope, share = float((move * at.gradient).sum()), 1.0
    for _ in range(HALVINGS if slope < 0 else 0):
        moved = P + share * move
        there = energy(moved)
        if there is not None and there.value < at.value + FALLS * share * slope:
            return moved, there
        share /= 2
    return None
