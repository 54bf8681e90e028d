"""The surface as a whole, from what the rings of its vertices are computed for anyway.

Each vertex p stands for the faces at it, so that every face counts three times and every edge twice: with A(p) = Σ A_f
over these faces, ΣA(p) = 3A and ΣA(p)·p = 3A·c; and Σ p · N_j, over their doubled area vectors N_j, adds up to 18V.

Sums go by the runs of vertices, which are the same whoever adds them up: the bytes do not depend on the number of
threads.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from spherify.geometry.kernels.passes.arithmetic import fma
from spherify.geometry.kernels.passes.jit import inner
from spherify.geometry.kernels.passes.straight import BLOCK, LANES
from spherify.geometry.kernels.passes.totals import total_of
from spherify.geometry.kernels.passes.types import Floats, Index

SUMS: Final = 8
RESULTS: Final = 8
PER_VERTEX: Final = 3.0  # the weights of all vertices, the areas of the faces at them, over the area


@inner
def length(x: float, y: float, z: float) -> float:
    """√(x² + y² + z²): by the processor's own root, which has nothing else to do while others fetch."""
    return math.sqrt(fma(x, x, fma(y, y, z * z)))


@inner
def begin_run(weights: Floats, volumes: Floats, mx: Floats, my: Floats, mz: Floats, edges: Floats) -> None:
    """Begin the sums of a run, kept apart by place in the block."""
    for k in range(np.uint32(0), np.uint32(BLOCK)):
        weights[k], volumes[k], edges[k] = 0.0, 0.0, 0.0
        mx[k], my[k], mz[k] = 0.0, 0.0, 0.0


@inner
def integrate(
    x: Floats, y: Floats, z: Floats, area: Floats, volume: Floats, lengths: Floats,
    weights: Floats, volumes: Floats, mx: Floats, my: Floats, mz: Floats, edges: Floats, low: Index, count: Index,
) -> None:  # fmt: skip
    """Add a block of vertices: A(p), Σ p · N_j, A(p)·p, Σ |d_j|."""
    for k in range(np.uint32(0), count):
        p = np.uint32(low + k)
        weight = area[p]
        weights[k] += weight
        volumes[k] += volume[k]
        mx[k] = fma(weight, x[p], mx[k])
        my[k] = fma(weight, y[p], my[k])
        mz[k] = fma(weight, z[p], mz[k])
        edges[k] += lengths[k]


@inner
def lanes_total(lanes: Floats) -> float:
    """Return the sum of a block's places, whose first ones are left changed."""
    half = np.uint32(BLOCK // 2)
    while half >= np.uint32(LANES):
        for k in range(np.uint32(0), half):
            lanes[k] += lanes[np.uint32(half + k)]
        half = half >> np.uint32(1)
    return total_of(lanes[:LANES])


@inner
def end_run(
    weights: Floats, volumes: Floats, mx: Floats, my: Floats, mz: Floats, edges: Floats, sums: Floats
) -> None:
    """Write the sums of a run."""
    sums[0], sums[1], sums[5] = lanes_total(weights), lanes_total(volumes) / 3, lanes_total(edges)
    sums[2], sums[3], sums[4] = lanes_total(mx), lanes_total(my), lanes_total(mz)


@inner
def centre(position: Floats, sums: Floats, share: float, result: Floats) -> None:
    """Put area, volume, centroid and edge lengths together from sums, and a radius.

    Args:
        position: (3, n).
        sums: (segments, SUMS): weights, that is ``share`` times the area; 6·volume; weights times positions; lengths.
        share: see above.
        result: (RESULTS,) out: area, volume, centroid, the sum of the lengths; the radius last.

    """
    weight = total_of(sums[:, 0])
    result[0], result[1], result[5] = weight / share, total_of(sums[:, 1]) / 6, total_of(sums[:, 5])
    for k in range(3):
        result[2 + k] = (
            total_of(sums[:, 2 + k]) / weight if weight != 0 else total_of(position[k]) / position.shape[1]
        )
    result[7] = length(position[0, 0] - result[2], position[1, 0] - result[3], position[2, 0] - result[4])


@inner
def radii(
    x: Floats, y: Floats, z: Floats, area: Floats, result: Floats, first: Floats, second: Floats,
    low: Index, count: Index,
) -> None:  # fmt: skip
    """Add Σ A(p) (r - about) and Σ A(p) (r - about)² of a block of vertices, by place in the block."""
    cx, cy, cz, about = result[2], result[3], result[4], result[7]
    for k in range(np.uint32(0), count):
        p = np.uint32(low + k)
        off = length(x[p] - cx, y[p] - cy, z[p] - cz) - about
        weighted = area[p] * off
        first[k] += weighted
        second[k] = fma(weighted, off, second[k])


@inner
def spread_run(
    position: Floats, area: Floats, result: Floats, first: Floats, second: Floats, sums: Floats,
    low: Index, last: Index,
) -> None:  # fmt: skip
    """Write the sums of `radii` of a run of vertices."""
    x, y, z = position[0], position[1], position[2]
    for k in range(np.uint32(0), np.uint32(BLOCK)):
        first[k], second[k] = 0.0, 0.0
    while low < last:
        count = min(np.uint32(BLOCK), np.uint32(last - low))
        radii(x, y, z, area, result, first, second, low, count)
        low = np.uint32(low + count)
    sums[6], sums[7] = lanes_total(first), lanes_total(second)


@inner
def variation(sums: Floats, share: float, result: Floats) -> None:
    """Put the radius variation together from Σ w (r - about) and Σ w (r - about)², weights as of `centre`.

    The variance about a radius, less the square of what that is off the mean by: no digits are lost.
    """
    weight = share * result[0]
    if weight == 0:
        result[6] = np.inf
    else:
        off = total_of(sums[:, 6]) / weight
        variance = total_of(sums[:, 7]) / weight - off * off
        variance = variance if variance > 0 else 0.0 * variance
        result[6] = math.sqrt(variance) / (result[7] + off)
