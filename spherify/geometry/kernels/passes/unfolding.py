"""Unfolding on the sphere, and elementary steps along the radii; see `spherify.geometry.unfolding`."""

from __future__ import annotations

import math

import numpy as np

from spherify.geometry.kernels.passes.jit import entry, inner
from spherify.geometry.kernels.passes.types import Floats, Indices
from spherify.geometry.unfolding import (
    CROWDED,
    FRACTION,
    LEAST_ALTITUDE,
    LEAST_AREA,
    LEAST_LOG_WEIGHT,
    NO_FLIP,
    SMOOTHINGS,
    SPREAD,
)


@entry
def move_radially(
    position: Floats, K: Floats, K_min: float, K_max: float, step: float, outward: bool, centre: Floats
) -> None:
    """I_C or O_C with the direction from the centre for the normal, and without a bound."""
    for p in range(K.size):
        t = min(max((K[p] - K_min) / (K_max - K_min), 0.0), 1.0)
        distance = step * (1.0 - t) if outward else -(step * t)
        x, y, z = position[0, p] - centre[0], position[1, p] - centre[1], position[2, p] - centre[2]
        share = distance / math.sqrt(x * x + y * y + z * z)
        position[0, p] += share * x
        position[1, p] += share * y
        position[2, p] += share * z


@entry
def unfold(
    position: Floats, corners: Indices, starts: Indices, neighbours: Indices, log_weights: Floats,
    centre: Floats, exponent: float, damping: float, rounds: int,
) -> tuple[int, float]:  # fmt: skip
    """Do what `spherify.geometry.unfolding.unfolded` does to ``position`` (3, n) and ``log_weights`` (n,).

    Args:
        position: (3, n), in and out.
        corners: (3, m).
        starts: (n + 1,) where the neighbours of each vertex begin.
        neighbours: of all vertices.
        log_weights: (n,), in and out.
        centre: (3,)
        exponent: e.
        damping: share of the way the weights go.
        rounds: how often directions are drawn.

    Returns:
        the number of inward faces, and the least area over the mean area, of the directions.

    """
    n, m = position.shape[1], corners.shape[1]
    U, drawn = (
        np.empty((n, 4)),
        np.empty((n, 4)),
    )  # a direction and its weight lie together, to be gathered at once
    radius, level, other = np.empty(n), np.zeros(n), np.empty(n)
    for p in range(n):
        x, y, z = position[0, p] - centre[0], position[1, p] - centre[1], position[2, p] - centre[2]
        radius[p] = math.sqrt(x * x + y * y + z * z)
        U[p, 0], U[p, 1], U[p, 2] = x / radius[p], y / radius[p], z / radius[p]
    for f in range(m):
        a, b, c = corners[0, f], corners[1, f], corners[2, f]
        area, _ = triangle(U, a, b, c)
        level[a] += area
        level[b] += area
        level[c] += area
    for p in range(n):
        level[p] = math.log(max(level[p], LEAST_AREA))
    for _ in range(SMOOTHINGS):
        for p in range(n):
            total = 0.0
            for k in range(starts[p], starts[p + 1]):
                total += level[neighbours[k]]
            other[p] = 0.5 * (level[p] + total / (starts[p + 1] - starts[p]))
        level, other = other, level
    greatest = -np.inf
    for p in range(n):
        log_weights[p] += damping * (exponent * level[p] - log_weights[p])
        greatest = max(greatest, log_weights[p])
    for p in range(n):
        log_weights[p] = max(log_weights[p] - greatest, LEAST_LOG_WEIGHT)
        U[p, 3] = drawn[p, 3] = math.exp(log_weights[p])
    for _ in range(rounds):
        draw(U, drawn, starts, neighbours)
        U, drawn = drawn, U
    for p in range(n):
        for k in range(3):
            position[k, p] = centre[k] + radius[p] * U[p, k]
    return outcome(U, corners)


@entry
def spread(position: Floats, corners: Indices, centre: Floats, rounds: int) -> tuple[int, float]:
    """Do what `spherify.geometry.unfolding.spread` does to ``position`` (3, n).

    Returns:
        the number of inward faces, and the least area over the mean area, of the directions.

    """
    n, m = position.shape[1], corners.shape[1]
    U, radius, along, crowded = np.empty((n, 3)), np.empty(n), np.empty((n, 6)), np.empty(n, np.bool_)
    areas = np.empty(m)
    for p in range(n):
        x, y, z = position[0, p] - centre[0], position[1, p] - centre[1], position[2, p] - centre[2]
        radius[p] = math.sqrt(x * x + y * y + z * z)
        U[p, 0], U[p, 1], U[p, 2] = x / radius[p], y / radius[p], z / radius[p]
    for _ in range(rounds):
        along[:] = 0.0
        along[:, 5] = np.inf
        crowded[:] = False
        whole = 0.0
        for f in range(m):
            areas[f], _ = triangle(U, corners[0, f], corners[1, f], corners[2, f])
            whole += areas[f]
        for f in range(m):
            if areas[f] < CROWDED * whole / m:
                for k in range(3):
                    crowded[corners[k, f]] = True
        for f in range(m):
            for k in range(3):
                press(U, along, corners[k, f], corners[(k + 1) % 3, f], corners[(k + 2) % 3, f])
        for p in range(n):
            if crowded[p]:
                yield_to(U, along, p)
    for p in range(n):
        for k in range(3):
            position[k, p] = centre[k] + radius[p] * U[p, k]
    return outcome(U, corners)


@inner
def tangents(x: float, y: float, z: float) -> tuple[float, float, float, float, float, float]:
    """Return two orthonormal tangents of the sphere at a direction."""
    if abs(x) < 0.6:
        ax, ay, az = 0.0, z, -y
    else:
        ax, ay, az = -z, 0.0, x
    length = math.sqrt(ax * ax + ay * ay + az * az)
    ax, ay, az = ax / length, ay / length, az / length
    return ax, ay, az, y * az - z * ay, z * ax - x * az, x * ay - y * ax


@inner
def press(U: Floats, along: Floats, p: int, q: int, r: int) -> None:
    """Add what the triangle p, q, r adds to g, H and the least altitude at p, and to that at q and r."""
    qx, qy, qz = U[q, 0], U[q, 1], U[q, 2]
    dx, dy, dz = U[r, 0] - qx, U[r, 1] - qy, U[r, 2] - qz
    x, y, z = qy * dz - qz * dy, qz * dx - qx * dz, qx * dy - qy * dx
    length = max(math.sqrt(x * x + y * y + z * z), LEAST_AREA)
    altitude = (x * (U[p, 0] - qx) + y * (U[p, 1] - qy) + z * (U[p, 2] - qz)) / length
    altitude = max(altitude, LEAST_ALTITUDE)
    share = 1 / (length * altitude)
    ax, ay, az, bx, by, bz = tangents(U[p, 0], U[p, 1], U[p, 2])
    one, two = share * (x * ax + y * ay + z * az), share * (x * bx + y * by + z * bz)
    along[p, 0] += one
    along[p, 1] += two
    along[p, 2] += one * one
    along[p, 3] += one * two
    along[p, 4] += two * two
    along[p, 5] = min(along[p, 5], altitude)
    along[q, 5] = min(along[q, 5], altitude)
    along[r, 5] = min(along[r, 5], altitude)


@inner
def yield_to(U: Floats, along: Floats, p: int) -> None:
    """Move a direction as g and H say."""
    g, h, a, b, c = along[p, 0], along[p, 1], along[p, 2], along[p, 3], along[p, 4]
    determinant = max(a * c - b * b, LEAST_AREA)
    one, two = (c * g - b * h) / determinant, (a * h - b * g) / determinant
    share = min(SPREAD, NO_FLIP * along[p, 5] / max(math.sqrt(one * one + two * two), LEAST_AREA))
    one, two = share * one, share * two
    ax, ay, az, bx, by, bz = tangents(U[p, 0], U[p, 1], U[p, 2])
    x, y, z = U[p, 0] + one * ax + two * bx, U[p, 1] + one * ay + two * by, U[p, 2] + one * az + two * bz
    length = math.sqrt(x * x + y * y + z * z)
    U[p, 0], U[p, 1], U[p, 2] = x / length, y / length, z / length


@inner
def outcome(U: Floats, corners: Indices) -> tuple[int, float]:
    """Return the number of inward faces, and the least area over the mean area, of directions."""
    inward, least, whole, m = 0, np.inf, 0.0, corners.shape[1]
    for f in range(m):
        area, facing = triangle(U, corners[0, f], corners[1, f], corners[2, f])
        inward += facing <= 0
        least = min(least, area)
        whole += area
    return inward, least * m / whole


@inner
def draw(U: Floats, drawn: Floats, starts: Indices, neighbours: Indices) -> None:
    """Draw each direction to the weighted mean of its neighbours': from U (n, 4) to ``drawn``."""
    for p in range(U.shape[0]):
        x, y, z, total = 0.0, 0.0, 0.0, 0.0
        for k in range(starts[p], starts[p + 1]):
            q = neighbours[k]
            w = U[q, 3]
            x += w * U[q, 0]
            y += w * U[q, 1]
            z += w * U[q, 2]
            total += w
        x, y, z = x / total, y / total, z / total
        along = x * U[p, 0] + y * U[p, 1] + z * U[p, 2]
        x = U[p, 0] + FRACTION * (x - along * U[p, 0])
        y = U[p, 1] + FRACTION * (y - along * U[p, 1])
        z = U[p, 2] + FRACTION * (z - along * U[p, 2])
        length = math.sqrt(x * x + y * y + z * z)
        drawn[p, 0], drawn[p, 1], drawn[p, 2] = x / length, y / length, z / length


@inner
def triangle(U: Floats, a: int, b: int, c: int) -> tuple[float, float]:
    """Return the area of a triangle of directions, and a number that is positive where it looks outward."""
    ux, uy, uz = U[b, 0] - U[a, 0], U[b, 1] - U[a, 1], U[b, 2] - U[a, 2]
    vx, vy, vz = U[c, 0] - U[a, 0], U[c, 1] - U[a, 1], U[c, 2] - U[a, 2]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return 0.5 * math.sqrt(x * x + y * y + z * z), x * U[a, 0] + y * U[a, 1] + z * U[a, 2]
