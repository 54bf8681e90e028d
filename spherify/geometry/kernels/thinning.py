"""Vertices taken out of a triangulation and put back, by machine code."""

from __future__ import annotations

import numpy as np

from spherify.geometry.kernels.passes.linking import COUNTS, INWARD, LEFT, OUT, Triangulation
from spherify.geometry.kernels.passes.merging import faces, take_level
from spherify.geometry.kernels.passes.narrow import find
from spherify.geometry.kernels.passes.placing import put_back, relax
from spherify.geometry.mesh import Floats, Ints
from spherify.geometry.thinning import EASY, SHORTENED, Thinning, looking_outward, pull_of


class CompiledThinning(Thinning):
    """See `spherify.geometry.thinning`."""

    most = 300_000

    def __init__(self, U: Floats, F: Ints) -> None:
        n = len(U)
        self._U = np.ascontiguousarray(U)
        self._least, inward = looking_outward(U, F)
        self._t = _triangulation(n, F)
        self._t.inward[inward] = True
        self._t.counts[LEFT], self._t.counts[INWARD] = n, len(inward)
        self._ends: list[int] = []  # how many are out before each level
        self._sides, self._numbers = np.empty((n, 3)), np.empty(n, dtype=np.int64)

    @property
    def left(self) -> Ints:
        """See `Thinning.left`."""
        return np.flatnonzero(self._t.left)

    @property
    def out(self) -> bool:
        """See `Thinning.out`."""
        return bool(self._ends)

    def faces(self) -> Ints:
        """See `Thinning.faces`."""
        left = self.left
        found = np.empty((2 * len(left) - 4, 3), dtype=np.int64)
        faces(self._t, left, self._numbers, found)
        return found

    def put_back(self, U: Floats) -> bool:
        """See `Thinning.put_back`."""
        done = put_back(self._t, U, self._ends[-1], self._sides, SHORTENED)
        if done:
            self._ends.pop()
        return done

    def relax(self, U: Floats, sweeps: int) -> None:
        """See `Thinning.relax`."""
        left = self.left
        relax(self._t, U, left, sweeps, pull_of(len(left)))

    def _none_outward(self) -> None:
        self._t.inward[:] = self._t.left
        self._t.counts[INWARD], self._least = self._t.counts[LEFT], np.inf
        self._t.cost[:] = np.nan

    def _counts(self) -> tuple[int, int]:
        return int(self._t.counts[LEFT]), int(self._t.counts[INWARD])

    def _level(self, *, inward: bool) -> bool:
        """See `Thinning._level`."""
        t = self._t
        among = np.flatnonzero(t.inward if inward else t.left)
        few = among[t.degrees[among] <= EASY]
        among = few if len(few) else among
        find(t, self._U, among, self._least)
        among = among[t.cost[among] < np.inf]
        if not len(among):
            return False
        order = among[np.argsort(t.cost[among], kind="stable")]
        costs = t.cost[order]
        self._ends.append(int(t.counts[OUT]))
        take_level(t, self._U, order, costs, float(costs[len(costs) // 2]), self._least)
        return True


def _triangulation(n: int, F: Ints) -> Triangulation:
    """Return the triangulation of faces (m, 3) of n vertices: half-edge 3·f + k runs from corner k to the next."""
    m3 = F.size
    tails, heads = F.reshape(-1), np.roll(F, -1, axis=1).reshape(-1)
    forth, back = np.argsort(tails * n + heads), np.argsort(heads * n + tails)
    twins, before = np.empty(m3, dtype=np.int32), np.empty(m3, dtype=np.int32)
    twins[back] = forth
    after = twins[np.arange(m3).reshape(-1, 3)[:, [2, 0, 1]].reshape(-1)]
    before[after] = np.arange(m3)
    first = np.empty(n, dtype=np.int32)
    first[tails[::-1]] = np.arange(m3)[::-1]
    return Triangulation(
        heads=heads.astype(np.int32),
        twins=twins,
        after=after,
        before=before,
        first=first,
        degrees=np.bincount(tails, minlength=n).astype(np.int32),
        cost=np.full(n, np.nan),
        along=np.zeros(n, dtype=np.int32),
        inward=np.zeros(n, dtype=np.bool_),
        left=np.ones(n, dtype=np.bool_),
        touched=np.zeros(n, dtype=np.int32),
        seen=np.zeros(n, dtype=np.int64),
        least=np.empty(n),
        merged=np.empty(n, dtype=np.int32),
        counts=np.zeros(COUNTS, dtype=np.int64),
    )
