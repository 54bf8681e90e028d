"""Timing of rivals in one run, so that what else the machine does meets all of them."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable, Mapping
from statistics import median


def best_of(
    rivals: Mapping[str, Callable[[], object]],
    rounds: int,
    in_a_row: int = 1,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, float]:
    """Return the least seconds of each rival, timed in turn, round after round, after one call that prepares it.

    Args:
        rivals: what is called, by name.
        rounds: how often each has its turn.
        in_a_row: calls of a turn: the first finds the caches as its rival left them, unlike in a run of its own.
        clock: seconds; `time.process_time` where all take one thread, so that waiting for a processor does not count.

    """
    best = dict.fromkeys(rivals, float("inf"))
    for run in rivals.values():
        run()
    for _ in range(rounds):
        for name, run in rivals.items():
            best[name] = min([best[name], *(seconds(run, clock) for _ in range(in_a_row))])
    return best


def median_of(run: Callable[[], object], rounds: int) -> float:
    """Return the median seconds of some calls, after one that prepares it."""
    run()
    return median(seconds(run) for _ in range(rounds))


def seconds(run: Callable[[], object], clock: Callable[[], float] = time.perf_counter) -> float:
    """Return how long a call takes."""
    began = clock()
    run()
    return clock() - began


def in_a_process_of_its_own(measure: Callable[[int], float], size: int) -> float:
    """Return what a function of a module finds where nothing has run before."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(measure, (size,))
