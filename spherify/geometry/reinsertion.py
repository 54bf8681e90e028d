"""Directions that nothing unfolds are set anew: vertices are taken out until what is left looks outward, and put back.

A surface wound around itself, or limbs of which unfolding has left less than rounding tells apart, have directions
that no more moving helps. Their triangulation is that of a sphere, all the same. So a vertex p of a triangle that
looks inward, or has vanished, is merged into a neighbour q, p's other neighbours becoming q's; and so on with what is
left, a tetrahedron at last, until all triangles look outward and cover the sphere once. Put back in reverse order, a
vertex has its place within the ring of its neighbours, near q if nowhere else, where all its triangles look outward.
Now and then directions make room for each other (`spherify.geometry.finish`), or the last would have none.

Progressive meshes are of Hoppe, 1996, and a sphere is had from them by Praun and Hoppe, "Spherical parametrization and
remeshing", 2003. Which vertex is merged is ours. Vertices should have six neighbours, and no three, four or five edges
should part the surface otherwise than around a vertex: what is behind such a narrow place has no room on the sphere.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spherify.geometry import measures
from spherify.geometry.covering import covering
from spherify.geometry.finish import Energies, energies, finished
from spherify.geometry.mesh import Floats, Ints

MOST: Final = 10_000  # vertices: as many take some ten seconds, more around hubs; a run hears nothing then
LEAST: Final = 1e-5  # of the mean volume between a triangle of directions and the centre, for it to stay
SHARE: Final = 0.3  # of the vertices, that are taken out in a level at most
EASY: Final = 12  # neighbours, of a vertex that is taken out before those with more
REGULAR: Final = 6  # neighbours
BY_DEGREE: Final = 0.1  # cost of the squares of how many neighbours more or fewer there are
BY_THREE: Final = 6.0  # cost of a ring of three edges
BY_FOUR: Final = 3.0  # cost of a ring of four
COUNTED: Final = 3  # rings, at most
BY_INWARD: Final = 2.0  # cost of a triangle that does not look outward
AFTERWARDS: Final = 100_000  # steps times vertices, after a level
AT_ONCE: Final = 0.03  # share of the vertices, that are put back before directions make room
STEPS: Final = (10, 100)  # at least and at most
ROOM: Final = 0.3  # barrier of that, as of the climb
FEWEST: Final = 8  # vertices that can make room
SHORTENED: Final = 10.0 ** -np.linspace(0, 10, 31)  # of the way from q, where a place is looked for

Corners = list[int]
Point = list[float]


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


class _Removal:
    """Takes vertices out, level by level, until all that is left looks outward."""

    def __init__(self, U: Floats, F: Ints) -> None:
        self.triangles = _Triangulation(len(U), F)
        self.left = set(range(len(U)))
        self.levels: list[list[_Merge]] = []
        self._points: list[Point] = U.tolist()
        self._known: dict[int, tuple[float, _Merge] | None] = {}  # what `_best` has found, while it holds
        volumes = _volumes(U, F)
        self._least = LEAST * float(np.abs(volumes).mean())
        self._bad = set(np.unique(F[~(volumes > self._least)]).tolist())

    def until_outward(self) -> bool:
        """Go on while anything looks inward; whether nothing does in the end, or a tetrahedron is left."""
        while self._bad and len(self.left) > 4:
            if not self._level(self._bad):
                self._level(self.left)
        return not self._bad

    def until_four(self) -> None:
        """Go on until a tetrahedron is left; each triangulation that is larger has an edge to merge along."""
        self._bad, self._least = set(self.left), np.inf
        self._known.clear()
        while len(self.left) > 4:
            self._level(self.left)

    def _level(self, among: set[int]) -> bool:
        """Take out vertices of which no two are neighbours, those that cost least; whether there was one."""
        after = self.triangles.after
        few = [p for p in among if len(after[p]) <= EASY]
        costs = sorted((found[0], p) for p in few or among if (found := self._best(p)) is not None)
        if not costs:
            return False
        level: list[_Merge] = []
        touched: set[int] = set()
        dearest = costs[len(costs) // 2][0]
        for cost, p in costs:
            if len(self.left) <= 4 or len(level) > SHARE * len(self.left) or cost > dearest:
                break
            found = None if p in touched else self._best(p)
            if found is None or (level and (found[0] > cost or p not in self._bad)):
                continue
            merge = found[1]
            self.triangles.take_out(merge)
            self.left.remove(p)
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
        ways = [ring[k:] + ring[:k] for k in range(len(ring) if len(ring) > 3 else 1)]
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
        cost = -_uneven(d)
        for r, more in changes.items():
            degree = len(after[r])
            cost += _uneven(degree + more) - _uneven(degree)
        inward = sum(not self._outward(q, a, b) for a, b in pairwise(ring[1:]))
        return BY_DEGREE * cost + BY_INWARD * inward

    def _narrow(self, ring: Corners) -> tuple[int, int]:
        """Count the rings of three and of four edges that new edges would close, but those around vertices."""
        after, q, near = self.triangles.after, ring[0], set(ring)
        right, left, around_q = ring[1], ring[-1], after[ring[0]]
        p = after[right][q]
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


def reinserted(V: Floats, F: Ints, centre: Floats, by: Energies = energies) -> Floats | None:
    """Set directions anew where they do not look outward, and let all make room; None if that cannot be done.

    Args:
        V: (n, 3) positions.
        F: (m, 3) faces, of one closed surface of genus 0.
        centre: (3,) that directions are from.
        by: who computes energies.

    Returns:
        (n, 3) positions on a sphere about the centre, of the mean radius; all faces look outward from it.

    """
    spokes = V - centre
    radius = float(measures.norm(spokes).mean())
    if len(V) > MOST or not 0 < radius < np.inf:
        return None
    start = np.ascontiguousarray(measures.normalised(spokes))
    for keep in (True, False):
        U, removal = start.copy(), _Removal(start, F)
        if not (keep and removal.until_outward() and _covers_once(U, removal)):
            removal.until_four()
            _as_tetrahedron(U, removal)
        if _put_back(U, removal, by) and (_volumes(U, F) > 0).all():
            return np.asfortranarray(centre + radius * U)
    return None


def _uneven(degree: int) -> int:
    """Return the square of how many neighbours more or fewer there are; of more than EASY it grows linearly.

    Else all around a hub would cost more with each that is taken out, and no two be taken out in a level.
    """
    beyond = degree - EASY
    return (degree - REGULAR) ** 2 if beyond <= 0 else (EASY - REGULAR) * (EASY - REGULAR + 2 * beyond)


def _put_back(U: Floats, removal: _Removal, by: Energies) -> bool:
    """Give all that was taken out a direction in U (n, 3), in reverse order; whether there was one for each."""
    left, triangles, waiting = sorted(removal.left), removal.triangles, 0
    for level in reversed(removal.levels):
        for merge in reversed(level):
            place = _place(U[merge.ring])
            if place is None:
                _make_room(U, left, triangles, by)
                place = _place(U[merge.ring])
            if place is None:
                return False
            triangles.put_back(merge)
            U[merge.vertex] = place
            left.append(merge.vertex)
        waiting += len(level)
        if waiting > AT_ONCE * len(left):
            _make_room(U, left, triangles, by)
            waiting = 0
    _make_room(U, left, triangles, by)
    return True


def _make_room(U: Floats, left: Corners, triangles: _Triangulation, by: Energies) -> None:
    if len(left) >= FEWEST:
        steps = min(max(AFTERWARDS // len(left), STEPS[0]), STEPS[1])
        moved = finished(U[left], triangles.faces(left), np.zeros(3), barrier=ROOM, steps=steps, by=by)
        U[left] = measures.normalised(moved)


def _around(ring: Corners) -> list[tuple[int, int]]:
    return list(zip(ring, ring[1:] + ring[:1], strict=True))


def _volumes(U: Floats, F: Ints) -> Floats:
    """(m,) six times the volumes between triangles and the centre."""
    a, b, c = (measures.gather(U, F[:, k]) for k in range(3))
    return measures.dot(a, measures.cross(b - a, c - a))


def _covers_once(U: Floats, removal: _Removal) -> bool:
    """Whether the directions of what is left cover the sphere once, and not more often."""
    left = sorted(removal.left)
    return covering(U[left], removal.triangles.faces(left), np.zeros(3)).degree == 1


def _as_tetrahedron(U: Floats, removal: _Removal) -> None:
    """Put the four vertices that are left where the corners of a regular tetrahedron are."""
    (a, b, c) = removal.triangles.faces(sorted(removal.left))[0]
    left = sorted(removal.left)
    top = ({0, 1, 2, 3} - {int(a), int(b), int(c)}).pop()
    corners = np.array([[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]) / np.sqrt(3)
    for number, corner in zip((top, a, b, c), corners, strict=True):
        U[left[number]] = corner


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
