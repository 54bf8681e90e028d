"""The surface as a whole, from what the rings of its vertices are computed for anyway.

Each vertex p stands for the faces at it, so that every face counts three times and every edge twice: with A(p) = Σ A_f
over these faces, ΣA(p) = 3A and ΣA(p)·p = 3A·c. The volume is that of the divergence of (x, 0, 0): over their doubled
area vectors N_j, Σ x(p) N_jx adds up to 6V, with a third of the additions that Σ p · N_j = 18V takes.

Sums go by the runs of vertices, which are the same whoever adds them up: the bytes do not depend on the number of
threads.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np

from spherify.geometry.kernels.passes.arithmetic import fma
from spherify.geometry.kernels.passes.jit import inner
from spherify.geometry.kernels.passes.totals import total_of
from spherify.geometry.kernels.passes.tracing import repeated, traced
from spherify.geometry.kernels.passes.types import Floats, Index
from spherify.geometry.kernels.passes.wide import LANES, Array, Place, Wide, first_lanes, where
from spherify.geometry.kernels.passes.wide_vectors import difference, dot

EVERY: Final = 64  # one vertex of so many is looked at to see whether all have to be
ROUNDING: Final = 1.001
SUMS: Final = 8
RESULTS: Final = 8
PER_VERTEX: Final = 3.0  # the weights of all vertices, the areas of the faces at them, over the area


@inner
def length(x: float, y: float, z: float) -> float:
    """√(x² + y² + z²): by the processor's own root, which has nothing else to do while others fetch."""
    return math.sqrt(fma(x, x, fma(y, y, z * z)))


class Sums(NamedTuple):
    """What a run adds up, by lane: the first LANES numbers of each row count.

    Attributes:
        weights: A(p).
        volumes: Σ x(p) N_jx.
        mx: A(p)·p, and
        my: so on
        mz: and so on.
        edges: Σ |d_j|.

    """

    weights: Any
    volumes: Any
    mx: Any
    my: Any
    mz: Any
    edges: Any


@inner
def begin_run(sums: Sums) -> None:
    """Begin the sums of a run."""
    for k in range(LANES):
        sums.weights[k], sums.volumes[k], sums.edges[k] = 0.0, 0.0, 0.0
        sums.mx[k], sums.my[k], sums.mz[k] = 0.0, 0.0, 0.0


@traced
def integrate(
    position: tuple[Array, Array, Array], area: Array, volume: Array, lengths: Array, sums: Sums,
    low: Place, count: Place,
) -> None:  # fmt: skip
    """Add a block of vertices, ``volume`` and ``lengths`` by place in the block."""

    def further(group: Place, before: tuple[Wide, ...]) -> tuple[Wide, ...]:
        k = group * LANES
        there, p = first_lanes(count - k), low + k
        weight = where(there, area.load(p), 0.0)
        moments = (
            where(there, weight.fma(part.load(p), sum_), sum_)
            for part, sum_ in zip(position, before[2:5], strict=True)
        )
        return (
            before[0] + weight,
            before[1] + where(there, volume.load(k), 0.0),
            *moments,
            before[5] + where(there, lengths.load(k), 0.0),
        )

    all_groups = repeated(
        (count + (LANES - 1)).divided_by(LANES), tuple(row.load(0) for row in sums), further
    )
    for row, value in zip(sums, all_groups, strict=True):
        row.store(0, value)


@inner
def end_run(lanes: Sums, sums: Floats) -> None:
    """Write the sums of a run."""
    sums[0], sums[1] = total_of(lanes.weights[:LANES]), total_of(lanes.volumes[:LANES])
    sums[2], sums[3], sums[4] = (
        total_of(lanes.mx[:LANES]),
        total_of(lanes.my[:LANES]),
        total_of(lanes.mz[:LANES]),
    )
    sums[5] = total_of(lanes.edges[:LANES])


@inner
def centre(position: Floats, sums: Floats, share: float, result: Floats) -> None:
    """Put area, volume, centroid and edge lengths together from sums, and a radius.

    Args:
        position: (3, n).
        sums: (segments, SUMS): weights, that is ``share`` times the area; 6·volume; weights times positions; lengths.
        share: see above.
        result: (RESULTS,) out: area, volume, centroid, the sum of the lengths; 0; the radius of a vertex.

    """
    weight = total_of(sums[:, 0])
    result[0], result[1], result[5] = weight / share, total_of(sums[:, 1]) / 6, total_of(sums[:, 5])
    for k in range(3):
        result[2 + k] = (
            total_of(sums[:, 2 + k]) / weight if weight != 0 else total_of(position[k]) / position.shape[1]
        )
    result[6] = 0.0
    result[7] = length(position[0, 0] - result[2], position[1, 0] - result[3], position[2, 0] - result[4])


@traced
def radii(
    position: tuple[Array, Array, Array], area: Array, centre: tuple[Wide, Wide, Wide], about: Wide,
    lanes: tuple[Array, Array], low: Place, count: Place,
) -> None:  # fmt: skip
    """Write Σ A(p) (r - about) and Σ A(p) (r - about)² of a run of vertices, by lane."""

    def further(group: Place, before: tuple[Wide, Wide]) -> tuple[Wide, Wide]:
        k = group * LANES
        d = difference(
            (position[0].load(low + k), position[1].load(low + k), position[2].load(low + k)), centre
        )
        off = dot(d, d).root() - about
        weighted = where(first_lanes(count - k), area.load(low + k) * off, 0.0)
        return before[0] + weighted, where(first_lanes(count - k), weighted.fma(off, before[1]), before[1])

    zero = 0.0 * about
    sums = repeated((count + (LANES - 1)).divided_by(LANES), (zero, zero), further)
    for lane, value in zip(lanes, sums, strict=True):
        lane.store(0, value)


@inner
def spread_run(
    position: Floats, area: Floats, result: Floats, first: Floats, second: Floats, sums: Floats,
    low: Index, last: Index,
) -> None:  # fmt: skip
    """Write the sums of `radii` of a run of vertices."""
    centre = (result[2], result[3], result[4])
    radii(
        (position[0], position[1], position[2]), area, centre, result[7], (first, second),
        np.uint64(low), np.uint64(last - low),
    )  # fmt: skip
    sums[6], sums[7] = total_of(first[:LANES]), total_of(second[:LANES])


@inner
def is_uneven(position: Floats, area: Floats, share: float, bound: float, result: Floats) -> bool:
    """Whether some vertices say already that the radius variation is not less than ``bound``.

    If it were less than b, then of the mean radius m and the weights W of all vertices, some of them had Σ w (r - m)² <
    b² m² W; so their own mean m' were no further from m than q·m, q = b √(W / Σ w), and Σ w (r - m')² less than b² W
    (m' / (1 - q))². The arguments otherwise as of `centre`.
    """
    about, weight, first, second = result[7], 0.0, 0.0, 0.0
    for p in range(0, area.size, EVERY):
        r = length(position[0, p] - result[2], position[1, p] - result[3], position[2, p] - result[4]) - about
        weight += area[p]
        first += area[p] * r
        second += area[p] * r * r
    if not (bound < np.inf and weight > 0):
        return False
    whole = share * result[0]
    off = bound * math.sqrt(whole / weight)
    limit = bound * (about + first / weight) / (1 - off)
    return off < 1 and second - first * first / weight > ROUNDING * whole * limit * limit


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
