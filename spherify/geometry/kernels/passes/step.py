"""The passes in their order: an elementary step, and T."""

from __future__ import annotations

from spherify.geometry.kernels.passes.edges import edge_pass
from spherify.geometry.kernels.passes.faces import face_pass
from spherify.geometry.kernels.passes.jit import entry, inner
from spherify.geometry.kernels.passes.movement import move
from spherify.geometry.kernels.passes.relaxation import relax, weigh, weigh_alike
from spherify.geometry.kernels.passes.selection import percentile
from spherify.geometry.kernels.passes.types import (
    CONSTANT,
    DUAL_AREA,
    MOVED,
    NOT_FINITE,
    Buffers,
    Connectivity,
    Floats,
    Indices,
    Mode,
)
from spherify.geometry.kernels.passes.vertices import vertex_pass
from spherify.geometry.transformation import EQUAL_CURVATURE


@inner
def held(position: Floats, vertices: Indices, at: Floats, back: bool) -> None:
    """Note where the held vertices are, or put them back there."""
    for k in range(3):
        for i in range(vertices.size):
            if back:
                position[k, vertices[i]] = at[k, i]
            else:
                at[k, i] = position[k, vertices[i]]


@entry
def transform(
    mesh: Connectivity, use: Buffers, mode: Mode, k_in: int, k_out: int, step: float, relaxation: float
) -> int:
    """Apply T to ``use.position``: k_in inward, then k_out outward elementary steps.

    Returns:
        MOVED; or CONSTANT or NOT_FINITE, if the curvature became so, and the positions mean nothing.

    """
    a, b, c = mesh.corners[0], mesh.corners[1], mesh.corners[2]
    tail, head = mesh.ends[0], mesh.ends[1]
    left, right = mesh.sides[0], mesh.sides[1]
    x, y, z = use.position[0], use.position[1], use.position[2]
    nx, ny, nz = use.face_normal[0], use.face_normal[1], use.face_normal[2]
    px, py, pz = use.normal[0], use.normal[1], use.normal[2]
    wx, wy, wz = use.weighted[0], use.weighted[1], use.weighted[2]
    s, t, u, v = use.scratch[0], use.scratch[1], use.scratch[2], use.scratch[3]
    K, weight = use.curvature, use.area
    bounded = mode.step_bound > 0
    weighted = relaxation > 0 and mode.relaxation_exponent != 0
    areas = mode.measure == DUAL_AREA or weighted
    for i in range(k_in + k_out):
        face_pass(x, y, z, a, b, c, nx, ny, nz, use.face_area, use.face_altitude, bounded)
        edge_pass(
            x, y, z, tail, head, left, right, nx, ny, nz, use.face_area,
            s, t, u, v, use.edge_value, mode.measure,
        )  # fmt: skip
        lowest, highest, finite = vertex_pass(
            mesh.runs, mesh.edges_at, mesh.faces_at,
            use.edge_value, nx, ny, nz, use.face_area, use.face_altitude,
            K, px, py, pz, use.area, use.altitude,
            use.lanes[0], use.lanes[1], use.lanes[2], mode.measure, areas, bounded,
        )  # fmt: skip
        if not finite:
            return NOT_FINITE
        least_width = EQUAL_CURVATURE * max(abs(lowest), abs(highest))
        if highest - lowest <= least_width:
            return CONSTANT
        one, other = use.chosen[0], use.chosen[1]
        K_min = percentile(K, lowest, highest, mode.window[0], one, other, use.counts)
        K_max = percentile(K, lowest, highest, mode.window[1], one, other, use.counts)
        if K_max - K_min <= least_width:
            K_min, K_max = lowest, highest
        held(use.position, mesh.held, use.held_position, False)
        move(x, y, z, K, px, py, pz, use.altitude, K_min, K_max, step, i >= k_in, mode.step_bound)
        if relaxation > 0:
            if weighted:
                weigh(weight, mode.relaxation_exponent, x, y, z, wx, wy, wz)
            else:
                weigh_alike(weight, x, y, z, wx, wy, wz)
            relax(mesh.runs, mesh.ring, weight, wx, wy, wz, x, y, z, px, py, pz, s, t, u, v, relaxation)
        held(use.position, mesh.held, use.held_position, True)
    return MOVED
