"""A step's movement and the next step's curvature in one sweep over the vertices.

The ring of a vertex can be computed as soon as its neighbours have moved, and these are near in memory. So each run is
seen while what has just been moved is in the cache still: positions, curvature and normals come from memory once a step
instead of two to three times, which is what a step of a million vertices waits for.

Before that, threads move what others have neighbours among. All in all every vertex is moved once and seen once, by
itself, so that the order changes no byte.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spherify.geometry.kernels.passes.jit import inner
from spherify.geometry.kernels.passes.meeting import meet
from spherify.geometry.kernels.passes.movement import Along, move
from spherify.geometry.kernels.passes.relaxation import relax, weigh
from spherify.geometry.kernels.passes.types import (
    BACK,
    FIRST,
    LAST,
    ON,
    Buffers,
    Connectivity,
    Found,
    Mode,
    Scratch,
    Task,
)
from spherify.geometry.kernels.passes.vertices import begin_vertices, end_vertices, measure_run, see_run
from spherify.geometry.kernels.passes.wide import LANES


class Borders(NamedTuple):
    """The runs of a part up to which, and from which on, threads do something before all meet.

    Attributes:
        head: up to which all is relaxed; without relaxation: moved.
        tail: from which on.
        far_head: up to which all is moved, so that those can be relaxed.
        far_tail: from which on.

    """

    head: int
    tail: int
    far_head: int
    far_tail: int


@inner
def entry_of(mesh: Connectivity, run: int, column: int) -> int:
    """Return a number of a run; numba takes an unsigned and a signed one together to a float."""
    return int(np.int64(mesh.runs[run, column]))


@inner
def begins(mesh: Connectivity, run: int) -> int:
    """Return the first vertex of a run, or, behind the last run, the number of all vertices."""
    count = mesh.runs.shape[0]
    return entry_of(mesh, run, FIRST) if run < count else entry_of(mesh, count - 1, LAST)


@inner
def reach_on(mesh: Connectivity, task: Task, run: int) -> int:
    """Return behind which run of a part no neighbours of the runs before ``run`` are."""
    on = entry_of(mesh, run - 1, ON) if run > 0 else 0
    return min(max(task.first_run, on), task.last_run)


@inner
def reach_back(mesh: Connectivity, task: Task, run: int) -> int:
    """Return before which run of a part no neighbours of ``run`` and those behind it are."""
    count = mesh.runs.shape[0]
    back = entry_of(mesh, run, BACK) if run < count else count
    return min(max(task.first_run, back), task.last_run)


@inner
def borders(mesh: Connectivity, task: Task, all_of_it: bool) -> Borders:
    """Return where the borders of a part are; ``all_of_it``: as if everybody had neighbours everywhere."""
    last = task.last_run
    head, tail = reach_on(mesh, task, task.first_run), reach_back(mesh, task, last)
    if all_of_it or head >= tail:
        return Borders(last, last, last, last)
    far_head, far_tail = reach_on(mesh, task, head), reach_back(mesh, task, tail)
    if far_head >= far_tail:
        return Borders(head, tail, last, last)
    return Borders(head, tail, far_head, far_tail)


@inner
def move_on(use: Buffers, mode: Mode, task: Task, found: Found, outward: bool, low: int, high: int) -> int:
    """Move the vertices from ``low`` on; if they are to be relaxed then, their neighbours see them by their weights.

    Returns:
        where the next ones begin: ``high``, or ``low`` if that is behind it.

    """
    if high <= low:
        return low
    weighed = task.relaxation > 0
    if weighed:
        weigh(use.area, mode.relaxation_exponent, found.greatest, np.uint32(low), np.uint32(high))
    along = Along(
        found.K_min, found.K_max - found.K_min, task.step,
        np.uint64(outward), mode.step_bound, np.uint64(mode.step_bound > 0),
    )  # fmt: skip
    move(use, along, weighed, np.uint32(low), np.uint32(high))
    return high


@inner
def hold(mesh: Connectivity, use: Buffers, back: bool) -> None:
    """Note where the held vertices are, or put them back there."""
    for i in range(mesh.held.size):
        for k in range(3):
            if back:
                use.position[k, mesh.held[i]] = use.held_position[k, i]
                use.rows[np.uint64(4) * mesh.held[i] + np.uint64(k)] = use.held_position[k, i]
            else:
                use.held_position[k, i] = use.position[k, mesh.held[i]]


@inner
def sweep(
    mesh: Connectivity, use: Buffers, scratch: Scratch, mode: Mode, task: Task, found: Found,
    moves: bool, outward: bool, sees: bool, measured: bool, holds: bool,
) -> tuple[float, float, bool]:  # fmt: skip
    """Move the vertices of a part, relax them, and see them where they are then.

    Args:
        mesh: the connectivity.
        use: the buffers.
        scratch: of the thread.
        mode: see there.
        task: of the thread.
        found: of the step they move in.
        moves: whether they move; they stay else.
        outward: which way.
        sees: whether they are seen.
        measured: whether the sums of the surface are taken, along with that or by themselves.
        holds: whether some are put back after they have moved.

    Returns:
        the extremes of K, and whether all are finite.

    """
    weighed = task.relaxation > 0
    border = borders(mesh, task, holds or not (sees or measured) or not mode.at_once)
    relaxed, moved = border.head, begins(mesh, border.far_head if weighed else border.head)
    end = begins(mesh, border.far_tail if weighed else border.tail)
    if moves:
        for low, high in ((begins(mesh, task.first_run), moved), (end, begins(mesh, task.last_run))):
            move_on(use, mode, task, found, outward, low, high)
        meet(use, task)
        if weighed:
            for first, last in ((task.first_run, border.head), (border.tail, task.last_run)):
                relax(mesh, use, task.relaxation, first, last)
            meet(use, task)
        if holds:
            if task.part == 0:
                hold(mesh, use, True)
            meet(use, task)
    fetched, behind = 0, begins(mesh, task.last_run)
    begin_vertices(scratch)
    for r in range(task.first_run, task.last_run if sees or measured else task.first_run):
        wanted = entry_of(mesh, r, ON)
        if moves:
            wanted = min(wanted, border.tail)
            near = entry_of(mesh, wanted - 1, ON) if weighed else wanted
            # In whole groups, as far as there is something to move.
            to = min((begins(mesh, near) + LANES - 1) // LANES * LANES, end)
            moved = move_on(use, mode, task, found, outward, moved, to)
            if weighed and wanted > relaxed:
                relax(mesh, use, task.relaxation, relaxed, wanted)
                relaxed = wanted
        # What follows is brought near while there is much to compute; behind the part are others, or nothing.
        fetched = max(fetched, moved if moves else begins(mesh, wanted))
        fetch = fetched if mode.at_once and fetched < behind else 0
        if sees:
            see_run(mesh, use, scratch, mode, weighed, measured, r, fetch)
        else:
            measure_run(mesh, use, scratch, r, fetch)
        fetched += entry_of(mesh, r, LAST) - entry_of(mesh, r, FIRST)
    return end_vertices(scratch)
