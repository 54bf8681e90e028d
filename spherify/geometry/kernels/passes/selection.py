"""The percentiles of K, exactly, without sorting it.

A histogram says in which bin the wanted rank lies; only the values of that bin go on to the next histogram, over their
own extremes, until few are left to sort. Two passes over K do, whatever the percentiles; far outliers, which put most
of K into one bin, cost a further pass over that bin.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from spherify.geometry.kernels.passes.jit import inner
from spherify.geometry.kernels.passes.types import Floats

BINS = 2048  # 16 kB of counts
FEW = 48  # are sorted by insertion


@inner
def count_bins(v: Floats, size: int, low: float, scale: float, counts: NDArray[np.int64]) -> None:
    """Histogram of the first ``size`` of ``v`` over bins of width 1/scale from ``low`` on."""
    last = np.uint64(counts.size - 1)
    for b in range(counts.size):
        counts[b] = 0
    for i in range(np.uint64(0), np.uint64(size)):
        counts[min(np.uint64((v[i] - low) * scale), last)] += 1


@inner
def collect(
    v: Floats, size: int, low: float, scale: float, wanted: int, bins: int, into: Floats
) -> tuple[int, float]:
    """Copy the values of one bin; return how many, and the least value of all bins above it."""
    last = np.uint64(bins - 1)
    bin_ = np.uint64(wanted)
    found = np.uint64(0)
    above = np.inf
    for i in range(np.uint64(0), np.uint64(size)):
        b = min(np.uint64((v[i] - low) * scale), last)
        into[found] = v[i]  # overwritten by the next unless it belongs to the bin: cheaper than a jump
        found = np.uint64(found + np.uint64(b == bin_))
        above = v[i] if b > bin_ and v[i] < above else above
    return int(found), above


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
def two_of_rank(
    K: Floats, K_min: float, K_max: float, rank: int, one: Floats, other: Floats, counts: NDArray[np.int64]
) -> tuple[float, float]:
    """Return the values that would be at places ``rank`` and ``rank + 1`` (or the last) of K sorted.

    Args:
        K: (n,) finite.
        K_min: the least of K.
        K_max: the greatest, above K_min.
        rank: 0 … n - 1.
        one: (n,) scratch.
        other: (n,) scratch.
        counts: (BINS,) scratch.

    """
    size, low, high, above = K.size, K_min, K_max, np.inf
    scale = counts.size / (high - low)
    count_bins(K, size, low, scale, counts)
    first = True
    while True:
        b = 0
        while rank >= counts[b]:
            rank -= counts[b]
            b += 1
        if first:
            found, higher = collect(K, size, low, scale, b, counts.size, one)
        else:
            found, higher = collect(one, size, low, scale, b, counts.size, other)
            for i in range(found):
                one[i] = other[i]
        above = min(above, higher)
        low, high = np.inf, -np.inf
        for i in range(found):
            low, high = min(low, one[i]), max(high, one[i])
        scale = counts.size / (high - low) if high > low else np.inf
        if found <= FEW or found == size or not scale < np.inf:
            break
        first, size = False, found
        count_bins(one, size, low, scale, counts)
    if high > low:
        if found <= FEW:
            sort_few(one, found)
        else:  # values that no histogram can part, as next to the smallest or largest float there is
            one[:found].sort()
    value = one[rank]
    following = one[rank + 1] if rank + 1 < found else above
    return value, following if following < np.inf else value


@inner
def percentile(
    K: Floats, K_min: float, K_max: float, percent: float, one: Floats, other: Floats,
    counts: NDArray[np.int64],
) -> float:  # fmt: skip
    """Return a percentile of K, linearly interpolated; the arguments are those of `two_of_rank`."""
    if percent <= 0:
        return K_min
    if percent >= 100:
        return K_max
    place = (K.size - 1) * (percent / 100)
    rank = math.floor(place)
    part = place - rank
    value, following = two_of_rank(K, K_min, K_max, rank, one, other, counts)
    # From the nearer of the two, as numpy does: else rounding could pass the farther one.
    if part >= 0.5:
        return following - (following - value) * (1 - part)
    return value + (following - value) * part
