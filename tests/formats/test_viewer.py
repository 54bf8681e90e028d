from __future__ import annotations

import struct

import numpy as np
import pytest

from spherify.formats.viewer import positions_bytes, scalars_bytes, topology_bytes
from spherify.geometry.samples import SAMPLES


def test_topology_is_whole_numbers_of_four_bytes() -> None:
    assert topology_bytes(np.array([[0, 1, 2], [2, 1, 70000]])) == struct.pack("<6I", 0, 1, 2, 2, 1, 70000)


def test_positions_are_rounded_to_float32() -> None:
    V = np.array([[0.1, -2.5, 3e7], [1e-30, 0.0, 1.0]])
    assert positions_bytes(V, "f32") == struct.pack("<6f", *V.reshape(-1))


@pytest.mark.parametrize("place", [0.0, 5.0])
def test_quantised_positions_are_off_by_half_a_step(place: float) -> None:
    V = SAMPLES["head"].build(600).vertices * [1.0, 20.0, 0.01] + place
    data = positions_bytes(V, "u16")
    assert len(data) == 24 + 6 * len(V)
    low, high = np.frombuffer(data, "<f4", 6).reshape(2, 3).astype(np.float64)
    q = np.frombuffer(data, "<u2", offset=24).reshape(-1, 3)
    step = (high - low) / 65535
    assert (np.abs(low + q * step - V) <= 0.5 * step + 1e-6 * np.abs(V).max(axis=0)).all()
    assert (q.min(axis=0), q.max(axis=0)) == (pytest.approx(0), pytest.approx(65535))


def test_a_flat_mesh_has_no_steps_across() -> None:
    V = np.array([[0.0, 0.0, 7.0], [1.0, 0.0, 7.0], [0.0, 1.0, 7.0]])
    q = np.frombuffer(positions_bytes(V, "u16"), "<u2", offset=24).reshape(-1, 3)
    assert q.tolist() == [[0, 0, 0], [65535, 0, 0], [0, 65535, 0]]


def test_what_float32_cannot_hold_stays_finite() -> None:
    values = np.frombuffer(scalars_bytes(np.array([1e300, -1e300, 1e-300])), "<f4")
    assert np.isfinite(values).all()
    assert (values[0] > 3e38, values[1] < -3e38, values[2] == 0) == (True, True, True)
