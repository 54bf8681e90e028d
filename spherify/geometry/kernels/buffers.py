"""The memory the passes write to: allocated once a kernel, and never within a step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spherify.geometry.kernels.passes import meeting, rings, selection, shape, whole
from spherify.geometry.kernels.passes.types import FOUND, Buffers, Scratch
from spherify.geometry.kernels.passes.wide import LANES
from spherify.geometry.mesh import Floats

LINE = 8  # numbers in a cache line; rows that begin with one are read in one go


@dataclass(frozen=True, eq=False, slots=True)
class Space:
    """What `spherify.geometry.kernels.passes.shape.measure` writes.

    Attributes:
        area: (m,)
        lanes: (SUMS, BLOCK and a little) for each thread.
        sums: (segments, SUMS)
        result: (RESULTS,)

    """

    area: Floats
    lanes: list[Floats]
    sums: Floats
    result: Floats

    @classmethod
    def of(cls, m: int, threads: int) -> Space:
        """Allocate it for m faces."""
        lanes = [aligned(whole.SUMS, shape.BLOCK + LINE) for _ in range(threads)]
        return cls(
            np.empty(m), lanes, np.empty((-(-m // shape.SEGMENT), whole.SUMS)), np.empty(whole.RESULTS)
        )


def buffers(n: int, n_held: int, n_runs: int, n_parts: int = 1) -> Buffers:
    """Allocate what the passes write, for n vertices in so many runs and parts, of which some are held."""
    weighed = aligned(1, 4 * n)[0]
    return Buffers(
        position=padded(3, n),
        previous=np.empty((3, 0)),  # until there is momentum
        rows=aligned(1, 4 * n)[0],
        weighed=weighed,
        moved=weighed[: 3 * n].reshape(3, n),
        normal=padded(3, n),
        curvature=padded(1, n)[0],
        area=padded(1, n)[0],
        altitude=padded(1, n)[0],
        held_position=np.empty((3, n_held)),
        bins=np.empty(n, dtype=np.uint16),
        chosen=np.empty((2, n)),
        counts=np.empty((n_parts, selection.BINS), dtype=np.int64),
        samples=np.empty((n_parts, selection.SAMPLE)),
        sums=np.empty((n_runs, whole.SUMS)),
        whole=np.empty(whole.RESULTS),
        found=np.empty((n_parts + 1, FOUND)),
        meeting=np.zeros(meeting.SIZE, dtype=np.int64),
    )


def scratch() -> Scratch:
    """Allocate what one thread writes for one block."""
    return Scratch(aligned(rings.ROWS, rings.STRIDE), np.zeros(rings.BLOCK // LANES, dtype=np.uint64))


def aligned(rows: int, columns: int) -> Floats:
    """Allocate (rows, columns) that begin with a cache line."""
    space = np.empty(rows * columns + LINE)
    start = -(space.ctypes.data // space.itemsize) % LINE
    return space[start : start + rows * columns].reshape(rows, columns)


def padded(rows: int, columns: int) -> Floats:
    """Allocate (rows, columns) with room behind, for vertices are read in groups: numbers that nobody uses."""
    return np.zeros(rows * columns + LANES)[: rows * columns].reshape(rows, columns)
