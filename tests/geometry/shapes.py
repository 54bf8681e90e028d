"""Small meshes the tests of the geometry share, and the tolerances they hold numbers to."""

from __future__ import annotations

from functools import cache

import numpy as np

from spherify.geometry.measures import norm
from spherify.geometry.mesh import TriangleMesh
from spherify.geometry.samples import SAMPLES
from spherify.geometry.samples.solids import icosphere
from tests.shared import shared_mesh

ROUNDING = 1e-12  # relative, of one evaluation against another with a different order of sums
FEW_STEPS = 1e-9  # relative, after some steps: each multiplies the rounding of the one before


@cache
def sample(name: str, resolution: int) -> TriangleMesh:
    """A sample, built once for all tests."""
    return SAMPLES[name].build(resolution)


def tetrahedron() -> TriangleMesh:
    V = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
    return TriangleMesh.checked(V, [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])


def octahedron() -> TriangleMesh:
    V = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]
    F = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]
    return TriangleMesh.checked(V, F)


def icosahedron() -> TriangleMesh:
    return icosphere(1)


def jittered(mesh: TriangleMesh, amount: float, seed: int = 0) -> TriangleMesh:
    """Move every vertex at random by up to ``amount`` of the mean distance from the origin."""
    rng = np.random.default_rng(seed)
    size = float(norm(mesh.vertices).mean())
    return mesh.with_vertices(mesh.vertices + amount * size * rng.uniform(-1, 1, mesh.vertices.shape))


def uneven_sphere(frequency: int, seed: int = 0) -> TriangleMesh:
    """A round sphere of uneven triangles."""
    mesh = jittered(icosphere(frequency), 0.25 / frequency, seed)
    return mesh.with_vertices(mesh.vertices / norm(mesh.vertices)[:, None])


def finned(frequency: int, seed: int) -> TriangleMesh:
    """A sphere of which a cap is pressed to a fin of no thickness, turned so that its plane is no coordinate plane."""
    mesh = uneven_sphere(frequency)
    V = mesh.vertices.copy()
    V[V[:, 1] > 0.4, 0] = 0.0
    turn, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return mesh.with_vertices(V @ (turn * np.sign(np.linalg.det(turn))))


def drum(around: int, rings: int) -> TriangleMesh:
    """A flat one: a wall of ``rings`` rows, and two lids that are fans of ``around`` triangles."""
    angles = 2 * np.pi * np.arange(around) / around
    heights = np.linspace(-0.3, 0.3, rings + 1)
    wall = np.concatenate(
        [np.stack([np.cos(angles), np.sin(angles), np.full(around, z)], axis=1) for z in heights]
    )
    V = np.vstack([wall, [[0, 0, -0.3], [0, 0, 0.3]]])
    here, there = np.arange(around), (np.arange(around) + 1) % around
    bottom, top, last = len(wall), len(wall) + 1, rings * around
    faces = [np.stack([there, here, np.full(around, bottom)], axis=1)]
    for row in range(0, last, around):
        faces.append(np.stack([row + here, row + there, row + around + there], axis=1))
        faces.append(np.stack([row + here, row + around + there, row + around + here], axis=1))
    faces.append(np.stack([last + here, last + there, np.full(around, top)], axis=1))
    return TriangleMesh.checked(V, np.concatenate(faces))


def pinched() -> TriangleMesh:
    """Two icosahedra that share one vertex: closed, every edge with two faces, one pinch vertex."""
    one = icosahedron()
    top = int(np.argmax(one.vertices[:, 2]))
    other = one.vertices * np.array([1, 1, 1.0]) + 2 * one.vertices[top]
    bottom = int(np.argmin(norm(other - one.vertices[top])))
    renumber = np.arange(12) + 12 - (np.arange(12) > bottom)
    renumber[bottom] = top
    faces = np.concatenate([one.faces, renumber[one.faces]])
    return TriangleMesh.checked(np.concatenate([one.vertices, np.delete(other, bottom, axis=0)]), faces)


def torus(major: int = 24, minor: int = 12) -> TriangleMesh:
    u, v = np.meshgrid(np.arange(major), np.arange(minor), indexing="ij")
    a, b = 2 * np.pi * u / major, 2 * np.pi * v / minor
    radius = 2 + 0.7 * np.cos(b)
    V = np.stack([radius * np.cos(a), radius * np.sin(a), 0.7 * np.sin(b)], axis=-1).reshape(-1, 3)
    at = lambda i, j: ((u + i) % major * minor + (v + j) % minor).reshape(-1)  # noqa: E731 # as short as an index
    p, q, r, s = at(0, 0), at(1, 0), at(1, 1), at(0, 1)
    return TriangleMesh.checked(V, np.concatenate([np.stack([p, q, r], 1), np.stack([p, r, s], 1)]))


def open_bump(side: int = 7) -> TriangleMesh:
    """A square sheet with a bump: one boundary loop."""
    x, y = np.meshgrid(np.linspace(-1, 1, side), np.linspace(-1, 1, side), indexing="ij")
    V = np.stack([x, y, 0.6 * np.exp(-3 * (x**2 + y**2))], axis=-1).reshape(-1, 3)
    at = np.arange(side * side).reshape(side, side)
    p, q, r, s = (corner.reshape(-1) for corner in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    return TriangleMesh.checked(V, np.concatenate([np.stack([p, q, r], 1), np.stack([p, r, s], 1)]))


def prism(sides: int = 6, height: float = 2.0) -> TriangleMesh:
    """A regular prism of circumradius 1 whose ends are fans around a centre."""
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    low = np.column_stack([ring, np.full(sides, -height / 2)])
    high = np.column_stack([ring, np.full(sides, height / 2)])
    V = np.concatenate([low, high, [[0, 0, -height / 2], [0, 0, height / 2]]])
    i, j = np.arange(sides), np.roll(np.arange(sides), -1)
    bottom, top = np.full(sides, 2 * sides), np.full(sides, 2 * sides + 1)
    F = [[i, j, j + sides], [i, j + sides, i + sides], [j, i, bottom], [i + sides, j + sides, top]]
    return TriangleMesh.checked(V, np.concatenate([np.stack(column, axis=1) for column in F]))


def small_samples() -> dict[str, TriangleMesh]:
    """Meshes small enough for loops in plain Python: convex, not convex, thin, flat, pinched, open."""
    return {
        "octahedron, uneven": jittered(octahedron(), 0.2),
        "sphere, uneven": uneven_sphere(2),
        "stone": sample("stone", 60),
        "non-convex sphere": sample("non-convex-sphere", 42),
        "cube": sample("cube", 56),
        "prism": prism(),
        "torus": torus(9, 6),
        "pinched": jittered(pinched(), 0.1),
        "open": open_bump(6),
    }


def read_obj(name: str) -> TriangleMesh:
    """Positions and triangles of a shared OBJ file, by the file's own connectivity; skips where it is absent."""
    vertices, faces = [], []
    for line in shared_mesh(name).read_text().splitlines():
        words = line.split()
        if words and words[0] == "v":
            vertices.append([float(word) for word in words[1:4]])
        elif words and words[0] == "f":
            corners = [int(word.split("/")[0]) - 1 for word in words[1:]]
            faces += [[corners[0], *corners[k : k + 2]] for k in range(1, len(corners) - 1)]
    return TriangleMesh.checked(vertices, faces)


def as_lists(mesh: TriangleMesh):
    """The mesh as the plain loops of `tests.naive` take it."""
    return [tuple(map(float, p)) for p in mesh.vertices], [tuple(map(int, f)) for f in mesh.faces]
