"""Eight numbers at a time: traced functions against numpy."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray

from spherify.geometry.kernels.buffers import aligned
from spherify.geometry.kernels.passes.angles import (
    ARCSINE,
    ARCSINE_OF_SMALL,
    SLIGHT,
    SMALL,
    arctangent,
    inverse_root,
    inverse_root_by_division,
)
from spherify.geometry.kernels.passes.tracing import either, repeated, traced
from spherify.geometry.kernels.passes.wide import (
    LANES,
    Array,
    Lane,
    Place,
    Row,
    Wide,
    across,
    columns,
    first_lanes,
    polynomial,
    where,
)

Floats = NDArray[np.float64]
EPSILON = np.finfo(float).eps


def eight_by_eight(body: Callable[..., Wide], *arguments: Floats) -> Floats:
    """Return what a function of wide numbers makes of arrays, whose length is a multiple of eight."""

    @traced
    def group(to: Array, from_: tuple[Array, ...], low: Place) -> None:
        to.store(low, body(*(array.load(low) for array in from_)))

    @njit
    def all_of_them(to: Floats, from_: Any) -> None:
        for low in range(Lane(0), Lane(to.size), Lane(LANES)):
            group(to, from_, low)

    result = np.empty_like(arguments[0])
    all_of_them(result, arguments)
    return result


def spread(count: int = 16_000) -> Floats:
    """Return numbers of all sizes."""
    return np.exp(np.random.default_rng(3).uniform(-600, 600, count))


@pytest.mark.parametrize("root", [inverse_root, inverse_root_by_division])
def test_inverse_roots_are_good_to_the_last_bits(root: Callable[[Wide], Wide]):
    x = spread()
    exact = 1 / np.sqrt(x.astype(np.longdouble))
    assert np.abs(eight_by_eight(root, x) / exact - 1).max() <= 2 * EPSILON


def test_the_inverse_root_of_nothing_times_nothing_is_nothing():
    assert (eight_by_eight(inverse_root, np.zeros(8)) * 0 == 0).all()


@pytest.mark.parametrize(("coefficients", "most"), [(ARCSINE, SLIGHT), (ARCSINE_OF_SMALL, SMALL)])
def test_slight_angles_are_good_to_the_last_bit(coefficients: Sequence[float], most: float):
    squared = np.append(most * np.random.default_rng(3).uniform(0, 1, 16_000) ** 4, [1e-300, most] * 4)
    u = np.sqrt(squared.astype(np.longdouble))
    found = eight_by_eight(lambda q: polynomial(coefficients, q), squared)
    assert np.abs(found / (np.arcsin(u) / u) - 1).max() <= 2 * EPSILON


def test_angles_all_around():
    angle = np.random.default_rng(3).uniform(-np.pi, np.pi, 16_000)
    angle[:16] = np.tile([0.0, np.pi / 2, -np.pi / 2, 3.0], 4)
    found = eight_by_eight(arctangent, 3.0 * np.sin(angle), 3.0 * np.cos(angle))
    assert np.allclose(found, angle, rtol=2e-15, atol=2e-16)


def test_where_and_either_choose():
    x = np.array([-2.0, -1.0, 0.0, 1.0, 2.0, np.nan, np.inf, 4.0, *range(5, 13)])

    def body(value: Wide) -> Wide:
        positive = where(value > 0.0, value, -1.0)
        return either((value < 0.0).any(), lambda: positive * 2.0, lambda: positive * 3.0)

    expected = np.where(x > 0, x, -1.0) * np.repeat([2.0, 3.0], 8)
    assert np.array_equal(eight_by_eight(body, x), expected)


@pytest.mark.parametrize("count", range(9))
def test_part_of_a_group_is_written_and_no_more(count: int):
    @traced
    def write(to: Array, rows: Array, from_: Array, wanted: Place) -> None:
        value = from_.load(0)
        to.store(0, value, wanted)
        to.store(LANES, where(first_lanes(wanted), value, 0.0))
        rows.store_rows(wanted - wanted, across((value, value + 1.0, value + 2.0, value + 3.0)), wanted)

    @njit
    def call(to: Floats, rows: Floats, from_: Floats, wanted: int) -> None:
        write(to, rows, from_, wanted)

    to, rows, from_ = np.full(16, -1.0), aligned(1, 40)[0], np.arange(10.0, 18.0)
    rows[:] = -1
    call(to, rows, from_, count)
    assert np.array_equal(to[:8], np.where(np.arange(8) < count, from_, -1))
    assert np.array_equal(to[8:], np.where(np.arange(8) < count, from_, 0))
    expected = np.where(np.arange(8)[:, None] < count, from_[:, None] + np.arange(4), -1)
    assert np.array_equal(rows[:32].reshape(8, 4), expected)
    assert (rows[32:] == -1).all()


@pytest.mark.parametrize("times", [1, 2, 7])
def test_rows_that_are_named_come_as_columns(times: int):
    @traced
    def sums(to: Array, rows: Array, index: Array, rounds: Place) -> None:
        def further(
            j: Place, before: tuple[tuple[Row, ...], tuple[Wide]]
        ) -> tuple[tuple[Row, ...], tuple[Wide]]:
            here = rows.rows(index, (j + 1) * LANES)
            added = tuple(sum_ + row for sum_, row in zip(before[0], here, strict=True))
            return added, (before[1][0] + columns(here)[0],)

        first = rows.rows(index, rounds - rounds)
        last = repeated(rounds, (tuple(first), (columns(first)[0],)), further)
        for k, column in enumerate((*columns(last[0]), last[1][0])):
            to.store(k * LANES, column)

    @njit
    def call(to: Floats, rows: Floats, index: NDArray[np.uint32], rounds: int) -> None:
        sums(to, rows, index, rounds)

    random = np.random.default_rng(times)
    rows, index = aligned(50, 4), random.integers(0, 50, (times + 1) * 8).astype(np.uint32)
    rows[:] = random.integers(0, 100, (50, 4))
    to = np.empty(40)
    call(to, rows.reshape(-1), index, times)
    expected = rows[index].reshape(times + 1, 8, 4).sum(axis=0).T
    assert np.array_equal(to[:32].reshape(4, 8), expected)
    assert np.array_equal(to[32:], expected[0])


def test_a_function_apart_gives_the_same():
    def twice(values: tuple[Array, Array], by: Wide, k: Place) -> Place:
        values[1].store(k, values[0].load(k) * by)
        return k + 5

    calls = [traced(twice), traced(twice, apart=True)]
    within, outside = calls

    @njit
    def call(a: Floats, b: Floats, c: Floats, by: float) -> tuple[int, int]:
        return within((a, b), by, Lane(8)), outside((a, c), by, Lane(8))

    a = np.arange(16.0)
    b, c = np.zeros(16), np.zeros(16)
    assert call(a, b, c, 3.0) == (13, 13)
    assert np.array_equal(b, c)
    assert np.array_equal(b, np.where(a < 8, 0, 3 * a))


def test_what_the_processor_cannot_do_in_one_is_still_rounded_once_and_written_out_once():
    """Without an instruction for a·b + c each is eight calls: at every place they would be most of the code."""
    code = (
        "import numpy as np; from numba import njit\n"
        "from spherify.geometry.kernels.passes.tracing import traced\n"
        "def twenty(a):\n"
        "    x = a.load(0)\n"
        "    for _ in range(20): a.store(0, x.fma(x, -(1 + 2.0**-29))); x = x + 0.0 * a.load(0)\n"
        "group = traced(twenty, apart=True); call = njit(lambda a: group(a))\n"
        "a = np.full(8, 1 + 2.0**-30); call(a); print(set(a) == {2.0**-60})\n"
        "print(max(asm.count('callq') for asm in call.inspect_asm().values()))"
    )
    processor = {"NUMBA_CPU_NAME": "x86-64", "NUMBA_CPU_FEATURES": "+sse2", "PATH": "/usr/bin"}
    run = subprocess.run(
        [sys.executable, "-c", code], env=processor, check=True, capture_output=True, text=True
    )
    rounded_once, calls = run.stdout.split()
    assert rounded_once == "True"
    assert 20 + 8 <= int(calls) < 2 * 20
