"""Vertices run by run: K, n_p, area and least altitude of each, by its ring where it has one."""

from __future__ import annotations

import numpy as np

from spherify.geometry.kernels.passes.corners import vertex
from spherify.geometry.kernels.passes.groups import FULL, MEASURED, PLAIN, Block, Results, Surface
from spherify.geometry.kernels.passes.jit import inner
from spherify.geometry.kernels.passes.rings import BLOCK, measure_block, ring_block
from spherify.geometry.kernels.passes.tracing import repeated, traced
from spherify.geometry.kernels.passes.types import (
    DUAL_AREA,
    RING,
    VTK,
    Buffers,
    Connectivity,
    Mode,
    Scratch,
)
from spherify.geometry.kernels.passes.whole import Sums, begin_run, end_run, integrate
from spherify.geometry.kernels.passes.wide import LANES, Array, Place, Wide, first_lanes, where


@traced
def note_extremes(K: Array, least: Array, greatest: Array, off: Array, low: Place, count: Place) -> None:
    """Bring the running extremes of each lane up to date with a block of vertices.

    ``off`` stays 0 as long as all K are finite: 0·K is not a number where K is infinite or none itself.
    """

    def further(group: Place, before: tuple[Wide, Wide, Wide]) -> tuple[Wide, Wide, Wide]:
        here = K.load(low + group * LANES)
        there = first_lanes(count - group * LANES)
        return (
            where(there & (here < before[0]), here, before[0]),
            where(there & (here > before[1]), here, before[1]),
            where(there, here.fma(0.0, before[2]), before[2]),
        )

    groups = (count + (LANES - 1)).divided_by(LANES)
    extremes = repeated(groups, (least.load(0), greatest.load(0), off.load(0)), further)
    for row, value in zip((least, greatest, off), extremes, strict=True):
        row.store(0, value)


@inner
def begin_vertices(scratch: Scratch) -> None:
    """Begin a pass over vertices."""
    rows = scratch.rows
    for j in range(LANES):
        rows[0, j], rows[1, j], rows[2, j] = np.inf, -np.inf, 0.0
    for k in range(rows.shape[1]):
        rows[4, k] = 0.0  # with vertices nobody asks for edges, whose roots cost more than all other sums


@inner
def see_run(
    mesh: Connectivity,
    use: Buffers,
    scratch: Scratch,
    mode: Mode,
    weighed: bool,
    measured: bool,
    r: int,
    fetch: int,
) -> None:
    """Compute the vertices of a run.

    Areas are written only where they are ``weighed`` or ``measured``, which is: with the sums of the surface. What
    belongs to as many vertices from ``fetch`` on is brought near meanwhile, unless that is 0.
    """
    x, y, z = use.position[0], use.position[1], use.position[2]
    K, area, altitude, rows = use.curvature, use.area, use.altitude, scratch.rows
    px, py, pz = use.normal[0], use.normal[1], use.normal[2]
    least, greatest, off, volume, lengths = rows[0], rows[1], rows[2], rows[3], rows[4]
    sums = Sums(rows[5], rows[6], rows[7], rows[8], rows[9], rows[10])
    surface = Surface(x, y, z, mesh.ring, use.rows, use.weighed)
    to = Results(K, px, py, pz, area, altitude, volume, lengths, scratch.flats)
    by_area, dual = mode.measure == VTK, np.uint64(mode.measure == DUAL_AREA)
    extras = FULL if weighed or mode.step_bound > 0 or mode.measure == DUAL_AREA else PLAIN
    extras = MEASURED if measured else extras
    low, last = mesh.runs[r, 0], mesh.runs[r, 1]
    step, degree = np.uint64(last - low), np.uint64(mesh.runs[r, 3])
    at = mesh.runs[r, 4]
    scale = (3.0 if by_area else 1.0) / degree
    if measured:
        begin_run(sums)
    while low < last:
        count = min(np.uint32(BLOCK), np.uint32(last - low))
        by_ring, flat = mesh.runs[r, 2] == RING, np.uint64(0)
        if by_ring:
            block = Block(
                scale, dual, np.uint64(low), np.uint64(count), np.uint64(at), step, degree, np.uint64(fetch)
            )
            flat = ring_block(surface, to, block, by_area, extras)
        if not by_ring or flat != np.uint64(0):
            for k in range(np.uint32(0), count):
                bit = np.uint64(1) << np.uint64(k % np.uint32(LANES))
                if not by_ring or scratch.flats[k // np.uint32(LANES)] & bit:
                    p = np.uint32(low + k)
                    vertex(
                        x, y, z, mesh.corners, mesh.halfedges, mesh.twins,
                        mesh.first[p], mesh.first[np.uint32(p + np.uint32(1))],
                        mode.measure, K, px, py, pz, area, altitude, p,
                    )  # fmt: skip
        note_extremes(K, least, greatest, off, np.uint64(low), np.uint64(count))
        if measured:
            integrate((x, y, z), area, volume, lengths, sums, np.uint64(low), np.uint64(count))
        low = np.uint32(low + count)
        at = np.uint32(at + count)
        if fetch > 0:
            fetch = int(fetch + np.int64(count))
    if measured:
        end_run(sums, use.sums[r])


@inner
def end_vertices(scratch: Scratch) -> tuple[float, float, bool]:
    """Return the extremes of the K of a pass, and whether all are finite."""
    K_min, K_max, off = np.inf, -np.inf, 0.0
    for j in range(LANES):
        K_min = min(K_min, scratch.rows[0, j])
        K_max = max(K_max, scratch.rows[1, j])
        off += scratch.rows[2, j]
    return K_min, K_max, off == 0


@inner
def measure_run(mesh: Connectivity, use: Buffers, scratch: Scratch, r: int, fetch: int) -> None:
    """Measure the vertices of a run, which has rings; ``fetch`` as of `see_run`."""
    x, y, z = use.position[0], use.position[1], use.position[2]
    rows, area = scratch.rows, use.area
    volume, lengths = rows[3], rows[4]
    sums = Sums(rows[5], rows[6], rows[7], rows[8], rows[9], rows[10])
    surface = Surface(x, y, z, mesh.ring, use.rows, use.weighed)
    K, normal = use.curvature, use.normal
    to = Results(K, normal[0], normal[1], normal[2], area, use.altitude, volume, lengths, scratch.flats)
    low, last = np.uint64(mesh.runs[r, 0]), np.uint64(mesh.runs[r, 1])
    step, degree, at = last - low, np.uint64(mesh.runs[r, 3]), np.uint64(mesh.runs[r, 4])
    begin_run(sums)
    while low < last:
        count = min(np.uint64(BLOCK), last - low)
        measure_block(surface, to, Block(1.0, np.uint64(0), low, count, at, step, degree, np.uint64(fetch)))
        integrate((x, y, z), area, volume, lengths, sums, low, count)
        low += count
        at += count
        if fetch > 0:
            fetch = int(fetch + np.int64(count))
    end_run(sums, use.sums[r])
