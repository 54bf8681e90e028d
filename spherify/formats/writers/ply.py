"""PLY: binary little endian, or ASCII.

Ours: trimesh rounds positions to float32, and the default here is float64.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from spherify.formats.writers.text import number, positions, rows
from spherify.geometry.mesh import TriangleMesh

_FACE = np.dtype([("count", "u1"), ("corners", "<i4", 3)])


def _header(mesh: TriangleMesh, encoding: str, precision: Literal["double", "float"]) -> bytes:
    axes = "".join(f"property {precision} {axis}\n" for axis in "xyz")
    return (
        f"ply\nformat {encoding} 1.0\nelement vertex {len(mesh.vertices)}\n{axes}"
        f"element face {len(mesh.faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    ).encode("ascii")


def ply_binary(mesh: TriangleMesh, precision: Literal["double", "float"]) -> bytes:
    """Return binary little-endian PLY with positions in float64 or float32."""
    faces = np.empty(len(mesh.faces), _FACE)
    faces["count"] = 3
    faces["corners"] = mesh.faces
    vertices = mesh.vertices.astype("<f8" if precision == "double" else "<f4")
    return b"".join([_header(mesh, "binary_little_endian", precision), vertices.tobytes(), faces.tobytes()])


def ply_ascii(mesh: TriangleMesh, precision: Literal["double", "float"]) -> bytes:
    """Return ASCII PLY."""
    one = number(precision)
    vertices = rows(positions(mesh, precision), f"{one} {one} {one}\n")
    return b"".join([_header(mesh, "ascii", precision), *vertices, *rows(mesh.faces, "3 %d %d %d\n")])
