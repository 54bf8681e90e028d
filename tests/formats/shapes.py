"""Small meshes with known properties, and the way tests read bytes."""

from __future__ import annotations

import numpy as np

from spherify.formats.acceptance import ReadMesh, accept
from spherify.formats.limits import ReadLimits
from spherify.geometry.mesh import Floats, Ints, TriangleMesh

LIMITS = ReadLimits()

CUBE_CORNERS: Floats = np.array([[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)])
CUBE_QUADS = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
CUBE_FACES: Ints = np.array([t for a, b, c, d in CUBE_QUADS for t in ((a, b, c), (a, c, d))])
TETRAHEDRON: tuple[Floats, Ints] = (
    np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]),
    np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]),
)


def cube() -> TriangleMesh:
    """Return the unit cube: 8 vertices, 12 triangles, volume 1, area 6."""
    return TriangleMesh.checked(CUBE_CORNERS, CUBE_FACES)


def tube(around: int, along: int, *, torus: bool) -> tuple[Floats, Ints]:
    """Return a grid of triangles closed in one direction (an open tube), or in both (a torus); normals outward."""
    i, j = np.meshgrid(np.arange(around), np.arange(along), indexing="ij")
    u, v = 2 * np.pi * i / around, 2 * np.pi * j / along
    if torus:
        points = np.stack([(2 + np.cos(u)) * np.cos(v), (2 + np.cos(u)) * np.sin(v), np.sin(u)], axis=-1)
    else:
        points = np.stack([np.cos(u), np.sin(u), j / along], axis=-1)
    last = along if torus else along - 1
    faces = []
    for a in range(around):
        for b in range(last):
            p, q = a * along + b, (a + 1) % around * along + b
            r, s = (a + 1) % around * along + (b + 1) % along, a * along + (b + 1) % along
            faces += [(p, q, r), (p, r, s)]
    oriented = np.array(faces)
    return points.reshape(-1, 3), oriented[:, ::-1] if torus else oriented


def obj_bytes(vertices: object, faces: object) -> bytes:
    """Return OBJ text of any vertices and faces, broken ones too."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(vertices, dtype=float).tolist()]
    lines += ["f " + " ".join(str(corner + 1) for corner in face) for face in np.asarray(faces).tolist()]
    return "\n".join([*lines, ""]).encode()


def accept_obj(vertices: object, faces: object, *allow: str) -> ReadMesh:
    """Take a mesh in as if it were an uploaded OBJ file."""
    return accept(obj_bytes(vertices, faces), "mesh.obj", allow, LIMITS)
