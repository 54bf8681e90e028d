"""Angles as the compiled passes compute them, against the C library's."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from spherify.geometry.kernels.passes.arithmetic import SLIGHT, angle_over, over_sine


@njit(error_model="numpy")
def _angles(angle: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    for i in range(angle.size):
        out[0, i], out[1, i] = angle_over(3.0 * np.sin(angle[i]), 3.0 * np.cos(angle[i]), 7.0)


@njit(error_model="numpy")
def _over_sines(squared: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    for i in range(squared.size):
        out[i] = over_sine(squared[i])


def test_angles_all_around():
    angle = np.random.default_rng(3).uniform(-np.pi, np.pi, 20_000)
    out = np.empty((2, len(angle)))
    _angles(angle, out)
    assert np.allclose(out[0], angle, rtol=2e-15, atol=0)
    assert np.allclose(out[1], 1 / 7, rtol=1e-15, atol=0)


def test_slight_angles_are_good_to_the_last_bit():
    squared = np.append(SLIGHT * np.random.default_rng(3).uniform(0, 1, 20_000) ** 4, [1e-300, SLIGHT])
    out = np.empty_like(squared)
    _over_sines(squared, out)
    u = np.sqrt(squared.astype(np.longdouble))
    assert np.abs(out / (np.arcsin(u) / u) - 1).max() <= 2 * np.finfo(float).eps
