"""Two percentiles of K at once, exactly, without sorting it.

A histogram says in which bins the wanted ranks lie; only the values of these bins go on, to be sorted if they are few,
else to a histogram of their own. The bins cover where a small sample has its bulk; what is outside counts in the first
and the last bin. So far outliers, which real meshes have at each sliver, do not put all other values into one bin.
Two passes over K do, whatever the percentiles.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from spherify.geometry.kernels.passes.jit import inner
from spherify.geometry.kernels.passes.types import Buffers, Floats, Index

BINS = 2048  # 16 kB of counts
FEW = 48  # are sorted by insertion
SAMPLE = 64
Bins = NDArray[np.uint16]


@inner
def sort_few(v: Floats, size: int) -> None:
    """Sort the first ``size`` of ``v``, by insertion."""
    for i in range(1, size):
        value = v[i]
        j = i - 1
        while j >= 0 and v[j] > value:
            v[j + 1] = v[j]
            j -= 1
        v[j + 1] = value


@inner
def sort_many(v: Floats, size: int) -> None:
    """Sort the first ``size`` of ``v``, by a heap: in place, in a time that does not depend on what they are."""
    for built in range(size // 2 + size - 1):
        end = size if built < size // 2 else size - 1 - (built - size // 2)
        root = size // 2 - 1 - built
        if root < 0:  # the heap stands: its greatest goes behind it
            root = 0
            v[0], v[end] = v[end], v[0]
        while 2 * root + 1 < end:
            child = 2 * root + 1
            child += child + 1 < end and v[child] < v[child + 1]
            if v[root] >= v[child]:
                break
            v[root], v[child] = v[child], v[root]
            root = child


@inner
def bulk(v: Floats, size: int, low: float, high: float, sample: Floats) -> tuple[float, float]:
    """Return where most of the first ``size`` of ``v`` lie, which all lie within ``low`` … ``high``."""
    if size < 4 * SAMPLE:
        return low, high
    for i in range(SAMPLE):
        sample[i] = v[i * size // SAMPLE]
    sort_few(sample, SAMPLE)
    start, end = sample[SAMPLE // 16], sample[SAMPLE - 1 - SAMPLE // 16]
    margin = 0.25 * (end - start)
    start, end = max(start - margin, low), min(end + margin, high)
    return (start, end) if BINS / (end - start) < np.inf else (low, high)


@inner
def into_bins(v: Floats, start: float, scale: float, bins: Bins, low: Index, high: Index) -> None:
    """Write the bin of each value: bins of width 1/scale from ``start`` on, the first and the last without end."""
    for i in range(low, high):
        place = (v[i] - start) * scale
        place = place if place > 0 else 0.0
        place = place if place < BINS - 1 else BINS - 1.0
        bins[i] = np.uint16(np.int32(place))


@inner
def count_bins(bins: Bins, size: int, counts: NDArray[np.int64]) -> None:
    """Histogram of the first ``size`` of ``bins``."""
    for b in range(counts.size):
        counts[b] = 0
    for i in range(np.uint64(0), np.uint64(size)):
        counts[bins[i]] += 1


@inner
def bin_of(counts: NDArray[np.int64], rank: int) -> tuple[int, int]:
    """Return the bin in which the value of a rank lies, and its rank within the bin."""
    b = 0
    while rank >= counts[b]:
        rank -= counts[b]
        b += 1
    return b, rank


@inner
def collect(v: Floats, bins: Bins, size: int, one: int, two: int, into: Floats, into_two: Floats) -> None:
    """Copy the values of two bins."""
    bin_one, bin_two = np.uint16(one), np.uint16(two)
    i, j = np.uint64(0), np.uint64(0)
    for k in range(np.uint64(0), np.uint64(size)):
        into[i] = v[k]  # overwritten by the next unless it belongs to the bin: cheaper than a jump
        into_two[j] = v[k]
        i += np.uint64(bins[k] == bin_one)
        j += np.uint64(bins[k] == bin_two)


@inner
def interpolated(value: float, following: float, part: float) -> float:
    """Value + part · (following - value), from the nearer of the two as numpy does: rounding may not pass either."""
    if part >= 0.5:
        return following - (following - value) * (1 - part)
    return value + (following - value) * part


@inner
def least_above(v: Floats, bins: Bins, size: int, bin_: int) -> float:
    """Return the least value of all bins above one; inf if there is none."""
    least = np.inf
    for i in range(np.uint64(0), np.uint64(size)):
        if bins[i] > bin_ and v[i] < least:
            least = v[i]
    return least


@inner
def ranked(
    v: Floats, size: int, rank: int, above: float, bins: Bins, counts: NDArray[np.int64], sample: Floats
) -> tuple[float, float]:
    """Return the values of rank ``rank`` and ``rank + 1`` among the first ``size`` of ``v``; ``above`` behind the last.

    ``v`` is shortened to what is still of interest, by histograms of it, until few are left or all are the same.
    """
    while size > FEW:
        low, high = np.inf, -np.inf
        for i in range(size):
            low, high = min(low, v[i]), max(high, v[i])
        if low == high:
            break
        start, end = bulk(v, size, low, high, sample)
        into_bins(v, start, BINS / (end - start), bins, np.uint32(0), np.uint32(size))
        count_bins(bins, size, counts)
        bin_, within = bin_of(counts, rank)
        if (
            counts[bin_] == size
        ):  # values that no histogram can part, as next to the least or greatest float there is
            sort_many(v, size)
            break
        if within + 1 == counts[bin_]:
            above = min(above, least_above(v, bins, size, bin_))
        kept = np.uint64(0)
        for k in range(np.uint64(0), np.uint64(size)):
            v[kept] = v[k]
            kept += np.uint64(bins[k] == bin_)
        size, rank = counts[bin_], within
    if size <= FEW:
        sort_few(v, size)
    return v[rank], v[rank + 1] if rank + 1 < size else above


@inner
def percentiles(
    K: Floats, K_min: float, K_max: float, window: tuple[float, float], use: Buffers
) -> tuple[float, float]:
    """Return two percentiles of K (n,), linearly interpolated.

    Args:
        K: all finite.
        K_min: the least of K.
        K_max: the greatest, above K_min.
        window: the two, 0 … 100.
        use: has the scratch.

    """
    if window[0] <= 0 and window[1] >= 100:
        return K_min, K_max
    n, one, two = K.size, use.chosen[0], use.chosen[1]
    start, end = bulk(K, n, K_min, K_max, use.sample)
    into_bins(K, start, BINS / (end - start), use.bins, np.uint32(0), np.uint32(n))
    count_bins(use.bins, n, use.counts)
    place_one, place_two = (n - 1) * (window[0] / 100), (n - 1) * (window[1] / 100)
    rank_one, rank_two = math.floor(place_one), math.floor(place_two)
    bin_one, within_one = bin_of(use.counts, rank_one)
    bin_two, within_two = bin_of(use.counts, rank_two)
    size_one, size_two = use.counts[bin_one], use.counts[bin_two]
    collect(K, use.bins, n, bin_one, bin_two, one, two)
    above_one = least_above(K, use.bins, n, bin_one) if within_one + 1 == size_one else np.inf
    above_two = least_above(K, use.bins, n, bin_two) if within_two + 1 == size_two else np.inf
    low, low_next = ranked(one, size_one, within_one, above_one, use.bins, use.counts, use.sample)
    high, high_next = ranked(two, size_two, within_two, above_two, use.bins, use.counts, use.sample)
    low = interpolated(low, min(low_next, K_max), place_one - rank_one)
    high = interpolated(high, min(high_next, K_max), place_two - rank_two)
    return low, high
