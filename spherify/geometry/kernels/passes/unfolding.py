"""Unfolding on the sphere, and elementary steps along the radii; see `spherify.geometry.unfolding`."""

from __future__ import annotations

import math

import numpy as np

from spherify.geometry.kernels.passes.jit import entry, inner
from spherify.geometry.kernels.passes.types import Floats, Indices
from spherify.geometry.unfolding import FRACTION, LEAST_AREA, LEAST_LOG_WEIGHT, SMOOTHINGS


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
    inward, least, whole = 0, np.inf, 0.0
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
