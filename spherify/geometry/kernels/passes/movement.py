"""The elementary steps I_C and O_C themselves, and what moves all vertices alike."""

from __future__ import annotations

import numpy as np

from spherify.geometry.kernels.passes.jit import entry, inner
from spherify.geometry.kernels.passes.types import Floats, Index, Ints


@inner
def distance(
    K: float, altitude: float, K_min: float, width: float, step: float, outward: bool, bound: float
) -> float:
    """-C·t for I_C(p) = p - C·t·n_p, or C·(1 - t) for O_C(p) = p + C·(1 - t)·n_p, t = (K - K_min) / width in [0, 1].

    No vertex moves further than ``bound`` times the least altitude of the faces at it; 0 is off.
    """
    t = (K - K_min) / width
    t = 0.0 if t < 0 else t
    t = 1.0 if t > 1 else t
    along = step * (1.0 - t) if outward else -(step * t)
    if bound > 0:
        most = bound * altitude
        along = -most if along < -most else along
        along = most if along > most else along
    return along


@inner
def move(
    x: Floats, y: Floats, z: Floats, K: Floats, px: Floats, py: Floats, pz: Floats, altitude: Floats,
    K_min: float, K_max: float, step: float, outward: bool, bound: float, low: Index, high: Index,
) -> None:  # fmt: skip
    """Move vertices along their normals where they are."""
    width = K_max - K_min
    for p in range(low, high):
        along = distance(K[p], altitude[p], K_min, width, step, outward, bound)
        x[p] += along * px[p]
        y[p] += along * py[p]
        z[p] += along * pz[p]


@inner
def move_to(
    x: Floats, y: Floats, z: Floats, K: Floats, px: Floats, py: Floats, pz: Floats, altitude: Floats,
    mx: Floats, my: Floats, mz: Floats,
    K_min: float, K_max: float, step: float, outward: bool, bound: float, low: Index, high: Index,
) -> None:  # fmt: skip
    """Write to (mx, my, mz) where `move` would take the vertices."""
    width = K_max - K_min
    for p in range(low, high):
        along = distance(K[p], altitude[p], K_min, width, step, outward, bound)
        mx[p] = x[p] + along * px[p]
        my[p] = y[p] + along * py[p]
        mz[p] = z[p] + along * pz[p]


@inner
def go_ahead(position: Floats, previous: Floats, momentum: float, low: Index, high: Index) -> None:
    """Go on from vertices by ``momentum`` times the way from where they were; where they are is previous then."""
    for k in range(3):
        x, before = position[k], previous[k]
        for p in range(low, high):
            here = x[p]
            x[p] = momentum * (here - before[p]) + here
            before[p] = here


@inner
def scale(
    position: Floats, centre: tuple[float, float, float], factor: float, low: Index, high: Index
) -> None:
    """Scale vertices about a centre: c + factor·(p - c)."""
    for k in range(3):
        x, c = position[k], centre[k]
        for p in range(low, high):
            x[p] = (x[p] - c) * factor + c


@entry
def unload(position: Floats, place: Ints, V: Floats, low: Index, high: Index) -> None:
    """Write positions (3, n) in places to V (3, n), some vertices of the mesh."""
    for k in range(3):
        x, to = position[k], V[k]
        for i in range(low, high):
            to[i] = x[np.uint64(place[i])]
