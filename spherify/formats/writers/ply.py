"""PLY: binary little endian, or ASCII.

Ours: trimesh rounds positions to float32, and the default here is float64.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from spherify.formats.colours import VertexColours
from spherify.formats.writers.text import number, positions, rows
from spherify.geometry.mesh import TriangleMesh

_CHANNELS = ("red", "green", "blue")
_FACE = np.dtype([("count", "u1"), ("corners", "<i4", 3)])


def _header(
    mesh: TriangleMesh, encoding: str, precision: Literal["double", "float"], colours: VertexColours | None
) -> bytes:
    note, properties = "", "".join(f"property {precision} {axis}\n" for axis in "xyz")
    if colours is not None:
        note = f"comment {colours.note}\n"
        properties += "".join(f"property uchar {channel}\n" for channel in _CHANNELS)
    return (
        f"ply\nformat {encoding} 1.0\n{note}element vertex {len(mesh.vertices)}\n{properties}"
        f"element face {len(mesh.faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    ).encode("ascii")


def ply_binary(
    mesh: TriangleMesh, precision: Literal["double", "float"], colours: VertexColours | None = None
) -> bytes:
    """Return binary little-endian PLY with positions in float64 or float32, colours as bytes."""
    faces = np.empty(len(mesh.faces), _FACE)
    faces["count"] = 3
    faces["corners"] = mesh.faces
    at = ("at", "<f8" if precision == "double" else "<f4", 3)
    vertices = np.empty(len(mesh.vertices), [at] if colours is None else [at, ("rgb", "u1", 3)])
    vertices["at"] = mesh.vertices
    if colours is not None:
        vertices["rgb"] = colours.rgb
    header = _header(mesh, "binary_little_endian", precision, colours)
    return b"".join([header, vertices.tobytes(), faces.tobytes()])


def ply_ascii(
    mesh: TriangleMesh, precision: Literal["double", "float"], colours: VertexColours | None = None
) -> bytes:
    """Return ASCII PLY."""
    one = number(precision)
    values, template = positions(mesh, precision), f"{one} {one} {one}\n"
    if colours is not None:
        values, template = np.column_stack([values, colours.rgb]), f"{one} {one} {one} %d %d %d\n"
    header = _header(mesh, "ascii", precision, colours)
    return b"".join([header, *rows(values, template), *rows(mesh.faces, "3 %d %d %d\n")])
