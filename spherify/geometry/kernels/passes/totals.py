"""Sums and extremes of a row of numbers, from the first to the last.

Written out, for numba's own belong to a module that looks for a BLAS: loading code that uses them imports scipy's
linear algebra, which takes longer than all the rest of a small mesh.
"""

from __future__ import annotations

import numpy as np

from spherify.geometry.kernels.passes.jit import inner
from spherify.geometry.kernels.passes.types import Floats


@inner
def total_of(v: Floats) -> float:
    """Return the sum."""
    total = 0.0
    for value in v:
        total += value
    return total


@inner
def least_of(v: Floats) -> float:
    """Return the least of finite numbers; inf if there is none."""
    least = np.inf
    for value in v:
        least = min(least, value)
    return least


@inner
def greatest_of(v: Floats) -> float:
    """Return the greatest of finite numbers that are not negative; 0 if there is none."""
    greatest = 0.0
    for value in v:
        greatest = max(greatest, value)
    return greatest
