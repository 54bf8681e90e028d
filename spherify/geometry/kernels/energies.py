"""The energy that the last of a run falls by, by machine code."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from spherify.geometry.finish import Energy
from spherify.geometry.kernels.passes.energy import SUMS, energy
from spherify.geometry.mesh import Floats, Ints


def energies(F: Ints, barrier: float) -> Callable[[Floats], Energy | None]:
    """See `spherify.geometry.kernels.interface.Kernel.energies`."""
    faces = F.astype(np.uint32).reshape(-1)
    directions, sums = np.zeros(0), np.zeros(0)

    def at(P: Floats) -> Energy | None:
        nonlocal directions, sums
        if directions.size != P.size:
            directions, sums = np.empty(P.size), np.empty(SUMS * len(P))
        gradient = np.empty(P.size)
        value = energy(np.ascontiguousarray(P).reshape(-1), faces, float(barrier), directions, sums, gradient)
        return None if value == np.inf else Energy(value, gradient.reshape(-1, 3))

    return at
