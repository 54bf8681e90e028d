"""Vertices taken out of a triangulation and put back in plain Python: what the machine code is held against."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from spherify.geometry import measures
from spherify.geometry.mesh import Floats, Ints
from spherify.geometry.thinning import (
    BEYOND,
    BY_DEGREE,
    BY_FOUR,
    BY_INWARD,
    BY_SIDES,
    BY_THREE,
    COUNTED,
    EASY,
    MOST_SIDES,
    SHARE,
    SHORTENED,
    Thinning,
    looking_outward,
    pull_of,
    uneven,
)

Corners = list[int]
Point = tuple[float, float, float]
T = TypeVar("T")


class _Merge(NamedTuple):
    """A vertex that is taken out: its neighbours in order, beginning with the one it is merged into."""

    vertex: int
    ring: Corners


class _Triangulation:
    """Triangles around vertices: ``after[p][q]`` is r if p, q, r is one, counter-clockwise seen from outside."""

    def __init__(self, n: int, F: Ints) -> None:
        self.after: list[dict[int, int]] = [{} for _ in range(n)]
        for a, b, c in F.tolist():
            self.after[a][b] = c
            self.after[b][c] = a
            self.after[c][a] = b

    def ring(self, p: int) -> Corners:
        """Return the neighbours in order."""
        after = self.after[p]
        found = [next(iter(after))]
        while len(found) < len(after):
            found.append(after[found[-1]])
        return found

    def take_out(self, merge: _Merge) -> None:
        """Merge a vertex."""
        p, ring = merge
        for q, r in _around(ring):
            del self.after[q][r]
            del self.after[r][p]
        self.after[p] = {}
        for q, r in pairwise(ring[1:]):
            self._add(ring[0], q, r)

    def put_back(self, merge: _Merge) -> None:
        """Undo that."""
        p, ring = merge
        for q, r in pairwise(ring[1:]):
            del self.after[ring[0]][q]
            del self.after[q][r]
            del self.after[r][ring[0]]
        for q, r in _around(ring):
            self._add(p, q, r)

    def faces(self, vertices: Corners) -> Ints:
        """(m, 3) the triangles, of which all corners are among these, numbered by them."""
        numbers = {p: number for number, p in enumerate(vertices)}
        return np.array(
            [
                (number, numbers[q], numbers[r])
                for p, number in numbers.items()
                for q, r in self.after[p].items()
                if p < q and p < r
            ]
        )

    def _add(self, a: int, b: int, c: int) -> None:
        self.after[a][b] = c
        self.after[b][c] = a
        self.after[c][a] = b


class PlainThinning(Thinning):
    """See `Thinning`."""

    most = 2_000  # as many take up to twenty seconds, more around hubs

    def __init__(self, U: Floats, F: Ints) -> None:
        self.triangles = _Triangulation(len(U), F)
        self.levels: list[list[_Merge]] = []
        self._left = set(range(len(U)))
        self._points = _rows(U)
        self._known: dict[int, tuple[float, _Merge] | None] = {}  # what `_best` has found, while it holds
        self._least, inward = looking_outward(U, F)
        self._bad = set(inward.tolist())

    @property
    def left(self) -> Ints:
        """See `Thinning.left`."""
        return np.array(sorted(self._left))

    @property
    def out(self) -> bool:
        """See `Thinning.out`."""
        return bool(self.levels)

    def faces(self) -> Ints:
        """See `Thinning.faces`."""
        return self.triangles.faces(sorted(self._left))

    def put_back(self, U: Floats) -> bool:
        """See `Thinning.put_back`."""
        level = self.levels[-1]
        while level:
            place = _place(U[level[-1].ring])
            if place is None:
                return False
            merge = level.pop()
            self.triangles.put_back(merge)
            U[merge.vertex] = place
            self._left.add(merge.vertex)
        self.levels.pop()
        return True

    def relax(self, U: Floats, sweeps: int) -> None:
        """See `Thinning.relax`."""
        pull, points = pull_of(len(self._left)), _rows(U)
        rings = [(p, self.triangles.ring(p)) for p in sorted(self._left)]
        for _ in range(sweeps):
            for p, ring in rings:
                _centre(points, p, ring, pull)
        U[:] = points

    def _none_outward(self) -> None:
        self._bad, self._least = set(self._left), np.inf
        self._known.clear()

    def _counts(self) -> tuple[int, int]:
        return len(self._left), len(self._bad)

    def _level(self, *, inward: bool) -> bool:
        """See `Thinning._level`."""
        among = self._bad if inward else self._left
        after = self.triangles.after
        few = [p for p in among if len(after[p]) <= EASY]
        costs = sorted((found[0], p) for p in few or among if (found := self._best(p)) is not None)
        if not costs:
            return False
        level: list[_Merge] = []
        touched: set[int] = set()
        dearest = costs[len(costs) // 2][0]
        for cost, p in costs:
            if len(self._left) <= 4 or len(level) > SHARE * len(self._left) or cost > dearest:
                break
            found = None if p in touched else self._best(p)
            if found is None or (level and (found[0] > cost or p not in self._bad)):
                continue
            merge = found[1]
            self.triangles.take_out(merge)
            self._left.remove(p)
            self._bad.discard(p)
            touched.update(merge.ring)
            level.append(merge)
            self._forget(merge.ring)
            self._look_at(merge.ring)
        self.levels.append(level)
        return True

    def _forget(self, ring: Corners) -> None:
        """Forget what is two edges from these at most, as far as `_narrow` looks."""
        after = self.triangles.after
        for p in {s for q in ring for r in after[q] for s in after[r]}.union(ring):
            self._known.pop(p, None)

    def _look_at(self, vertices: Corners) -> None:
        """See anew which of these have a triangle that does not look outward."""
        for p in vertices:
            if all(self._outward(p, q, r) for q, r in self.triangles.after[p].items()):
                self._bad.discard(p)
            else:
                self._bad.add(p)

    def _outward(self, a: int, b: int, c: int) -> bool:
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = (self._points[p] for p in (a, b, c))
        ux, uy, uz, vx, vy, vz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
        return ax * (uy * vz - uz * vy) + ay * (uz * vx - ux * vz) + az * (ux * vy - uy * vx) > self._least

    def _best(self, p: int) -> tuple[float, _Merge] | None:
        """Return what costs least of the ways to take a vertex out, None if there is none."""
        if p not in self._known:
            self._known[p] = self._searched(p)
        return self._known[p]

    def _searched(self, p: int) -> tuple[float, _Merge] | None:
        ring, after = self.triangles.ring(p), self.triangles.after
        if len(ring) == 3 and min(len(after[q]) for q in ring) <= 3:
            return None
        ways = [ring[k:] + ring[:k] for k in range(len(ring))]
        best: tuple[float, _Merge] | None = None
        for least, way in sorted((self._least_cost(way), way) for way in ways if self._possible(way)):
            if best is not None and least >= best[0]:
                break
            threes, fours = self._narrow(way)
            cost = least + BY_THREE * threes + BY_FOUR * fours
            if best is None or cost < best[0]:
                best = cost, _Merge(p, way)
        return best

    def _possible(self, ring: Corners) -> bool:
        """Whether a vertex with these neighbours can be merged into the first: it leaves a triangulation."""
        after, q, right, left = self.triangles.after, ring[0], ring[1], ring[-1]
        if len(ring) == 3:
            return True
        return min(len(after[right]), len(after[left])) > 3 and not any(r in after[q] for r in ring[2:-1])

    def _least_cost(self, ring: Corners) -> float:
        """Return what it costs to do so, narrow places apart."""
        after, d, q, right, left = self.triangles.after, len(ring), ring[0], ring[1], ring[-1]
        changes = {q: d - 4, right: -1, left: -1} if d > 3 else dict.fromkeys(ring, -1)
        cost = -uneven(d)
        for r, more in changes.items():
            degree = len(after[r])
            cost += uneven(degree + more) - uneven(degree)
        counted = self._least < np.inf
        inward = counted and sum(not self._outward(q, a, b) for a, b in pairwise(ring[1:]))
        return BY_DEGREE * cost + BY_INWARD * inward + BY_SIDES * min(d - 3, MOST_SIDES - 2)

    def _narrow(self, ring: Corners) -> tuple[int, int]:
        """Count the rings of three and of four edges that new edges would close, but those around vertices."""
        after, q, near = self.triangles.after, ring[0], set(ring)
        right, left, around_q = ring[1], ring[-1], after[ring[0]]
        p = after[q][right]
        threes = 0
        for before, r, behind in zip(ring[1:-2], ring[2:-1], ring[3:], strict=True):
            facial = {before, behind, p, q}
            threes += sum(x not in facial and (x in around_q or x in near) for x in after[r])
        fours = 0
        others = around_q.keys() - {p, right, left}
        for x in ring[2:-1]:
            for y in after[x]:
                if y in around_q or y in near:
                    continue
                for z in after[y].keys() & others:  # of a hub's many neighbours few
                    if z not in after[x]:
                        fours += not any({x, y, z} <= after[side].keys() for side in (left, right))
            if fours >= COUNTED:
                break
        return min(threes, COUNTED), min(fours, COUNTED)


def _around(ring: list[T]) -> list[tuple[T, T]]:
    return list(zip(ring, ring[1:] + ring[:1], strict=True))


def _rows(U: Floats) -> list[Point]:
    return cast(list[Point], [tuple(row) for row in U.tolist()])


def _place(R: Floats) -> NDArray[np.float64] | None:
    """Return the direction from which all edges of a ring (d, 3) are seen best, of some; None if from none."""
    sides = measures.normalised(measures.cross(R, np.roll(R, -1, axis=0)))
    size = float(measures.norm(R - R[0]).max())
    aims = (R.mean(axis=0) - R[0], R[1:].mean(axis=0) - R[0], (sides[0] + sides[-1]) * size)
    tried = R[0] + np.concatenate([SHORTENED[:, None] * aim for aim in aims])
    tried = measures.normalised(tried)
    heights = (tried[:, None] * sides).sum(axis=2).min(axis=1)  # a product of matrices differs by machine
    best = int(heights.argmax())
    return tried[best] if heights[best] > 0 else None


def _centre(U: list[Point], p: int, ring: Corners, pull: float) -> None:
    """Move one vertex, see `Thinning.relax`."""
    here, d = U[p], len(ring)
    one, other = _across(here)
    offsets = [_minus(U[q], here) for q in ring]
    gu = gv = huu = huv = hvv = 0.0
    for a, b in _around(offsets):
        area = _cross(a, b)
        height = _dot(here, area)
        side = _cross(here, _minus(b, a))
        slope = (side[0] + area[0], side[1] + area[1], side[2] + area[2])
        u, v = _dot(one, slope) / height, _dot(other, slope) / height
        # On the sphere |p - q|² = 2 - 2 p·q, and log det has the logarithm of |p|, which is 1, for each triangle.
        bend = pull * (1 - 0.5 * _dot(b, b))
        gu, gv = gu + u + pull * _dot(b, one), gv + v + pull * _dot(b, other)
        huu, huv, hvv = huu + u * u + bend, huv + u * v, hvv + v * v + bend
    huu, hvv = huu + d, hvv + d
    det = huu * hvv - huv * huv
    u, v = (hvv * gu - huv * gv) / det, (huu * gv - huv * gu) / det
    damped = BEYOND / (1 + BEYOND * math.sqrt(max(u * gu + v * gv, 0.0)))
    x, y, z = (here[k] + damped * (u * one[k] + v * other[k]) for k in range(3))
    length = math.sqrt(x * x + y * y + z * z)
    there = (x / length, y / length, z / length)
    offsets = [_minus(U[q], there) for q in ring]
    if all(_dot(there, _cross(a, b)) > 0 for a, b in _around(offsets)):  # else by rounding
        U[p] = there


def _across(u: Point) -> tuple[Point, Point]:
    """Return two directions across one: Duff and others, "Building an orthonormal basis, revisited", 2017."""
    x, y, z = u
    sign = math.copysign(1.0, z)
    by = -1 / (sign + z)
    return (1 + sign * x * x * by, sign * x * y * by, -sign * x), (x * y * by, sign + y * y * by, -y)


def _minus(a: Point, b: Point) -> Point:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _dot(a: Point, b: Point) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Point, b: Point) -> Point:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
