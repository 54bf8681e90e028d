"""Angles as the compiled passes compute them, against the C library's."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from spherify.geometry.kernels.passes.arithmetic import angle_over, is_slight, slight_angle_over


@njit(error_model="numpy")
def _angles(angle: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    for i in range(angle.size):
        sine, cosine, by = 3.0 * np.sin(angle[i]), 3.0 * np.cos(angle[i]), 7.0
        out[0, i], out[1, i] = angle_over(sine, cosine, by)
        out[2, i], out[3, i] = slight_angle_over(sine, cosine, by)
        out[4, i] = is_slight(sine, cosine)


def test_an_angle_is_the_same_by_either_way_where_both_hold() -> None:
    """A block takes the short way or the long one by what else is in it, which may not show."""
    angle = np.random.default_rng(3).uniform(-np.pi, np.pi, 20_000)
    out = np.empty((5, len(angle)))
    _angles(angle, out)
    slight = out[4] == 1
    assert (np.abs(angle[slight]) <= np.pi / 8 * (1 + 1e-15)).all()
    assert (np.abs(angle[~slight]) >= np.pi / 8 * (1 - 1e-15)).all()
    assert np.allclose(out[0], angle, rtol=2e-15, atol=0)
    assert np.allclose(out[1], 1 / 7, rtol=1e-15, atol=0)
    assert out[0:2, slight].tobytes() == out[2:4, slight].tobytes()
