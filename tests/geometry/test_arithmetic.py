"""Angles as the compiled passes compute them, against the C library's."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from spherify.geometry.kernels.passes.arithmetic import angle_over


@njit(error_model="numpy")
def _angles(angle: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    for i in range(angle.size):
        out[0, i], out[1, i] = angle_over(3.0 * np.sin(angle[i]), 3.0 * np.cos(angle[i]), 7.0)


def test_angles_all_around():
    angle = np.random.default_rng(3).uniform(-np.pi, np.pi, 20_000)
    out = np.empty((2, len(angle)))
    _angles(angle, out)
    assert np.allclose(out[0], angle, rtol=2e-15, atol=0)
    assert np.allclose(out[1], 1 / 7, rtol=1e-15, atol=0)
