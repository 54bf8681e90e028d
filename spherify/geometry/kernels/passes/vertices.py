"""Vertices run by run: K, n_p, area and least altitude of each, by its ring where it has one."""

from __future__ import annotations

import numpy as np

from spherify.geometry.kernels.passes.corners import vertex
from spherify.geometry.kernels.passes.jit import inner
from spherify.geometry.kernels.passes.rings import any_flat, is_flat, ring_block
from spherify.geometry.kernels.passes.straight import BLOCK
from spherify.geometry.kernels.passes.types import (
    DUAL_AREA,
    RING,
    Buffers,
    Connectivity,
    Floats,
    Index,
    Mode,
    Scratch,
)
from spherify.geometry.kernels.passes.whole import begin_run, end_run, integrate


@inner
def note_extremes(K: Floats, least: Floats, greatest: Floats, off: Floats, low: Index, count: Index) -> None:
    """Bring the running extremes up to date, one for each place in a block, so that no value waits for another.

    ``off`` stays 0 as long as all K are finite: 0·K is not a number where K is infinite or none itself.
    """
    for j in range(np.uint32(0), count):
        k = K[np.uint32(low + j)]
        least[j] = k if k < least[j] else least[j]
        greatest[j] = k if k > greatest[j] else greatest[j]
        off[j] += 0.0 * k


@inner
def vertex_pass(
    mesh: Connectivity, use: Buffers, scratch: Scratch, mode: Mode, weighed: bool, measured: bool,
    first_run: int, last_run: int,
) -> tuple[float, float, bool]:  # fmt: skip
    """Compute the vertices of the runs ``first_run`` … ``last_run``.

    Areas are written only where they are ``weighed`` or ``measured``, which is: with the sums of the surface.

    Returns:
        the extremes of their K, and whether all are finite.

    """
    x, y, z = use.position[0], use.position[1], use.position[2]
    px, py, pz = use.normal[0], use.normal[1], use.normal[2]
    K, area, altitude = use.curvature, use.area, use.altitude
    rows, angles = scratch.rows, scratch.angles
    least, greatest, off = rows[18], rows[19], rows[20]
    sx, sy, sz, areas, over, under, sum_K = rows[0], rows[1], rows[2], rows[3], rows[4], rows[5], rows[6]
    ex, ey, ez, dx, dy, dz, dd = rows[7], rows[8], rows[9], rows[10], rows[11], rows[12], rows[13]
    nx, ny, nz, size = rows[14], rows[15], rows[16], rows[17]
    volume, lengths = rows[21], rows[22]
    weights, volumes, mx, my, mz, edges = rows[23], rows[24], rows[25], rows[26], rows[27], rows[28]
    smallest, longest = rows[29], rows[30]
    sine, squared, edge = angles[0], angles[1], angles[2]
    ax, ay, az, sizes = angles[3], angles[4], angles[5], angles[6]
    ring = mesh.ring
    full = not measured and (weighed or mode.step_bound > 0 or mode.measure == DUAL_AREA)
    for j in range(least.size):
        least[j], greatest[j], off[j] = np.inf, -np.inf, 0.0
    for r in range(first_run, last_run):
        low, last = mesh.runs[r, 0], mesh.runs[r, 1]
        step = np.uint32(last - low)
        at = mesh.runs[r, 4]
        if measured:
            begin_run(weights, volumes, mx, my, mz, edges)
        while low < last:
            count = min(np.uint32(BLOCK), np.uint32(last - low))
            by_ring = mesh.runs[r, 2] == RING
            if by_ring:
                ring_block(
                    ring, x, y, z, K, px, py, pz, area, altitude,
                    sx, sy, sz, areas, over, under, smallest, longest, volume, lengths, sum_K,
                    ex, ey, ez, dx, dy, dz, dd, nx, ny, nz, size, sine, squared, edge, ax, ay, az, sizes,
                    mode.measure, full, measured, np.uint64(low), np.uint64(count), np.uint64(mesh.runs[r, 3]),
                    np.uint64(at), np.uint64(step),
                )  # fmt: skip
            if not by_ring or any_flat(smallest, longest, count):
                for k in range(np.uint32(0), count):
                    if not by_ring or is_flat(smallest[k], longest[k]):
                        p = np.uint32(low + k)
                        vertex(
                            x, y, z, mesh.corners, mesh.halfedges, mesh.twins,
                            mesh.first[p], mesh.first[np.uint32(p + np.uint32(1))],
                            mode.measure, K, px, py, pz, area, altitude, p,
                        )  # fmt: skip
            note_extremes(K, least, greatest, off, low, count)
            if measured:
                integrate(x, y, z, area, volume, lengths, weights, volumes, mx, my, mz, edges, low, count)
            low = np.uint32(low + count)
            at = np.uint32(at + count)
        if measured:
            end_run(weights, volumes, mx, my, mz, edges, use.sums[r])
    K_min, K_max, finite = np.inf, -np.inf, 0.0
    for j in range(BLOCK):
        K_min = min(K_min, least[j])
        K_max = max(K_max, greatest[j])
        finite += off[j]
    return K_min, K_max, finite == 0
