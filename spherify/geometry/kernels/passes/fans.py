"""The rings of neighbours, walked once when a kernel is prepared."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spherify.geometry.kernels.passes.jit import entry
from spherify.geometry.kernels.passes.types import NONE, Indices


@entry
def walk(
    heads: Indices,
    twins: Indices,
    first: Indices,
    halfedges: Indices,
    ring: Indices,
    round_: NDArray[np.bool_],
) -> None:
    """Find the neighbours of each vertex counter-clockwise, where its faces close to one full circle.

    Args:
        heads: (3m,) the vertex each half-edge runs to.
        twins: (3m,) the half-edge against each, or NONE.
        first: (n + 1,) where the half-edges from each vertex begin in ``halfedges``.
        halfedges: (3m,) by the vertex they start at.
        ring: (3m,) out: the neighbours of each vertex, laid out as ``halfedges``.
        round_: (n,) out: whether its circle closes; else what is in its place in ``ring`` means nothing.

    """
    three = np.uint32(3)
    for p in range(round_.size):
        start, end = first[p], first[p + 1]
        if start == end:
            round_[p] = False
            continue
        h = halfedges[start]
        at = start
        while at < end:
            ring[at] = heads[h]
            at += np.uint32(1)
            before = np.uint32(h + np.uint32(2)) if h % three == 0 else np.uint32(h - np.uint32(1))
            h = twins[before]
            if h == NONE or h == halfedges[start]:
                break
        round_[p] = at == end and h == halfedges[start]
