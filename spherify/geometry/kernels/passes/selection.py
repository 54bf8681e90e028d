"""Two percentiles of K at once, exactly, without sorting it.

A histogram says in which bins the wanted ranks lie; only the values of these bins go on, to be sorted if they are few,
else to a histogram of their own. The bins cover where a small sample has its bulk; what is outside counts in the first
and the last bin. So far outliers, which real meshes have at each sliver, do not put all other values into one bin.
Two passes over K do, whatever the percentiles; several threads do each part by part: counts add up to the same.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from spherify.geometry.kernels.passes.jit import inner
from spherify.geometry.kernels.passes.types import Buffers, Floats, Index, Ints

BINS = 2048  # at most, 16 kB of counts
FEWEST_BINS = 64
IN_A_BIN = 4  # values, on the average, where these numbers of bins allow it
FEW = 48  # are sorted by insertion
SAMPLE = 64
STRETCH = 64  # values that are looked at together
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
def bins_for(n: int) -> int:
    """Return how many bins n values are put into, a power of two: to look through them takes time as well."""
    bins = FEWEST_BINS
    while bins < BINS and bins * IN_A_BIN < n:
        bins *= 2
    return bins


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
def into_bins(v: Floats, start: float, end: float, count: int, bins: Bins, low: Index, high: Index) -> None:
    """Write the bin of each value: so many of equal width, ``start`` … ``end``, the first and the last without end."""
    scale, last = count / (end - start), count - 1.0
    for i in range(low, high):
        place = (v[i] - start) * scale
        place = place if place > 0 else 0.0
        place = place if place < last else last
        bins[i] = np.uint16(np.int32(place))


@inner
def count_bins(bins: Bins, low: Index, high: Index, counts: Ints) -> None:
    """Histogram of some of ``bins``."""
    for b in range(counts.size):
        counts[b] = 0
    for i in range(np.uint64(low), np.uint64(high)):
        counts[bins[i]] += 1


@inner
def in_bin(counts: Ints, b: int) -> int:
    """Return how many all parts have in a bin."""
    count = 0
    for part in range(counts.shape[0]):
        count += counts[part, b]
    return count


@inner
def bin_of(counts: Ints, rank: int, size: int) -> tuple[int, int]:
    """Return the bin in which the value of a rank lies, and its rank within the bin; of ``size`` in all.

    Args:
        counts: (parts, bins).
        rank: from 0 on.
        size: looked for from whichever end is nearer, for percentiles are near one.

    """
    if 2 * rank < size:
        b, count = 0, in_bin(counts, 0)
        while rank >= count:
            rank -= count
            b += 1
            count = in_bin(counts, b)
        return b, rank
    above, b = size - 1 - rank, counts.shape[1] - 1
    count = in_bin(counts, b)
    while above >= count:
        above -= count
        b -= 1
        count = in_bin(counts, b)
    return b, count - 1 - above


@inner
def any_in(bins: Bins, one: np.uint16, two: np.uint16, low: np.uint64, high: np.uint64) -> bool:
    """Whether one of some values lies in one of two bins."""
    found = np.uint16(0)
    for k in range(low, high):
        found |= np.uint16(bins[k] == one) | np.uint16(bins[k] == two)
    return bool(found != 0)


@inner
def collect(
    v: Floats, bins: Bins, one: int, two: int, into: Floats, into_two: Floats, low: Index, high: Index
) -> None:
    """Copy the values of two bins, to where these values begin; most stretches have none."""
    bin_one, bin_two = np.uint16(one), np.uint16(two)
    i, j, begin = np.uint64(low), np.uint64(low), np.uint64(low)
    while begin < high:
        end = min(begin + np.uint64(STRETCH), np.uint64(high))
        if any_in(bins, bin_one, bin_two, begin, end):
            for k in range(begin, end):
                into[i] = v[k]  # overwritten by the next unless it belongs to the bin: cheaper than a jump
                into_two[j] = v[k]
                i += np.uint64(bins[k] == bin_one)
                j += np.uint64(bins[k] == bin_two)
        begin = end


@inner
def close_up(v: Floats, counts: Ints, b: int) -> None:
    """Bring together what each part has collected of a bin."""
    kept, begin = 0, 0
    for part in range(counts.shape[0]):
        for i in range(counts[part, b]):
            v[kept + i] = v[begin + i]
        kept += counts[part, b]
        for count in counts[part]:
            begin += count


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
    v: Floats, size: int, rank: int, above: float, bins: Bins, counts: Ints, sample: Floats
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
        some = counts[:, : bins_for(size)]
        into_bins(v, start, end, some.shape[1], bins, np.uint32(0), np.uint32(size))
        count_bins(bins, np.uint32(0), np.uint32(size), some[0])
        bin_, within = bin_of(some, rank, size)
        if (
            counts[0, bin_] == size
        ):  # values that no histogram can part, as next to the least or greatest float there is
            sort_many(v, size)
            break
        if within + 1 == counts[0, bin_]:
            above = min(above, least_above(v, bins, size, bin_))
        kept = np.uint64(0)
        for k in range(np.uint64(0), np.uint64(size)):
            v[kept] = v[k]
            kept += np.uint64(bins[k] == bin_)
        size, rank = counts[0, bin_], within
    if size <= FEW:
        sort_few(v, size)
    return v[rank], v[rank + 1] if rank + 1 < size else above


@inner
def places(n: int, window: tuple[float, float]) -> tuple[float, float]:
    """Return where two percentiles lie among n values in order, the first at 0."""
    return (n - 1) * (window[0] / 100), (n - 1) * (window[1] / 100)


@inner
def is_inner(window: tuple[float, float]) -> bool:
    """Whether its percentiles are others than the extremes."""
    return window[0] > 0 or window[1] < 100


@inner
def count_part(
    K: Floats, K_min: float, K_max: float, use: Buffers, part: int, first: Index, last: Index
) -> None:
    """Note the bin of each K (n,) of a part, and how many it has in each; for `percentiles`, which see."""
    start, end = bulk(K, K.size, K_min, K_max, use.samples[part])
    count = bins_for(K.size)
    into_bins(K, start, end, count, use.bins, first, last)
    count_bins(use.bins, first, last, use.counts[part, :count])


@inner
def collect_part(
    K: Floats, window: tuple[float, float], use: Buffers, first: Index, last: Index
) -> tuple[int, int, int, int]:
    """Copy what a part has in the bins of two percentiles, after all parts are counted.

    Returns:
        the bin of either and its rank within that, the same to all parts.

    """
    place_one, place_two = places(K.size, window)
    counts = use.counts[:, : bins_for(K.size)]
    bin_one, within_one = bin_of(counts, math.floor(place_one), K.size)
    bin_two, within_two = bin_of(counts, math.floor(place_two), K.size)
    collect(K, use.bins, bin_one, bin_two, use.chosen[0], use.chosen[1], first, last)
    return bin_one, within_one, bin_two, within_two


@inner
def percentiles(
    K: Floats, K_max: float, window: tuple[float, float], where: tuple[int, int, int, int], use: Buffers
) -> tuple[float, float]:
    """Return two percentiles of K (n,), linearly interpolated, after `count_part` and `collect_part` of all parts.

    Args:
        K: all finite, not all the same.
        K_max: the greatest.
        window: the two, 0 … 100.
        where: they are, as `collect_part` says.
        use: has the scratch.

    """
    n, one, two = K.size, use.chosen[0], use.chosen[1]
    place_one, place_two = places(n, window)
    rank_one, rank_two = math.floor(place_one), math.floor(place_two)
    bin_one, within_one, bin_two, within_two = where
    counts_of_all = use.counts[:, : bins_for(n)]
    size_one, size_two = in_bin(counts_of_all, bin_one), in_bin(counts_of_all, bin_two)
    close_up(one, counts_of_all, bin_one)
    close_up(two, counts_of_all, bin_two)
    above_one = least_above(K, use.bins, n, bin_one) if within_one + 1 == size_one else np.inf
    above_two = least_above(K, use.bins, n, bin_two) if within_two + 1 == size_two else np.inf
    counts, sample = use.counts[:1], use.samples[0]
    low, low_next = ranked(one, size_one, within_one, above_one, use.bins, counts, sample)
    high, high_next = ranked(two, size_two, within_two, above_two, use.bins, counts, sample)
    low = interpolated(low, min(low_next, K_max), place_one - rank_one)
    high = interpolated(high, min(high_next, K_max), place_two - rank_two)
    return low, high
