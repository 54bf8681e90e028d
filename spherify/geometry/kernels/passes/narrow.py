"""What it costs to merge a vertex of a triangulation into a neighbour; see `spherify.geometry.thinning`."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from spherify.geometry.kernels.passes.jit import entry, inner
from spherify.geometry.kernels.passes.linking import ROUND, TRIANGLE, Numbers, Triangulation, joined, possible
from spherify.geometry.kernels.passes.types import Floats
from spherify.geometry.thinning import (
    BY_DEGREE,
    BY_FOUR,
    BY_INWARD,
    BY_SIDES,
    BY_THREE,
    COUNTED,
    EASY,
    MOST_SIDES,
    REGULAR,
)

NOWHERE: Final = -1


@inner
def outward(U: Floats, a: int, b: int, c: int, least: float) -> bool:
    """Whether the volume between a triangle and the centre is more than that."""
    ax, ay, az = U[a, 0], U[a, 1], U[a, 2]
    ux, uy, uz = U[b, 0] - ax, U[b, 1] - ay, U[b, 2] - az
    vx, vy, vz = U[c, 0] - ax, U[c, 1] - ay, U[c, 2] - az
    volume = ax * (uy * vz - uz * vy) + ay * (uz * vx - ux * vz) + az * (ux * vy - uy * vx)
    return bool(volume > least)


@inner
def uneven(degree: int) -> int:
    """See `spherify.geometry.thinning.uneven`."""
    beyond = degree - EASY
    if beyond <= 0:
        return (degree - REGULAR) ** 2
    return (EASY - REGULAR) * (EASY - REGULAR + 2 * beyond)


@inner
def least_cost(t: Triangulation, U: Floats, h: int, least: float) -> float:
    """Return what it costs to merge the vertex that a half-edge comes from along it, narrow places apart."""
    q, p = t.heads[h], t.heads[t.twins[h]]
    d = t.degrees[p]
    right, left = t.after[h], t.before[h]
    change = d - 4 if d > TRIANGLE else -1
    cost = uneven(t.degrees[q] + change) - uneven(t.degrees[q]) - uneven(d)
    for g in (right, left):
        degree = t.degrees[t.heads[g]]
        cost += uneven(degree - 1) - uneven(degree)
    inward = 0
    g = right if least < np.inf else left
    while g != left:
        inward += not outward(U, q, t.heads[g], t.heads[t.after[g]], least)
        g = t.after[g]
    sides = min(d - 3, MOST_SIDES - 2)
    return float(BY_DEGREE * cost + BY_INWARD * inward + BY_SIDES * sides)


@inner
def rings_of_three(t: Triangulation, h: int, round_: int) -> int:
    """Count the rings of three edges that new edges would close; what is ``seen`` is around p or q."""
    q, p = t.heads[h], t.heads[t.twins[h]]
    left, found = t.before[h], 0
    g = t.after[t.after[h]]
    while g != left:
        before, behind = t.heads[t.before[g]], t.heads[t.after[g]]
        r = t.heads[g]
        s = t.first[r]
        for _ in range(t.degrees[r]):
            x = t.heads[s]
            facial = x in (before, behind, p, q)
            found += not facial and t.seen[x] >= round_
            s = t.after[s]
        g = t.after[g]
    return min(found, COUNTED)


@inner
def parted(t: Triangulation, h: int, x: int, y: int, z: int) -> bool:
    """Whether the ring of q, z, y and x parts the surface, and is not around one vertex."""
    if joined(t, x, z):
        return False
    for side in (t.heads[t.after[h]], t.heads[t.before[h]]):
        if joined(t, side, x) and joined(t, side, y) and joined(t, side, z):
            return False
    return True


@inner
def rings_of_four(t: Triangulation, h: int, round_: int) -> int:
    """Count the rings of four edges that new edges would close; ``seen`` as before, and one more around q."""
    q, p = t.heads[h], t.heads[t.twins[h]]
    right, left = t.heads[t.after[h]], t.heads[t.before[h]]
    found, around_q = 0, round_ + 1
    g = t.after[t.after[h]]
    while g != t.before[h] and found < COUNTED:
        x = t.heads[g]
        s = t.first[x]
        for _ in range(t.degrees[x]):
            y = t.heads[s]
            s = t.after[s]
            if t.seen[y] >= round_:
                continue
            by_q = t.degrees[y] > t.degrees[q]  # a hub
            e = t.first[q] if by_q else t.first[y]
            for _ in range(t.degrees[q] if by_q else t.degrees[y]):
                z = t.heads[e]
                e = t.after[e]
                if t.seen[z] == around_q and z not in (p, right, left) and (not by_q or joined(t, z, y)):
                    found += parted(t, h, x, y, z)
        g = t.after[g]
    return min(found, COUNTED)


@inner
def narrow(t: Triangulation, h: int) -> tuple[int, int]:
    """Count the narrow places that new edges would leave: rings of three edges, and of four."""
    q, p = t.heads[h], t.heads[t.twins[h]]
    t.counts[ROUND] += 2
    round_ = t.counts[ROUND]
    for v, number in ((p, round_), (q, round_ + 1)):
        g = t.first[v]
        for _ in range(t.degrees[v]):
            t.seen[t.heads[g]] = number
            g = t.after[g]
    return rings_of_three(t, h, round_), rings_of_four(t, h, round_)


@inner
def search(t: Triangulation, U: Floats, p: int, least: float) -> None:
    """Find where a vertex is merged at the least cost."""
    d, start = t.degrees[p], t.first[p]
    t.cost[p], t.along[p] = np.inf, NOWHERE
    fewest, g = t.degrees[t.heads[start]], start
    for k in range(d):
        fewest = min(fewest, t.degrees[t.heads[g]])
        t.least[k] = least_cost(t, U, g, least) if possible(t, g) else np.inf
        g = t.after[g]
    if d == TRIANGLE and fewest <= TRIANGLE:
        return
    while True:  # the ways by what they cost at least, ties by the neighbour, until none can cost less
        at, way, g = NOWHERE, start, start
        for k in range(d):
            nearer = at == NOWHERE or t.least[k] < t.least[at]
            if nearer or (t.least[k] == t.least[at] and t.heads[g] < t.heads[way]):
                at, way = k, g
            g = t.after[g]
        if not t.least[at] < t.cost[p]:
            return
        threes, fours = narrow(t, way)
        cost = t.least[at] + BY_THREE * threes + BY_FOUR * fours
        if cost < t.cost[p]:
            t.cost[p], t.along[p] = cost, way
        t.least[at] = np.inf


@entry
def find(t: Triangulation, U: Floats, among: Numbers, least: float) -> None:
    """Find what merging costs.

    Args:
        t: the triangulation.
        U: (n, 3) directions.
        among: (k,) vertices, of which those are looked at of which it is not known.
        least: volume of triangles that look outward.

    """
    for p in among:
        if math.isnan(t.cost[p]):
            search(t, U, p, least)
