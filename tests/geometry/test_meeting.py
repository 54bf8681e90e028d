"""Threads that wait for each other within machine code."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray

from spherify.geometry.kernels.passes.meeting import SIZE, wait_for_all

Ints = NDArray[np.int64]
ROUNDS = 2_000


@njit(nogil=True)
def come_and_go(meeting: Ints, rounds: Ints, part: int) -> int:
    """Say which round it is, meet, see what the others said, meet; return how often they said something else."""
    wrong = 0
    for i in range(ROUNDS):
        rounds[part] = i
        wait_for_all(meeting, rounds.size)
        for other in rounds:
            wrong += other != i
        wait_for_all(meeting, rounds.size)
    return wrong


@pytest.mark.parametrize("parts", [1, 2, 5])
def test_nobody_goes_on_before_all_have_come(parts: int):
    """Five are more than there are processors, as a rule: who waits lets the others have theirs."""
    meeting, rounds = np.zeros(SIZE, dtype=np.int64), np.zeros(parts, dtype=np.int64)
    come_and_go(meeting, rounds[:1].copy(), 0)  # makes the machine code
    with ThreadPoolExecutor(parts) as pool:
        done = [pool.submit(come_and_go, meeting, rounds, part) for part in range(parts)]
        assert [one.result(timeout=60) for one in done] == [0] * parts
