"""What one thread works on, and where a pass that adds up keeps its sums."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from spherify.geometry.kernels.passes.jit import inner
from spherify.geometry.kernels.passes.totals import total_of
from spherify.geometry.kernels.passes.types import Floats

BLOCK: Final = 128  # each of its places has sums of its own, so that none waits for another
SEGMENT: Final = 64 * BLOCK  # whose sums are the same whoever adds them up
SUMS: Final = 3


class Span(NamedTuple):
    """One thread's part of all that a pass may go over: vertices, runs of them, segments of them, and of faces.

    Each attribute named ``first…`` is the first of the part, the one named ``last…`` is one behind its last.
    """

    first: np.uint32
    last: np.uint32
    first_run: int
    last_run: int
    first_stretch: int
    last_stretch: int
    first_segment: int
    last_segment: int


class Sums(NamedTuple):
    """What a pass adds up.

    Attributes:
        lanes: (SUMS, BLOCK) of the thread.
        whole: (segments, SUMS) of all threads.

    """

    lanes: Floats
    whole: Floats


@inner
def begin_sums(lanes: Floats, first: float, second: float, third: float) -> None:
    """Write what the sums of a segment begin with."""
    for j in range(BLOCK):
        lanes[0, j], lanes[1, j], lanes[2, j] = first, second, third


@inner
def end_sums(lanes: Floats, sums: Floats) -> None:
    """Write the sums (SUMS,) of a segment."""
    for k in range(SUMS):
        sums[k] = total_of(lanes[k, :BLOCK])
