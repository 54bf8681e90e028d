"""Tangential relaxation: each vertex towards the weighted mean of its neighbours, within its tangent plane."""

from __future__ import annotations

from spherify.geometry.kernels.passes.jit import inner
from spherify.geometry.kernels.passes.movement import Places, load, store
from spherify.geometry.kernels.passes.tracing import repeated, traced
from spherify.geometry.kernels.passes.types import Buffers, Connectivity, Floats, Index
from spherify.geometry.kernels.passes.wide import (
    LANES,
    Array,
    Lane,
    Place,
    Row,
    Wide,
    across,
    columns,
    equal,
    where,
)
from spherify.geometry.kernels.passes.wide_vectors import difference, dot


@inner
def weigh(area: Floats, exponent: float, greatest: float, low: Index, high: Index) -> None:
    """Turn the areas at each vertex into its weight as a neighbour, w = (area / greatest area)^exponent."""
    if exponent == 0:
        for p in range(low, high):
            area[p] = 1.0
    elif exponent != 1:  # 1 needs nothing: a common factor of all weights does not matter
        for p in range(low, high):
            area[p] = (area[p] / greatest) ** exponent


@traced
def relax_group(
    places: Places, ring: Array, weighed: Array, normals: tuple[Array, Array, Array], fraction: Wide,
    low: Place, count: Place, degree: Place, at: Place, step: Place,
) -> None:  # fmt: skip
    """Move a group by ``fraction`` of u - (u·n_p) n_p, with the umbrella vector u = Σ w_q q / Σ w_q - p, or 0."""

    def further(j: Place, sums: tuple[Row, ...]) -> tuple[Row, ...]:
        rows = weighed.rows(ring, at + j * step)
        return tuple(sum_ + row for sum_, row in zip(sums, rows, strict=True))

    zero = equal(fraction, 0.0)
    nothing: tuple[Row, ...] = tuple(across((zero, zero, zero, zero)))
    sums: tuple[Row, ...] = repeated(degree, nothing, further)
    sx, sy, sz, total = columns(sums)
    p, some = load(places, low), ~(total.is_zero())
    by = 1.0 / where(some, total, 1.0)
    u = difference((sx * by, sy * by, sz * by), p)
    u = (where(some, u[0], 0.0), where(some, u[1], 0.0), where(some, u[2], 0.0))
    n = (normals[0].load(low), normals[1].load(low), normals[2].load(low))
    along = dot(u, n)
    x, y, z = (part + fraction * (one - along * normal) for part, one, normal in zip(p, u, n, strict=True))
    store(places, (x, y, z), (x, y, z, x), low, count)


@inner
def relax(mesh: Connectivity, use: Buffers, fraction: float, first_run: int, last_run: int) -> None:
    """Relax the vertices of some runs, by their neighbours in ``use.weighed``."""
    places = Places(use.position[0], use.position[1], use.position[2], use.rows)
    normals = use.normal[0], use.normal[1], use.normal[2]
    for r in range(first_run, last_run):
        low, last = Lane(mesh.runs[r, 0]), Lane(mesh.runs[r, 1])
        degree, at = Lane(mesh.runs[r, 3]), Lane(mesh.runs[r, 4])
        step = last - low
        if degree == Lane(0):  # no face has these vertices, and nobody asks for their rows
            continue
        for k in range(Lane(0), step, Lane(LANES)):
            count = min(Lane(LANES), step - k)
            relax_group(
                places, mesh.ring, use.weighed, normals, fraction, low + k, count, degree, at + k, step
            )  # fmt: skip
