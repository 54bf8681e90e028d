"""Meshes as files, the same bytes every time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Literal, get_args

from spherify.formats.colours import VertexColours
from spherify.formats.errors import InvalidExportError
from spherify.formats.names import FORMATS_OUT
from spherify.formats.writers.glb import glb
from spherify.formats.writers.ply import ply_ascii, ply_binary
from spherify.formats.writers.stl import stl_ascii, stl_binary
from spherify.formats.writers.text import obj, off
from spherify.geometry.mesh import TriangleMesh

Precision = Literal["double", "float"]
Writer = Callable[[TriangleMesh, Precision, VertexColours | None], bytes]

_WRITERS: Final[dict[str, Writer]] = {
    "obj": obj,
    "ply": ply_binary,
    "stl": stl_binary,
    "off": off,
    "glb": glb,
}
_ASCII: Final[dict[str, Writer]] = {"obj": obj, "ply": ply_ascii, "stl": stl_ascii, "off": off}
COLOURED: Final = ("ply", "glb", "obj")  # formats that hold colours of vertices


def write_mesh(
    mesh: TriangleMesh,
    mesh_format: str,
    *,
    precision: Precision = "double",
    ascii: bool = False,  # noqa: A002  # its name in the interface
    colours: VertexColours | None = None,
) -> bytes:
    """Return a mesh as the bytes of a file; vertices and faces keep their order.

    Args:
        mesh: what to write.
        mesh_format: one of `FORMATS_OUT`.
        precision: of OBJ, OFF and PLY: "double" reads back as the same float64, "float" as the nearest float32 (in
            text: nine digits, enough to tell each float32 from the next). STL
            and GLB hold float32 always.
        ascii: text instead of binary, where there is a choice (PLY, STL); OBJ and OFF are text always.
        colours: of the vertices, in the formats of `COLOURED`.

    Raises:
        InvalidExportError: an unknown format or precision, ASCII of GLB, or colours where there is no place for them.

    """
    if mesh_format not in _WRITERS:
        raise InvalidExportError(
            f"there is no format {mesh_format!r} to write; choose one of {', '.join(FORMATS_OUT)}"
        )
    if precision not in get_args(Precision):
        raise InvalidExportError(
            f"precision must be one of {', '.join(get_args(Precision))}, not {precision!r}"
        )
    writers = _ASCII if ascii else _WRITERS
    if mesh_format not in writers:
        raise InvalidExportError(f"{mesh_format} has no text form; choose one of {', '.join(_ASCII)}")
    if colours is not None and mesh_format not in COLOURED:
        raise InvalidExportError(f"{mesh_format} holds no colours; choose one of {', '.join(COLOURED)}")
    return writers[mesh_format](mesh, precision, colours)
