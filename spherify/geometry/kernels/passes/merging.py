"""Vertices of a triangulation merged into neighbours, level by level; see `spherify.geometry.thinning`."""

from __future__ import annotations

import math

import numpy as np

from spherify.geometry.kernels.passes.jit import entry, inner
from spherify.geometry.kernels.passes.linking import (
    INWARD,
    LEFT,
    LEVEL,
    TRIANGLE,
    Numbers,
    Triangulation,
    take_out,
)
from spherify.geometry.kernels.passes.narrow import NOWHERE, outward, search
from spherify.geometry.kernels.passes.types import Floats
from spherify.geometry.thinning import SHARE


@inner
def look_at(t: Triangulation, U: Floats, p: int, least: float) -> None:
    """See anew whether all triangles around a vertex look outward."""
    h, inward = t.first[p], False
    for _ in range(t.degrees[p]):
        inward |= not outward(U, p, t.heads[h], t.heads[t.after[h]], least)
        h = t.after[h]
    t.counts[INWARD] += inward
    t.counts[INWARD] -= t.inward[p]
    t.inward[p] = inward


@inner
def forget(t: Triangulation, q: int) -> None:
    """Forget what merging costs up to two edges from a vertex, as far as narrow places are looked for."""
    t.cost[q] = np.nan
    h = t.first[q]
    for _ in range(t.degrees[q]):
        r = t.heads[h]
        g = t.first[r]
        for _ in range(t.degrees[r]):
            t.cost[t.heads[g]] = np.nan
            g = t.after[g]
        h = t.after[h]


@entry
def take_level(
    t: Triangulation, U: Floats, order: Numbers, costs: Floats, dearest: float, least: float
) -> None:
    """Take out vertices of which no two are neighbours.

    Args:
        t: the triangulation.
        U: (n, 3) directions.
        order: (k,) vertices, those first whose merging costs least.
        costs: (k,) of merging them.
        dearest: what it may cost.
        least: volume of triangles that look outward.

    """
    t.counts[LEVEL] += 1
    level, taken = t.counts[LEVEL], 0
    for k in range(order.size):
        p = order[k]
        if t.counts[LEFT] <= 4 or taken > SHARE * t.counts[LEFT] or costs[k] > dearest:
            break
        if t.touched[p] == level:
            continue
        if math.isnan(t.cost[p]):
            search(t, U, p, least)
        if t.along[p] == NOWHERE or (taken > 0 and (t.cost[p] > costs[k] or not t.inward[p])):
            continue
        h = t.along[p]
        q, d, g = t.heads[h], t.degrees[p], h
        t.touched[q] = level
        for _ in range(d):
            t.touched[t.heads[g]] = level
            g = t.after[g]
        first, last = t.after[t.after[h]], t.before[t.before[h]]
        right, left = t.heads[t.after[h]], t.heads[t.before[h]]
        take_out(t, h)
        taken += 1
        for v in (q, right, left):
            look_at(t, U, v, least)
            forget(t, v)
        if d > TRIANGLE:
            g = first
            while True:
                look_at(t, U, t.heads[g], least)
                forget(t, t.heads[g])
                if g == last:
                    break
                g = t.after[g]


@entry
def faces(t: Triangulation, left: Numbers, numbers: Numbers, found: Numbers) -> None:
    """Write the triangles that are left.

    Args:
        t: the triangulation.
        left: (k,) the vertices.
        numbers: (n,) scratch.
        found: (2k - 4, 3) out.

    """
    for number in range(left.size):
        numbers[left[number]] = number
    at = 0
    for p in left:
        h = t.first[p]
        for _ in range(t.degrees[p]):
            q, r = t.heads[h], t.heads[t.after[h]]
            if p < q and p < r:
                found[at, 0], found[at, 1], found[at, 2] = numbers[p], numbers[q], numbers[r]
                at += 1
            h = t.after[h]
