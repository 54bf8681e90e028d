"""The passes in their order: an elementary step, and T."""

from __future__ import annotations

import math

import numpy as np

from spherify.geometry.kernels.passes.jit import entry, inner
from spherify.geometry.kernels.passes.meeting import meet, wait_for_all
from spherify.geometry.kernels.passes.movement import go_ahead, scale, write_rows
from spherify.geometry.kernels.passes.selection import collect_part, count_part, is_inner, percentiles
from spherify.geometry.kernels.passes.sweep import hold, sweep
from spherify.geometry.kernels.passes.totals import greatest_of
from spherify.geometry.kernels.passes.types import (
    AHEAD,
    BEYOND,
    CENTRE,
    CONSTANT,
    EXTREMES,
    HOLD,
    INTEGRATE,
    MOVE,
    MOVED,
    NOT_FINITE,
    RADII,
    ROWS,
    SCALE,
    VARIATION,
    VERTICES,
    Buffers,
    Connectivity,
    Found,
    Mode,
    Scratch,
    Task,
)
from spherify.geometry.kernels.passes.whole import PER_VERTEX, centre, is_uneven, spread_run, variation
from spherify.geometry.transformation import EQUAL_CURVATURE


@inner
def least_width(lowest: float, highest: float) -> float:
    """Return how far apart K_min and K_max must be not to count as equal."""
    return EQUAL_CURVATURE * max(abs(lowest), abs(highest))


@inner
def agreed(
    use: Buffers, task: Task, K_min: float, K_max: float, greatest: float, finite: bool
) -> tuple[float, float, float, bool]:
    """Return the extremes of what the threads have found, the same to each.

    Before this is done again there is another meeting.
    """
    if task.parts > 1:
        mine = use.found[task.part]
        mine[0], mine[1], mine[2], mine[3] = K_min, K_max, greatest, 1.0 if finite else 0.0
        wait_for_all(use.meeting, task.parts)
        for part in range(task.parts):
            other = use.found[part]
            K_min, K_max, greatest = min(K_min, other[0]), max(K_max, other[1]), max(greatest, other[2])
            finite = finite and other[3] != 0
    return K_min, K_max, greatest, finite


@inner
def extremes(use: Buffers, mode: Mode, task: Task, lowest: float, highest: float) -> tuple[float, float]:
    """Return K_min and K_max of the window; the same twice if the curvature is constant."""
    width = least_width(lowest, highest)
    if highest - lowest <= width:
        return lowest, lowest
    if is_inner(mode.window):
        count_part(use.curvature, lowest, highest, use, task.part, task.first, task.last)
        meet(use, task)
        where = collect_part(use.curvature, mode.window, use, task.first, task.last)
        meet(use, task)
        of_all = use.found[task.parts]
        if task.part == 0:
            of_all[0], of_all[1] = percentiles(use.curvature, highest, mode.window, where, use)
        meet(use, task)
        if of_all[1] - of_all[0] > width:
            return of_all[0], of_all[1]
    return lowest, highest


@inner
def measure(mesh: Connectivity, use: Buffers, scratch: Scratch, task: Task) -> None:
    """Go on from the sums that INTEGRATE has left to the figures of the surface."""
    if task.passes & CENTRE:
        if task.part == 0:
            centre(use.position, use.sums, PER_VERTEX, use.whole)
            if is_uneven(use.position, use.area, PER_VERTEX, task.variation, use.whole):
                use.whole[6] = np.nan
        meet(use, task)
        if np.isnan(use.whole[6]):
            return
    if task.passes & RADII:
        first, second = scratch.rows[0], scratch.rows[1]
        for r in range(task.first_run, task.last_run):
            low, last = mesh.runs[r, 0], mesh.runs[r, 1]
            spread_run(use.position, use.area, use.whole, first, second, use.sums[r], low, last)
        meet(use, task)
    if task.passes & VARIATION and task.part == 0:
        variation(use.sums, PER_VERTEX, use.whole)


@inner
def scale_to(use: Buffers, task: Task) -> None:
    """Scale the surface, as measured, to the area of the task about its centroid."""
    if task.area > 0:
        factor = math.sqrt(task.area / use.whole[0])
        if factor != 1:
            about = (use.whole[2], use.whole[3], use.whole[4])
            scale(use.position, about, factor, task.first, task.last)


@inner
def onward(
    mesh: Connectivity, use: Buffers, scratch: Scratch, mode: Mode, task: Task, found: Found, i: int
) -> tuple[float, float, float, bool]:
    """Do the movement of one elementary step and the curvature of the next, the i-th; as far as there are these.

    Behind the last step the surface is measured instead, or besides.

    Returns:
        the extremes of K, the greatest area at a vertex where weights ask for it, and whether all K are finite.

    """
    behind, holds = i == task.k_in + task.k_out, task.passes & HOLD != 0 and mesh.held.size > 0
    if i == 0 and task.passes & ROWS:
        write_rows(use, task.first, task.last)
        meet(use, task)
    if i == 0 and holds:
        if task.part == 0:
            hold(mesh, use, False)
        meet(use, task)
    sees = task.passes & BEYOND != 0 if behind else task.passes & VERTICES != 0 and (i > 0 or not task.known)
    measured, moves = behind and task.passes & INTEGRATE != 0, i > 0 and task.passes & MOVE != 0
    K_min, K_max, finite = sweep(
        mesh, use, scratch, mode, task, found, moves, i > task.k_in, sees, measured, holds
    )
    if not sees:
        return task.K_min, task.K_max, task.greatest, True
    greatest, exponent = task.greatest, mode.relaxation_exponent
    if task.relaxation > 0 and exponent != 0 and exponent != 1:  # noqa: PLR1714 - a set would be allocated
        greatest = greatest_of(use.area[task.first : task.last])
    return K_min, K_max, greatest, finite


@entry
def work(
    mesh: Connectivity, use: Buffers, scratch: Scratch, mode: Mode, task: Task
) -> tuple[int, float, float, float]:
    """Apply T to ``use.position``, or some of its passes, or measure: all of it, or one thread's part.

    One function for all: what takes long to compile, the vertices, is compiled once. See `Task`.

    Returns:
        what `Found` has, as a plain tuple: numba makes a named one by way of Python, where a signal's handler may run
        and raise, and then goes on without it, to a segmentation fault.

    """
    found, steps = Found(MOVED, np.inf, -np.inf, 0.0), task.k_in + task.k_out
    if task.passes & AHEAD:
        go_ahead(use.position, use.previous, task.momentum, task.first, task.last)
    if task.passes & SCALE:
        scale(use.position, task.centre, task.factor, task.first, task.last)
    for i in range(steps + 1):
        if i == steps and task.passes & (MOVE | INTEGRATE) == 0:
            break
        K_min, K_max, greatest, finite = onward(mesh, use, scratch, mode, task, found, i)
        if i == steps and task.passes & INTEGRATE == 0:
            break
        K_min, K_max, greatest, finite = agreed(use, task, K_min, K_max, greatest, finite)
        if i == steps:
            measure(mesh, use, scratch, task)
            scale_to(use, task)
            found = Found(MOVED, K_min if finite else np.nan, K_max, greatest)
            break
        end = MOVED
        if not finite:
            end = NOT_FINITE
        elif task.passes & EXTREMES:
            K_min, K_max = extremes(use, mode, task, K_min, K_max)
            end = MOVED if K_min < K_max else CONSTANT
        found = Found(end, K_min, K_max, greatest)
        if end != MOVED:
            break
    return found.end, found.K_min, found.K_max, found.greatest
