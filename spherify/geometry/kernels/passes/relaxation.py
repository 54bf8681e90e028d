"""Tangential relaxation: each vertex towards the weighted mean of its neighbours, within its tangent plane."""

from __future__ import annotations

import numpy as np

from spherify.geometry.kernels.passes.arithmetic import fma
from spherify.geometry.kernels.passes.jit import inner
from spherify.geometry.kernels.passes.straight import BLOCK
from spherify.geometry.kernels.passes.types import Buffers, Connectivity, Floats, Index, Indices, Scratch


@inner
def weigh(area: Floats, exponent: float, greatest: float, low: Index, high: Index) -> None:
    """Turn the areas at each vertex into its weight as a neighbour, w = (area / greatest area)^exponent."""
    if exponent == 0:
        for p in range(low, high):
            area[p] = 1.0
    elif exponent != 1:  # 1 needs nothing: a common factor of all weights does not matter
        for p in range(low, high):
            area[p] = (area[p] / greatest) ** exponent


@inner
def gather_two(
    ring: Indices, w: Floats, x: Floats, y: Floats, z: Floats,
    sx: Floats, sy: Floats, sz: Floats, total: Floats, begin: bool, one: Index, two: Index, count: Index,
) -> None:  # fmt: skip
    """Add w and w·(x, y, z) of two neighbours each, to sums or, with ``begin``, to zero."""
    for k in range(np.uint32(0), count):
        q = ring[np.uint32(one + k)]
        r = ring[np.uint32(two + k)]
        u, v = w[q], w[r]
        total[k] = (0.0 if begin else total[k]) + (u + v)
        sx[k] = fma(v, x[r], fma(u, x[q], 0.0 if begin else sx[k]))
        sy[k] = fma(v, y[r], fma(u, y[q], 0.0 if begin else sy[k]))
        sz[k] = fma(v, z[r], fma(u, z[q], 0.0 if begin else sz[k]))


@inner
def gather_one(
    ring: Indices, w: Floats, x: Floats, y: Floats, z: Floats,
    sx: Floats, sy: Floats, sz: Floats, total: Floats, begin: bool, one: Index, count: Index,
) -> None:  # fmt: skip
    """Add w and w·(x, y, z) of one neighbour each."""
    for k in range(np.uint32(0), count):
        q = ring[np.uint32(one + k)]
        u = w[q]
        total[k] = (0.0 if begin else total[k]) + u
        sx[k] = fma(u, x[q], 0.0 if begin else sx[k])
        sy[k] = fma(u, y[q], 0.0 if begin else sy[k])
        sz[k] = fma(u, z[q], 0.0 if begin else sz[k])


@inner
def draw(
    mx: Floats, my: Floats, mz: Floats, px: Floats, py: Floats, pz: Floats,
    sx: Floats, sy: Floats, sz: Floats, total: Floats, x: Floats, y: Floats, z: Floats,
    fraction: float, low: Index, count: Index,
) -> None:  # fmt: skip
    """Move by ``fraction`` of u - (u·n_p) n_p, with the umbrella vector u = Σ w_q q / Σ w_q - p, or 0."""
    for k in range(np.uint32(0), count):
        p = np.uint32(low + k)
        some = total[k] != 0
        by = 1.0 / (total[k] if some else 1.0)
        ux = sx[k] * by - mx[p] if some else 0.0
        uy = sy[k] * by - my[p] if some else 0.0
        uz = sz[k] * by - mz[p] if some else 0.0
        along = ux * px[p] + uy * py[p] + uz * pz[p]
        x[p] = mx[p] + fraction * (ux - along * px[p])
        y[p] = my[p] + fraction * (uy - along * py[p])
        z[p] = mz[p] + fraction * (uz - along * pz[p])


@inner
def relax(
    mesh: Connectivity, use: Buffers, scratch: Scratch, fraction: float, first_run: int, last_run: int
) -> None:
    """Relax the vertices of some runs: read from ``use.moved``, write to ``use.position``."""
    x, y, z = use.position[0], use.position[1], use.position[2]
    mx, my, mz = use.moved[0], use.moved[1], use.moved[2]
    px, py, pz = use.normal[0], use.normal[1], use.normal[2]
    sx, sy, sz, total = scratch.rows[0], scratch.rows[1], scratch.rows[2], scratch.rows[3]
    ring, w = mesh.ring, use.area
    for r in range(first_run, last_run):
        low, last, degree, at = mesh.runs[r, 0], mesh.runs[r, 1], mesh.runs[r, 3], mesh.runs[r, 4]
        step = np.uint32(last - low)
        while low < last:
            count = min(np.uint32(BLOCK), np.uint32(last - low))
            odd = degree & np.uint32(1)
            if odd:
                gather_one(ring, w, mx, my, mz, sx, sy, sz, total, True, at, count)
            for j in range(odd, degree, np.uint32(2)):
                one = np.uint32(at + j * step)
                gather_two(
                    ring,
                    w,
                    mx,
                    my,
                    mz,
                    sx,
                    sy,
                    sz,
                    total,
                    j == np.uint32(0),
                    one,
                    np.uint32(one + step),
                    count,
                )
            draw(mx, my, mz, px, py, pz, sx, sy, sz, total, x, y, z, fraction, low, count)
            low = np.uint32(low + count)
            at = np.uint32(at + count)
