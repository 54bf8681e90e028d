"""Tangential relaxation: each vertex towards the weighted mean of its neighbours, within its tangent plane."""

from __future__ import annotations

import numpy as np

from spherify.geometry.kernels.passes.jit import inner
from spherify.geometry.kernels.passes.types import Floats, Index, Indices
from spherify.geometry.kernels.passes.vertices import sum_one, sum_three


@inner
def weigh(
    area: Floats, exponent: float, x: Floats, y: Floats, z: Floats, wx: Floats, wy: Floats, wz: Floats
) -> None:
    """Turn the areas at each vertex into its weight w = (area / greatest area)^exponent, and give w·(x, y, z).

    Multiplied here once a vertex, not once a neighbour.
    """
    greatest = 0.0
    for p in range(np.uint32(0), np.uint32(area.size)):
        greatest = area[p] if area[p] > greatest else greatest
    for p in range(np.uint32(0), np.uint32(area.size)):
        area[p] /= greatest
    if exponent != 1.0:
        for p in range(np.uint32(0), np.uint32(area.size)):
            area[p] = area[p] ** exponent
    weighted_positions(area, x, y, z, wx, wy, wz)


@inner
def weigh_alike(weight: Floats, x: Floats, y: Floats, z: Floats, wx: Floats, wy: Floats, wz: Floats) -> None:
    """Weigh every vertex 1."""
    for p in range(np.uint32(0), np.uint32(x.size)):
        weight[p] = 1.0
    weighted_positions(weight, x, y, z, wx, wy, wz)


@inner
def weighted_positions(
    weight: Floats, x: Floats, y: Floats, z: Floats, wx: Floats, wy: Floats, wz: Floats
) -> None:
    """Give w·(x, y, z)."""
    for p in range(np.uint32(0), np.uint32(x.size)):
        wx[p] = weight[p] * x[p]
        wy[p] = weight[p] * y[p]
        wz[p] = weight[p] * z[p]


@inner
def draw(
    x: Floats, y: Floats, z: Floats, px: Floats, py: Floats, pz: Floats,
    sx: Floats, sy: Floats, sz: Floats, total: Floats, fraction: float, low: Index, high: Index,
) -> None:  # fmt: skip
    """Move a run by ``fraction`` of u - (u·n_p) n_p, with the umbrella vector u = Σ w_q q / Σ w_q - p, or 0.

    The sums ``sx``, ``sy``, ``sz`` = Σ w_q q and ``total`` = Σ w_q begin with the first vertex of the run.
    """
    for p in range(low, high):
        j = np.uint32(p - low)
        some = total[j] != 0
        by = total[j] if some else 1.0
        ux = sx[j] / by - x[p] if some else 0.0
        uy = sy[j] / by - y[p] if some else 0.0
        uz = sz[j] / by - z[p] if some else 0.0
        along = ux * px[p] + uy * py[p] + uz * pz[p]
        x[p] += fraction * (ux - along * px[p])
        y[p] += fraction * (uy - along * py[p])
        z[p] += fraction * (uz - along * pz[p])


@inner
def relax(
    runs: Indices, ring: Indices, weight: Floats, wx: Floats, wy: Floats, wz: Floats,
    x: Floats, y: Floats, z: Floats, px: Floats, py: Floats, pz: Floats,
    sx: Floats, sy: Floats, sz: Floats, total: Floats, fraction: float,
) -> None:  # fmt: skip
    """Relax all vertices at once: neighbours are read from the weighted positions, which do not change meanwhile."""
    for r in range(runs.shape[0]):
        low, high = runs[r, 0], runs[r, 1]
        count = np.uint32(high - low)
        zero = np.uint32(0)
        sum_three(ring, runs[r, 7], runs[r, 6], wx, wy, wz, sx, sy, sz, zero, count)
        sum_one(ring, runs[r, 7], runs[r, 6], weight, total, zero, count)
        draw(x, y, z, px, py, pz, sx, sy, sz, total, fraction, low, high)
