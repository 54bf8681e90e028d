"""The elementary steps I_C and O_C themselves."""

from __future__ import annotations

import numpy as np

from spherify.geometry.kernels.passes.jit import inner
from spherify.geometry.kernels.passes.types import Floats


@inner
def move(
    x: Floats, y: Floats, z: Floats, K: Floats, px: Floats, py: Floats, pz: Floats, altitude: Floats,
    K_min: float, K_max: float, step: float, outward: bool, bound: float,
) -> None:  # fmt: skip
    """I_C(p) = p - C·t·n_p, or O_C(p) = p + C·(1 - t)·n_p, with t = (K - K_min) / (K_max - K_min) in [0, 1].

    No vertex moves further than ``bound`` times the least altitude of the faces at it; 0 is off.
    """
    width = K_max - K_min
    for p in range(np.uint32(0), np.uint32(x.size)):
        t = (K[p] - K_min) / width
        t = 0.0 if t < 0 else t
        t = 1.0 if t > 1 else t
        distance = step * (1.0 - t) if outward else -(step * t)
        if bound > 0:
            most = bound * altitude[p]
            distance = -most if distance < -most else distance
            distance = most if distance > most else distance
        x[p] += distance * px[p]
        y[p] += distance * py[p]
        z[p] += distance * pz[p]
