"""A closed triangulation as half-edges linked around vertices, which are merged into neighbours, and put back.

What is taken out keeps its own links, so that it is put back, last out first in, by what it remembers, as in Knuth,
"Dancing links", 2000: the half-edges from p become q's in the order that they are in, and p's again.
"""

from __future__ import annotations

from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from spherify.geometry.kernels.passes.jit import inner
from spherify.geometry.kernels.passes.types import Floats

Links: TypeAlias = NDArray[np.int32]
Flags: TypeAlias = NDArray[np.bool_]
Numbers: TypeAlias = NDArray[np.int64]

OUT, LEFT, INWARD, ROUND, LEVEL, COUNTS = range(6)  # places of `Triangulation.counts`, and how many
TRIANGLE: Final = 3


class Triangulation(NamedTuple):
    """Half-edges around vertices, and what is known of merging these.

    Attributes:
        heads: (3m,) the vertex each half-edge leads to.
        twins: (3m,) the half-edge back.
        after: (3m,) the next half-edge from the same vertex, counter-clockwise seen from outside.
        before: (3m,) the one before it.
        first: (n,) a half-edge from each vertex.
        degrees: (n,) numbers of neighbours.
        cost: (n,) of merging each vertex where it costs least; inf if that cannot be done, nan if it is not known.
        along: (n,) the half-edge to merge it along.
        inward: (n,) whether a triangle around it does not look outward.
        left: (n,) whether it is not taken out.
        touched: (n,) the level in which its neighbours changed last.
        seen: (n,) scratch, the number of the round that marked it.
        least: (n,) scratch.
        merged: (n,) the half-edges that vertices were merged along, in order.
        counts: (COUNTS,) how many are merged, how many left, how many of these INWARD; the ROUND and the LEVEL.

    """

    heads: Links
    twins: Links
    after: Links
    before: Links
    first: Links
    degrees: Links
    cost: Floats
    along: Links
    inward: Flags
    left: Flags
    touched: Links
    seen: Numbers
    least: Floats
    merged: Links
    counts: Numbers


@inner
def joined(t: Triangulation, p: int, q: int) -> bool:
    """Whether two vertices are neighbours."""
    if t.degrees[p] > t.degrees[q]:
        p, q = q, p
    h = t.first[p]
    for _ in range(t.degrees[p]):
        if t.heads[h] == q:
            return True
        h = t.after[h]
    return False


@inner
def possible(t: Triangulation, h: int) -> bool:
    """Whether the vertex that a half-edge comes from can be merged along it: that leaves a triangulation."""
    q, p = t.heads[h], t.heads[t.twins[h]]
    if t.degrees[p] == TRIANGLE:
        return True
    right, left = t.after[h], t.before[h]
    if t.degrees[t.heads[right]] <= TRIANGLE or t.degrees[t.heads[left]] <= TRIANGLE:
        return False
    g = t.after[right]
    while g != left:
        if joined(t, t.heads[g], q):
            return False
        g = t.after[g]
    return True


@inner
def link(t: Triangulation, one: int, other: int) -> None:
    """Let one half-edge be after another."""
    t.after[one] = other
    t.before[other] = one


@inner
def cut(t: Triangulation, h: int) -> None:
    """Take a half-edge out of its circle."""
    link(t, t.before[h], t.after[h])
    t.first[t.heads[t.twins[h]]] = t.after[h]


@inner
def mend(t: Triangulation, h: int) -> None:
    """Undo that."""
    t.after[t.before[h]] = h
    t.before[t.after[h]] = h
    t.first[t.heads[t.twins[h]]] = h


@inner
def give(t: Triangulation, first: int, last: int, to: int) -> None:
    """Let half-edges one after another come from a vertex."""
    g = first
    while True:
        t.heads[t.twins[g]] = to
        if g == last:
            return
        g = t.after[g]


@inner
def take_out(t: Triangulation, h: int) -> None:
    """Merge the vertex that a half-edge comes from along it."""
    q, p = t.heads[h], t.heads[t.twins[h]]
    right, left, back = t.after[h], t.before[h], t.twins[h]
    d = t.degrees[p]
    t.degrees[t.heads[right]] -= 1
    t.degrees[t.heads[left]] -= 1
    t.degrees[q] += d - 4 if d > TRIANGLE else -1
    onward, hither = t.before[back], t.after[back]  # from q to the right and to the left
    cut(t, t.twins[right])
    cut(t, t.twins[left])
    if d > TRIANGLE:
        first, last = t.after[right], t.before[left]
        give(t, first, last, q)
        link(t, onward, first)
        link(t, last, hither)
    else:
        link(t, onward, hither)
    t.first[q] = onward
    t.merged[t.counts[OUT]] = h
    t.counts[OUT] += 1
    t.counts[LEFT] -= 1
    t.left[p] = False
    if t.inward[p]:
        t.inward[p] = False
        t.counts[INWARD] -= 1


@inner
def undo(t: Triangulation, p: int, h: int) -> None:
    """Put the vertex back that was taken out last."""
    q, right, left = t.heads[h], t.after[h], t.before[h]
    d = t.degrees[p]
    if d > TRIANGLE:
        first, last = t.after[right], t.before[left]
        give(t, first, last, p)
        t.before[first] = right
        t.after[last] = left
    mend(t, t.twins[h])
    mend(t, t.twins[right])
    mend(t, t.twins[left])
    t.degrees[t.heads[right]] += 1
    t.degrees[t.heads[left]] += 1
    t.degrees[q] -= d - 4 if d > TRIANGLE else -1
    t.first[p] = h
    t.left[p] = True
    t.counts[OUT] -= 1
    t.counts[LEFT] += 1
