"""Solids whose triangles can be written down: spheres, stars about a point, the cube, the cylinder."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from spherify.geometry.measures import cross, dot, norm
from spherify.geometry.mesh import Floats, Ints, TriangleMesh

_GOLDEN: Final = (1 + math.sqrt(5)) / 2
_ICOSAHEDRON: Final = np.array(
    [
        *([0, s, t] for s in (-1, 1) for t in (-_GOLDEN, _GOLDEN)),
        *([s, t, 0] for s in (-1, 1) for t in (-_GOLDEN, _GOLDEN)),
        *([t, 0, s] for s in (-1, 1) for t in (-_GOLDEN, _GOLDEN)),
    ]
)


def icosphere(frequency: int) -> TriangleMesh:
    """Return the unit sphere with 10·frequency² + 2 vertices: an icosahedron, its edges cut into ``frequency`` parts.

    Powers of two give the nested spheres of repeated midpoint subdivision, up to where the vertices sit on an edge.
    """
    corners = _ICOSAHEDRON / norm(_ICOSAHEDRON)[:, None]
    edge = norm(corners[1:] - corners[0]).min()
    triples = [
        (a, b, c)
        for a in range(12)
        for b in range(a + 1, 12)
        for c in range(b + 1, 12)
        if max(_distance(corners, a, b), _distance(corners, b, c), _distance(corners, c, a)) < 1.01 * edge
    ]
    patches = [_outward(corners[list(triple)]) for triple in triples]
    mesh = _joined([_triangle_patch(patch, frequency) for patch in patches], 1e-6 * edge / frequency)
    return TriangleMesh.checked(mesh.vertices / norm(mesh.vertices)[:, None], mesh.faces)


def non_convex_sphere(resolution: int) -> TriangleMesh:
    """Return a sphere with eight bumps and dents between them, about ``resolution`` vertices."""
    directions = icosphere(_frequency(resolution)).vertices
    x, y, z = directions.T
    radius = 1 + 0.5 * (math.sqrt(27) * x * y * z) + 0.1 * np.cos(6 * z)
    return _star(resolution, radius)


def stone(resolution: int) -> TriangleMesh:
    """Return an oblong weathered stone with about ``resolution`` vertices."""
    directions = icosphere(_frequency(resolution)).vertices
    rng = np.random.default_rng(4769)
    radius = np.ones(len(directions))
    for octave in range(1, 6):
        for _ in range(6):
            wave = rng.standard_normal(3) * 1.3 * octave
            radius += 0.045 / octave * np.sin(directions @ wave + rng.uniform(0, 2 * math.pi))
    # Flat facets, as if broken off: nothing reaches beyond these planes.
    for _ in range(9):
        facing = rng.standard_normal(3)
        cosine = directions @ (facing / math.sqrt(float(facing @ facing)))
        cut = rng.uniform(0.8, 0.95) / np.maximum(cosine, 0.2)
        radius = -np.logaddexp(-25 * radius, -25 * cut) / 25
    mesh = _star(resolution, radius)
    return TriangleMesh.checked(mesh.vertices * np.array([1.4, 1.0, 0.8]), mesh.faces)


def cube(resolution: int) -> TriangleMesh:
    """Return the cube [-1, 1]³ with about ``resolution`` vertices, at least 26."""
    k = max(2, round(math.sqrt(max(resolution - 2, 1) / 6)))
    patches = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            patches.append(_square_patch(axis, side, k))
    return _joined(patches, 1e-3 / k)


def cylinder(resolution: int) -> TriangleMesh:
    """Return a cylinder of radius 1 and height 4 with flat ends and about ``resolution`` vertices, at least 50."""
    # 6k vertices around; the caps have 2(3k² + 3k + 1) - 12k of their own, the side 6k to each of its layers.
    k = 2
    while abs(_cylinder_size(k + 1) - resolution) < abs(_cylinder_size(k) - resolution):
        k += 1
    around, layers = 6 * k, _cylinder_layers(k)
    vertices, faces = [], []
    for layer in range(layers + 1):
        angles = 2 * math.pi * (np.arange(around) + 0.5 * (layer % 2)) / around
        heights = np.full(around, 4 * layer / layers - 2)
        vertices.append(np.stack([np.cos(angles), np.sin(angles), heights], axis=1))
    for layer in range(layers):
        low, high = layer * around + np.arange(around), (layer + 1) * around + np.arange(around)
        next_low, next_high = np.roll(low, -1), np.roll(high, -1)
        if layer % 2 == 0:  # the layer above is half a step ahead
            faces += [np.stack([low, next_low, high], axis=1), np.stack([next_low, next_high, high], axis=1)]
        else:
            faces += [np.stack([low, next_low, next_high], axis=1), np.stack([low, next_high, high], axis=1)]
    side = np.concatenate(vertices), np.concatenate(faces)
    top_turn = math.pi / around * (layers % 2)
    return _joined([side, _disc(k, -2.0, 0.0), _disc(k, 2.0, top_turn)], 1e-3 / k)


def _cylinder_layers(k: int) -> int:
    """Layers that make the triangles of the side nearly equilateral."""
    edge = 2 * math.sin(math.pi / (6 * k))
    return max(1, round(4 / (edge * math.sqrt(3) / 2)))


def _cylinder_size(k: int) -> int:
    return 6 * k * (_cylinder_layers(k) + 1) + 2 * (3 * k * (k - 1) + 1)


def _frequency(resolution: int) -> int:
    return max(2, round(math.sqrt(max(resolution - 2, 1) / 10)))


def _star(resolution: int, radius: Floats) -> TriangleMesh:
    sphere = icosphere(_frequency(resolution))
    return TriangleMesh.checked(sphere.vertices * radius[:, None], sphere.faces)


def _distance(points: Floats, a: int, b: int) -> float:
    return math.dist(points[a], points[b])


def _outward(triangle: Floats) -> Floats:
    """Order three points counter-clockwise seen from outside of the origin."""
    a, b, c = triangle
    return triangle if float(np.linalg.det(np.stack([a, b, c]))) > 0 else triangle[[0, 2, 1]]


def _triangle_patch(corners: Floats, k: int) -> tuple[Floats, Ints]:
    """Cut a spherical triangle into k² triangles, its edges evenly and all three corners alike.

    Interpolating along great circles favours the corner it starts from; the mean over the three does not.
    """
    rows, columns = np.tril_indices(k + 1)
    shares = np.stack([k - rows, rows - columns, columns], axis=1)
    points = np.zeros((len(rows), 3))
    for turn in range(3):
        (a, b, c), (_, v, w) = np.roll(corners, -turn, axis=0), np.roll(shares, -turn, axis=1).T
        along = (v + w) / k
        points += _slerp(_slerp(a, b, along), _slerp(a, c, along), w / np.maximum(v + w, 1))
    at = np.zeros((k + 2, k + 2), dtype=np.int64)
    at[rows, columns] = np.arange(len(rows))
    i, j = np.tril_indices(k)
    up = np.stack([at[i, j], at[i + 1, j], at[i + 1, j + 1]], axis=1)
    down = np.stack([at[i, j], at[i + 1, j + 1], at[i, j + 1]], axis=1)[j < i]
    return points / norm(points)[:, None], np.concatenate([up, down])


def _slerp(a: Floats, b: Floats, t: Floats) -> Floats:
    """(k, 3) points at the fractions t (k,) of the great circles from unit vectors a to b, (3,) or (k, 3)."""
    a, b, fraction = np.atleast_2d(a), np.atleast_2d(b), t[:, None]
    angle = np.arctan2(norm(cross(a, b)), dot(a, b))[:, None]
    between = np.sin((1 - fraction) * angle) * a + np.sin(fraction * angle) * b
    return np.asarray(np.where(angle > 0, between / np.where(angle > 0, np.sin(angle), 1), a))


def _square_patch(axis: int, side: float, k: int) -> tuple[Floats, Ints]:
    """Tile one face of the cube, k × k squares, each cut along the diagonal that alternates like a chessboard."""
    u, v = np.meshgrid(np.linspace(-1, 1, k + 1), np.linspace(-1, 1, k + 1), indexing="ij")
    points = np.empty(((k + 1) ** 2, 3))
    points[:, axis] = side
    points[:, (axis + 1) % 3] = u.reshape(-1)
    points[:, (axis + 2) % 3] = v.reshape(-1)
    at = np.arange((k + 1) ** 2).reshape(k + 1, k + 1)
    p, q, r, s = (corner.reshape(-1) for corner in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    even = ((np.arange(k)[:, None] + np.arange(k)[None, :]) % 2 == 0).reshape(-1)
    one = np.where(even[:, None], np.stack([p, q, r], axis=1), np.stack([p, q, s], axis=1))
    two = np.where(even[:, None], np.stack([p, r, s], axis=1), np.stack([q, r, s], axis=1))
    faces = np.concatenate([one, two])
    return points, faces if side > 0 else faces[:, ::-1]


def _disc(k: int, height: float, turn: float) -> tuple[Floats, Ints]:
    """Tile a flat disc of k rings around a centre, 6j vertices on ring j, facing away from height 0."""
    points: list[tuple[float, float, float]] = [(0.0, 0.0, height)]
    start = [0]
    for j in range(1, k + 1):
        start.append(len(points))
        for i in range(6 * j):
            angle = 2 * math.pi * i / (6 * j) + turn
            points.append((j / k * math.cos(angle), j / k * math.sin(angle), height))
    faces = []
    for j in range(1, k + 1):
        for sector in range(6):
            outer = [start[j] + (sector * j + i) % (6 * j) for i in range(j + 1)]
            inner = [start[j - 1] + (sector * (j - 1) + i) % max(6 * (j - 1), 1) for i in range(j)]
            faces += [[inner[i], outer[i], outer[i + 1]] for i in range(j)]
            faces += [[inner[i], outer[i + 1], inner[i + 1]] for i in range(j - 1)]
    cells = np.array(faces)
    return np.array(points), cells if height > 0 else cells[:, ::-1]


def _joined(patches: list[tuple[Floats, Ints]], tolerance: float) -> TriangleMesh:
    """Join patches whose border points agree to within ``tolerance``, which is far less than any edge."""
    points = np.concatenate([patch[0] for patch in patches])
    shifts = np.cumsum([0, *(len(patch[0]) for patch in patches[:-1])])
    faces = np.concatenate([patch[1] + shift for patch, shift in zip(patches, shifts, strict=True)])
    # Rounded with an offset that no coordinate of these shapes sits on, so that equal points round alike.
    keys = np.floor(points / tolerance + 0.381966)
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return TriangleMesh.checked(points[first], inverse.reshape(-1)[faces])


__all__ = ["cube", "cylinder", "icosphere", "non_convex_sphere", "stone"]
