"""An order of the vertices in which neighbours are near, made once when a kernel is prepared."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spherify.geometry.kernels.passes.jit import entry
from spherify.geometry.kernels.passes.types import Indices


@entry
def by_levels(first: Indices, neighbours: Indices, order: Indices, placed: NDArray[np.bool_]) -> None:
    """Order vertices breadth first: neighbours are then at most two levels apart, which are read as two streams.

    Args:
        first: (n + 1,) where the neighbours of each vertex begin.
        neighbours: of all vertices.
        order: (n,) out: the vertices, component by component.
        placed: (n,) scratch, all False.

    """
    count, head = 0, 0
    for seed in range(order.size):
        if not placed[seed]:
            order[count], placed[seed] = seed, True
            count += 1
        while head < count:
            p = order[head]
            head += 1
            for i in range(first[p], first[p + 1]):
                q = neighbours[i]
                if not placed[q]:
                    order[count], placed[q] = q, True
                    count += 1
