"""Bare arrays for viewers, little endian, ready for a GPU's buffers; the topology is sent once, positions per state."""

from __future__ import annotations

from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from spherify.geometry.mesh import Floats, Ints

PositionType = Literal["f32", "u16"]
LEVELS: Final = 65535  # steps of a quantised coordinate


def topology_bytes(F: Ints) -> bytes:
    """Return (m, 3) vertex indices as 3m uint32."""
    return F.astype("<u4").tobytes()


def positions_bytes(V: Floats, dtype: PositionType) -> bytes:
    """Return (n, 3) positions as 3n float32, or quantised.

    Quantised (``u16``): the least and the greatest corner of the bounding box as 6 float32, then 3n uint16 q; a
    coordinate is low + q · (high - low) / 65535, off by half a step at most beside the rounding of the corners.
    """
    if dtype == "f32":
        return scalars_bytes(V)
    corners = _float32(np.array([V.min(axis=0), V.max(axis=0)]))
    low, extent = corners[0].astype(np.float64), np.ptp(corners.astype(np.float64), axis=0)
    share = np.divide(V - low, extent, out=np.zeros_like(V), where=extent > 0)
    steps = np.rint(share.clip(0, 1) * LEVELS).astype("<u2")
    return b"".join([corners.tobytes(), steps.tobytes()])


def scalars_bytes(values: Floats) -> bytes:
    """Return values of any shape as float32; those beyond its range are its greatest."""
    data: bytes = _float32(values).tobytes()
    return data


def _float32(values: Floats) -> NDArray[np.float32]:
    greatest = float(np.finfo(np.float32).max)
    return values.clip(-greatest, greatest).astype("<f4")
