"""Timing of rivals in one run, so that what else the machine does meets all of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from statistics import median


def best_of(rivals: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Return the least seconds of each rival, timed in turn, round after round, after one call that prepares it."""
    best = dict.fromkeys(rivals, float("inf"))
    for run in rivals.values():
        run()
    for _ in range(rounds):
        for name, run in rivals.items():
            best[name] = min(best[name], seconds(run))
    return best


def median_of(run: Callable[[], object], rounds: int) -> float:
    """Return the median seconds of some calls, after one that prepares it."""
    run()
    return median(seconds(run) for _ in range(rounds))


def seconds(run: Callable[[], object]) -> float:
    """Return how long a call takes."""
    began = time.perf_counter()
    run()
    return time.perf_counter() - began
