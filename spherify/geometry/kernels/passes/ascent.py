"""Directions climb to the greatest sphericity; see `spherify.geometry.ascent`, whose formulas these are.

A vertex takes what it is moved by from its ring, so that no two threads add to one number: each triangle is computed
at each of its corners.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from spherify.geometry.ascent import BARRIER, KEPT, LEAST_VOLUME, SHARE
from spherify.geometry.kernels.passes.arithmetic import inverse_root
from spherify.geometry.kernels.passes.directions import back_from, direct, minus, point
from spherify.geometry.kernels.passes.jit import entry, inner
from spherify.geometry.kernels.passes.rings import BLOCK as RING_BLOCK
from spherify.geometry.kernels.passes.spans import BLOCK, SEGMENT, Span, Sums, begin_sums, end_sums
from spherify.geometry.kernels.passes.totals import total_of
from spherify.geometry.kernels.passes.types import (
    RING,
    Buffers,
    Connectivity,
    Floats,
    Index,
    Indices,
    Scratch,
)
from spherify.geometry.kernels.passes.vectors import Vector, cross, dot, longer

Flags: TypeAlias = NDArray[np.uint16]

# The passes, in this order; a call names some.
DIRECT = 1
MEASURE = 2
CLIMB = 4
CUT = 8
CHECK = 16
BACK = 32

AREA, VOLUME, TURNS = 0, 1, 2  # sums: of the area, six times the volume; and of the triangles that would turn


@inner
def volume_of(a: Vector, b: Vector, c: Vector) -> float:
    """Return det(a, b, c)."""
    return dot(a, cross(minus(b, a), minus(c, a)))


@inner
def spoke(u: Vector, radius: float) -> Vector:
    """Return r·u."""
    return radius * u[0], radius * u[1], radius * u[2]


@inner
def measure(
    x: Floats, y: Floats, z: Floats, radius: Floats, a: Indices, b: Indices, c: Indices,
    volumes: Floats, areas: Floats, whole: Floats, low: Index, high: Index,
) -> None:  # fmt: skip
    """Write det(u_a, u_b, u_c) of a block of triangles; area and volume of theirs are added up by place in it."""
    for f in range(low, high):
        j = np.uint32(f - low)
        p, q, r = a[f], b[f], c[f]
        u, v, w = point(x, y, z, p), point(x, y, z, q), point(x, y, z, r)
        volumes[f] = volume_of(u, v, w)
        here = spoke(u, radius[p])
        normal = cross(minus(spoke(v, radius[q]), here), minus(spoke(w, radius[r]), here))
        areas[j] += 0.5 * math.sqrt(dot(normal, normal))
        whole[j] += dot(normal, here)


@inner
def pull(
    u: Vector, ru: float, v: Vector, rv: float, w: Vector, rw: float,
    outward: float, flatness: float, barrier: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Return what a triangle brings its corner of direction u: the gradient times the area, and the diagonal."""
    here, one, two = spoke(u, ru), spoke(v, rv), spoke(w, rw)
    normal = cross(minus(one, here), minus(two, here))  # twice the area long
    squared = dot(normal, normal)
    scale = inverse_root(squared)
    gradient = longer(
        (-outward * normal[0], -outward * normal[1], -outward * normal[2]),
        cross(normal, minus(two, one)),
        0.5 * scale,
    )
    across = cross(v, minus(w, v))
    volume = dot(minus(u, v), across)
    share = 1.0 / (volume if volume > LEAST_VOLUME else LEAST_VOLUME)
    pushed = barrier * share
    return (
        ru * gradient[0] - pushed * across[0],
        ru * gradient[1] - pushed * across[1],
        ru * gradient[2] - pushed * across[2],
        squared * scale * flatness * ru * ru + pushed * share * (dot(across, across) - volume * volume),
    )


@inner
def around(
    ring: Indices, x: Floats, y: Floats, z: Floats, radius: Floats,
    gx: Floats, gy: Floats, gz: Floats, diagonal: Floats,
    outward: float, flatness: float, barrier: float,
    begin: bool, low: Index, count: Index, one: Index, two: Index,
) -> None:  # fmt: skip
    """Add what the triangles between two places of the rings of a block bring, to sums or, with ``begin``, to zero."""
    for k in range(np.uint32(0), count):
        p, q, r = np.uint32(low + k), ring[np.uint32(one + k)], ring[np.uint32(two + k)]
        a, b, c, d = pull(
            point(x, y, z, p), radius[p], point(x, y, z, q), radius[q], point(x, y, z, r), radius[r],
            outward, flatness, barrier,
        )  # fmt: skip
        gx[k] = (0.0 if begin else gx[k]) + a
        gy[k] = (0.0 if begin else gy[k]) + b
        gz[k] = (0.0 if begin else gz[k]) + c
        diagonal[k] = (0.0 if begin else diagonal[k]) + d


@inner
def by_corners(
    mesh: Connectivity, x: Floats, y: Floats, z: Floats, radius: Floats,
    gx: Floats, gy: Floats, gz: Floats, diagonal: Floats,
    outward: float, flatness: float, barrier: float, low: Index, count: Index,
) -> None:  # fmt: skip
    """Do the same face by face, for vertices where several fans meet."""
    three = np.uint32(3)
    for k in range(np.uint32(0), count):
        p = np.uint32(low + k)
        gx[k], gy[k], gz[k], diagonal[k] = 0.0, 0.0, 0.0, 0.0
        for i in range(mesh.first[p], mesh.first[np.uint32(p + np.uint32(1))]):
            h = mesh.halfedges[i]
            f, at = h // three, h % three
            q = mesh.corners[(at + np.uint32(1)) % three, f]
            r = mesh.corners[(at + np.uint32(2)) % three, f]
            a, b, c, d = pull(
                point(x, y, z, p), radius[p], point(x, y, z, q), radius[q], point(x, y, z, r), radius[r],
                outward, flatness, barrier,
            )  # fmt: skip
            gx[k] += a
            gy[k] += b
            gz[k] += c
            diagonal[k] += d


@inner
def plan(
    x: Floats, y: Floats, z: Floats, gx: Floats, gy: Floats, gz: Floats, diagonal: Floats,
    bx: Floats, by: Floats, bz: Floats, mx: Floats, my: Floats, mz: Floats, share: Floats,
    momentum: float, low: Index, count: Index,
) -> None:  # fmt: skip
    """Write the tangential moves of a block, momentum and step, and that all of each is allowed."""
    for k in range(np.uint32(0), count):
        p = np.uint32(low + k)
        u = point(x, y, z, p)
        step = -SHARE / diagonal[k]
        move = (
            momentum * (u[0] - bx[p]) + step * gx[k],
            momentum * (u[1] - by[p]) + step * gy[k],
            momentum * (u[2] - bz[p]) + step * gz[k],
        )
        along = dot(move, u)
        mx[p], my[p], mz[p] = move[0] - along * u[0], move[1] - along * u[1], move[2] - along * u[2]
        share[p] = 1.0


@inner
def go(
    x: Floats, y: Floats, z: Floats, mx: Floats, my: Floats, mz: Floats, share: Floats,
    tx: Floats, ty: Floats, tz: Floats, turns: Flags, low: Index, high: Index,
) -> None:  # fmt: skip
    """Write where directions are led to; no corner is of a face that would turn, as yet."""
    for p in range(low, high):
        by = share[p]
        u = (x[p] + by * mx[p], y[p] + by * my[p], z[p] + by * mz[p])
        over = 1.0 / math.sqrt(dot(u, u))
        tx[p], ty[p], tz[p] = over * u[0], over * u[1], over * u[2]
        turns[p] = 0


@inner
def cut(share: Floats, turns: Flags, by: float, low: Index, high: Index) -> None:
    """Allow that share only of the moves of corners of faces that would turn."""
    for p in range(low, high):
        share[p] *= by if turns[p] != 0 else 1.0


@inner
def find(
    x: Floats, y: Floats, z: Floats, a: Indices, b: Indices, c: Indices, volumes: Floats, turns: Floats,
    low: Index, high: Index,
) -> None:  # fmt: skip
    """Count the triangles of a block that would turn, by place in it."""
    for f in range(low, high):
        volume = volume_of(point(x, y, z, a[f]), point(x, y, z, b[f]), point(x, y, z, c[f]))
        turns[np.uint32(f - low)] += 1.0 if volume < KEPT * volumes[f] else 0.0


@inner
def mark(
    x: Floats, y: Floats, z: Floats, a: Indices, b: Indices, c: Indices, volumes: Floats, turns: Flags,
    low: Index, high: Index,
) -> None:  # fmt: skip
    """Mark their corners; whichever thread does, writes the same."""
    for f in range(low, high):
        volume = volume_of(point(x, y, z, a[f]), point(x, y, z, b[f]), point(x, y, z, c[f]))
        if volume < KEPT * volumes[f]:
            turns[a[f]] = turns[b[f]] = turns[c[f]] = 1


@inner
def check(
    x: Floats, y: Floats, z: Floats, corners: Indices, volumes: Floats, turns: Flags, sums: Sums, span: Span
) -> None:
    """Sum up the triangles that would turn, and mark their corners."""
    a, b, c, lanes = corners[0], corners[1], corners[2], sums.lanes
    for s in range(span.first_segment, span.last_segment):
        begin_sums(lanes, 0.0, 0.0, 0.0)
        start, end = np.uint32(s * SEGMENT), min(np.uint32((s + 1) * SEGMENT), np.uint32(a.size))
        low = start
        while low < end:
            high = min(np.uint32(low + np.uint32(BLOCK)), end)
            find(x, y, z, a, b, c, volumes, lanes[TURNS], low, high)
            low = high
        sums.whole[s, TURNS] = total_of(lanes[TURNS, :BLOCK])
        if sums.whole[s, TURNS] > 0:
            mark(x, y, z, a, b, c, volumes, turns, start, end)


@inner
def climb(
    mesh: Connectivity, use: Buffers, scratch: Scratch, momentum: float,
    outward: float, flatness: float, barrier: float, span: Span,
) -> None:  # fmt: skip
    """Write the moves of the vertices of some runs."""
    x, y, z, radius = use.position[0], use.position[1], use.position[2], use.curvature
    tx, ty, tz = use.moved[0], use.moved[1], use.moved[2]
    mx, my, mz = use.normal[0], use.normal[1], use.normal[2]
    gx, gy, gz, diagonal = scratch.rows[0], scratch.rows[1], scratch.rows[2], scratch.rows[3]
    for run in range(span.first_run, span.last_run):
        low, last, degree, at = mesh.runs[run, 0], mesh.runs[run, 1], mesh.runs[run, 3], mesh.runs[run, 4]
        step = np.uint32(last - low)
        while low < last:
            count = min(np.uint32(RING_BLOCK), np.uint32(last - low))
            if mesh.runs[run, 2] == RING:
                before = np.uint32(at + (degree - np.uint32(1)) * step)
                for j in range(np.uint32(0), degree):
                    here = np.uint32(at + j * step)
                    around(
                        mesh.ring, x, y, z, radius, gx, gy, gz, diagonal, outward, flatness, barrier,
                        j == np.uint32(0), low, count, before, here,
                    )  # fmt: skip
                    before = here
            else:
                by_corners(
                    mesh, x, y, z, radius, gx, gy, gz, diagonal, outward, flatness, barrier, low, count
                )
            plan(
                x, y, z, gx, gy, gz, diagonal, tx, ty, tz, mx, my, mz, use.altitude, momentum, low, count
            )  # fmt: skip
            low = np.uint32(low + count)
            at = np.uint32(at + count)


@entry
def ascend(
    mesh: Connectivity, use: Buffers, scratch: Scratch, volumes: Floats, sums: Sums,
    centre: Vector, momentum: float, less: float, passes: int, span: Span,
) -> None:  # fmt: skip
    """Do one thread's part of what `spherify.geometry.ascent.ascended` does to ``use.position``.

    Args:
        mesh: who touches whom.
        use: ``moved`` has the positions an iteration before; then the directions before, and after it; ``normal`` the
            moves, ``altitude`` what share of each is allowed, ``curvature`` the radii, ``bins`` at whose move is cut.
        scratch: of the thread.
        volumes: (m,) of the triangles of directions and the centre, times six.
        sums: the area and so on, which all threads want.
        centre: c.
        momentum: b.
        less: share that CUT leaves of a move.
        passes: DIRECT + …; up to CHECK without CUT, CUT and CHECK, or BACK for one thread, one at a time for several.
        span: of the thread.

    """
    x, y, z, radius = use.position[0], use.position[1], use.position[2], use.curvature
    tx, ty, tz = use.moved[0], use.moved[1], use.moved[2]
    mx, my, mz = use.normal[0], use.normal[1], use.normal[2]
    a, b, c, lanes = mesh.corners[0], mesh.corners[1], mesh.corners[2], sums.lanes
    if passes & DIRECT:
        direct(tx, ty, tz, radius, centre, span.first, span.last)
        direct(x, y, z, radius, centre, span.first, span.last)
    if passes & MEASURE:
        for s in range(span.first_segment, span.last_segment):
            begin_sums(lanes, 0.0, 0.0, 0.0)
            low, end = np.uint32(s * SEGMENT), min(np.uint32((s + 1) * SEGMENT), np.uint32(a.size))
            while low < end:
                high = min(np.uint32(low + np.uint32(BLOCK)), end)
                measure(x, y, z, radius, a, b, c, volumes, lanes[AREA], lanes[VOLUME], low, high)
                low = high
            end_sums(lanes, sums.whole[s])
    if passes & CLIMB:
        area, volume, m = total_of(sums.whole[:, AREA]), total_of(sums.whole[:, VOLUME]) / 6, a.size
        climb(
            mesh, use, scratch, momentum,
            # of the normals, which are twice as long as the areas
            area / volume / 9, 2 * math.pi / 3 / area, BARRIER * 4 * math.pi / m * area / m, span,
        )  # fmt: skip
    if passes & CUT:
        cut(use.altitude, use.bins, less, span.first, span.last)
    if passes & (CLIMB + CUT):
        go(x, y, z, mx, my, mz, use.altitude, tx, ty, tz, use.bins, span.first, span.last)
    if passes & CHECK:
        check(tx, ty, tz, mesh.corners, volumes, use.bins, sums, span)
    if passes & BACK:
        back_from(tx, ty, tz, x, y, z, radius, centre, span.first, span.last)
