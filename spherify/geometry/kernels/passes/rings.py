"""The heart of a step: curvature K and normal n_p of every vertex, straight from the ring of its neighbours.

Once around a vertex p: d_j are the edge vectors to its neighbours in order, N_j = d_j-1 × d_j twice the area vectors of
its faces. Then everything follows without going back to memory:

    n_p  ∝ Σ N_j / |N_j|
    θ_j  = atan2(-|d_j| · (d_j-1 · N_j+1), N_j · N_j+1), for N_j × N_j+1 = d_j (d_j-1 · N_j+1)

Faces and edges are computed anew at each of their vertices, three times and twice. Keeping them would take 84 numbers
from all over the memory for each vertex; this takes one row of it for each neighbour. Eight vertices of a run, which
have as many neighbours each (`Connectivity.runs`), are a group; all that belongs to it stays in registers, see `wide`.
For the commonest degrees the way around is one straight piece of code; for others it is a loop, which computes all
that may be wanted (`groups.Around`).

Where the surface bends little over all edges of a group, as nearly everywhere on a fine mesh, θ is the arcsine of a
sine that the way around gives without a root or a cosine. What is in a group depends on the mesh alone, so that the
bytes do not depend on the number of threads.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeAlias

from spherify.geometry.kernels.passes.groups import (
    FULL,
    MEASURED,
    PLAIN,
    Block,
    Group,
    Results,
    Surface,
    any_measure_group,
    any_ring_group,
    measure_group,
    ring_group,
)
from spherify.geometry.kernels.passes.jit import inner
from spherify.geometry.kernels.passes.tracing import alternatively, repeated, traced
from spherify.geometry.kernels.passes.wide import LANES, Lane, Place

BLOCK: Final = 256  # vertices, at most, that are computed by one call
ROWS: Final = 11  # of a thread's scratch
STRIDE: Final = (
    BLOCK + LANES
)  # rows that do not begin at equal places of a page, where loads would wait for stores
FEWEST, MOST = 3, 8  # neighbours for which there is code of its own

Sweep: TypeAlias = Callable[[Surface, Results, Block], Any]


def _fetch(surface: Surface, to: Results, place: Place, *, weighed: bool) -> None:
    """Have what a group moves by, and is written to by that, brought near; ``weighed``: and is relaxed then."""
    for array in (surface.x, surface.y, surface.z, to.K, to.px, to.py, to.pz):
        array.fetch(place)
    for line in range(4):  # of eight rows
        surface.rows.fetch(place * 4 + line * LANES)
        if weighed:
            surface.weighed.fetch(place * 4 + line * LANES)
    if weighed:
        to.area.fetch(place)
        to.altitude.fetch(place)


def _sweep(group: Group, *, weighed: bool) -> Sweep:
    """Make the pass over the groups of a block; not 0 if any vertex has a flat face; ``weighed`` as of `_fetch`."""

    def sweep(surface: Surface, to: Results, block: Block) -> Place:
        def further(number: Place, some: tuple[Place]) -> tuple[Place]:
            k = number * LANES
            alternatively(
                block.fetch > 0,
                lambda: _fetch(surface, to, block.fetch + k, weighed=weighed),
                lambda: None,
            )
            flat = group(surface, to, block, k)
            to.flats.store_number(number, flat)
            return (some[0] | flat,)

        groups = (block.count + (LANES - 1)).divided_by(LANES)
        some: Place = repeated(groups, (block.count - block.count,), further)[0]
        return some

    return traced(sweep, apart=True)


def _by_extras(plain: Sweep, full: Sweep, measured: Sweep) -> Callable[[Surface, Results, Block, int], Any]:
    """Make the choice among these."""

    @inner
    def sweep(surface: Surface, to: Results, block: Block, extras: int) -> Any:  # noqa: ANN401 - an integer
        if extras == FULL:
            return full(surface, to, block)
        if extras == MEASURED:
            return measured(surface, to, block)
        return plain(surface, to, block)

    return sweep


def _of_degree(degree: int) -> Callable[[Surface, Results, Block, bool, int], Any]:
    """Make the choice among the sweeps of that degree and of all that follow."""
    if degree <= MOST:
        over_area, whole = (
            _by_extras(
                *(
                    _sweep(ring_group(degree, extras, by_area=by_area), weighed=extras == FULL)
                    for extras in (PLAIN, FULL, MEASURED)
                )
            )
            for by_area in (True, False)
        )
        others = _of_degree(degree + 1)
    else:
        over_area, whole = (
            _by_extras(*[_sweep(any_ring_group(by_area=by_area), weighed=True)] * 3)
            for by_area in (True, False)
        )
        others = None

    @inner
    def these(surface: Surface, to: Results, block: Block, by_area: bool, extras: int) -> Any:  # noqa: ANN401 - an integer
        if by_area:
            return over_area(surface, to, block, extras)
        return whole(surface, to, block, extras)

    if others is None:
        return these

    @inner
    def sweep(surface: Surface, to: Results, block: Block, by_area: bool, extras: int) -> Any:  # noqa: ANN401 - an integer
        if block.degree == Lane(degree):
            return these(surface, to, block, by_area, extras)
        return others(surface, to, block, by_area, extras)

    return sweep


ring_block: Final = _of_degree(FEWEST)
"""Compute the vertices of a block, with one of PLAIN, FULL and MEASURED; whether any has a flat face."""


def _measuring_of_degree(degree: int) -> Sweep:
    """Make the choice among the measurements of that degree and of all that follow."""
    if degree > MOST:
        return _sweep(any_measure_group(), weighed=True)
    these, others = _sweep(measure_group(degree), weighed=True), _measuring_of_degree(degree + 1)

    @inner
    def sweep(surface: Surface, to: Results, block: Block) -> Any:  # noqa: ANN401 - as above
        if block.degree == Lane(degree):
            return these(surface, to, block)
        return others(surface, to, block)

    return sweep


measure_block: Final = _measuring_of_degree(FEWEST)
"""Measure what is at the vertices of a block: areas, volumes and lengths, and nothing else."""
