"""The text formats: OBJ and OFF.

Ours: trimesh writes a fixed number of decimals, which does not read back as the same float64, in twice the time.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from spherify.formats.colours import VertexColours
from spherify.geometry.mesh import TriangleMesh

_ROWS = (
    1 << 12
)  # of one go: enough to be quick, few enough that other threads get the interpreter within some 10 ms


def rows(values: NDArray[np.generic], template: str) -> Iterator[bytes]:
    """Yield the rows of an array through a %-template with one place a column."""
    for start in range(0, len(values), _ROWS):
        block = values[start : start + _ROWS]
        yield (template * len(block) % tuple(block.reshape(-1).tolist())).encode("ascii")


def number(precision: Literal["double", "float"]) -> str:
    """Return the %-template of a number: the fewest digits that read back as the same float64, or 9 for float32."""
    return "%r" if precision == "double" else "%.9g"


def positions(mesh: TriangleMesh, precision: Literal["double", "float"]) -> NDArray[np.float64]:
    """Return the positions, (n, 3), rounded to float32 if that is the precision."""
    return mesh.vertices if precision == "double" else mesh.vertices.astype(np.float32).astype(np.float64)


def obj(
    mesh: TriangleMesh, precision: Literal["double", "float"], colours: VertexColours | None = None
) -> bytes:
    """Return Wavefront OBJ: v and f lines; colours, from 0 to 1, follow the position, as most programs read them."""
    one = number(precision)
    head, values, template = b"", positions(mesh, precision), f"v {one} {one} {one}\n"
    if colours is not None:
        head = f"# {colours.note}\n".encode("ascii")
        values, template = (
            np.column_stack([values, colours.rgb / 255]),
            f"v {one} {one} {one} %.4f %.4f %.4f\n",
        )
    return b"".join([head, *rows(values, template), *rows(mesh.faces + 1, "f %d %d %d\n")])


def off(
    mesh: TriangleMesh,
    precision: Literal["double", "float"],
    colours: VertexColours | None = None,  # none in OFF
) -> bytes:
    """Return OFF; its third count, of edges, is 0 as readers ignore it."""
    one = number(precision)
    head = f"OFF\n{len(mesh.vertices)} {len(mesh.faces)} 0\n".encode("ascii")
    vertices = rows(positions(mesh, precision), f"{one} {one} {one}\n")
    return b"".join([head, *vertices, *rows(mesh.faces, "3 %d %d %d\n")])
