"""The passes in their order: an elementary step, and T."""

from __future__ import annotations

import numpy as np

from spherify.geometry.kernels.passes.jit import entry, inner
from spherify.geometry.kernels.passes.movement import move, move_to
from spherify.geometry.kernels.passes.relaxation import greatest_of, relax, weigh
from spherify.geometry.kernels.passes.selection import percentiles
from spherify.geometry.kernels.passes.types import (
    CONSTANT,
    MOVED,
    NOT_FINITE,
    Buffers,
    Connectivity,
    Index,
    Mode,
    Scratch,
)
from spherify.geometry.kernels.passes.vertices import vertex_pass
from spherify.geometry.transformation import EQUAL_CURVATURE


@inner
def extremes(use: Buffers, mode: Mode, lowest: float, highest: float) -> tuple[float, float]:
    """Return K_min and K_max of the window; the same twice if the curvature is constant."""
    least_width = EQUAL_CURVATURE * max(abs(lowest), abs(highest))
    if highest - lowest <= least_width:
        return lowest, lowest
    K_min, K_max = percentiles(use.curvature, lowest, highest, mode.window, use)
    if K_max - K_min <= least_width:
        return lowest, highest
    return K_min, K_max


@inner
def move_some(
    use: Buffers, mode: Mode, K_min: float, K_max: float, step: float, outward: bool, in_place: bool,
    low: Index, high: Index,
) -> None:  # fmt: skip
    """Move some vertices along their normals, or write to ``use.moved`` where they would go."""
    x, y, z = use.position[0], use.position[1], use.position[2]
    px, py, pz = use.normal[0], use.normal[1], use.normal[2]
    K, altitude, bound = use.curvature, use.altitude, mode.step_bound
    if in_place:
        move(x, y, z, K, px, py, pz, altitude, K_min, K_max, step, outward, bound, low, high)
    else:
        mx, my, mz = use.moved[0], use.moved[1], use.moved[2]
        move_to(x, y, z, K, px, py, pz, altitude, mx, my, mz, K_min, K_max, step, outward, bound, low, high)


@inner
def hold(mesh: Connectivity, use: Buffers, back: bool) -> None:
    """Note where the held vertices are, or put them back there."""
    for i in range(mesh.held.size):
        for k in range(3):
            if back:
                use.position[k, mesh.held[i]] = use.held_position[k, i]
            else:
                use.held_position[k, i] = use.position[k, mesh.held[i]]


@entry
def transform(
    mesh: Connectivity, use: Buffers, scratch: Scratch, mode: Mode, k_in: int, k_out: int,
    step: float, relaxation: float,
) -> int:  # fmt: skip
    """Apply T to ``use.position``: k_in inward, then k_out outward elementary steps, on one thread.

    Returns:
        MOVED; or CONSTANT or NOT_FINITE, if the curvature became so, and the positions mean nothing.

    """
    zero, n, runs = np.uint32(0), np.uint32(use.curvature.size), mesh.runs.shape[0]
    for i in range(k_in + k_out):
        lowest, highest, finite = vertex_pass(mesh, use, scratch, mode, 0, runs)
        if not finite:
            return NOT_FINITE
        K_min, K_max = extremes(use, mode, lowest, highest)
        if not K_min < K_max:
            return CONSTANT
        hold(mesh, use, False)
        move_some(use, mode, K_min, K_max, step, i >= k_in, relaxation <= 0, zero, n)
        if relaxation > 0:
            weigh(use.area, mode.relaxation_exponent, greatest_of(use.area, zero, n), zero, n)
            relax(mesh, use, scratch, relaxation, 0, runs)
        hold(mesh, use, True)
    return MOVED
