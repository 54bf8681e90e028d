"""PLY of Stanford: ASCII and binary in both byte orders; faces of any and mixed sizes, and triangle strips."""

from __future__ import annotations

import numpy as np

from spherify.formats import text
from spherify.formats.errors import UnreadableError
from spherify.formats.limits import ReadLimits
from spherify.formats.raw import RawMesh, check_counts, fans
from spherify.formats.readers.ply_binary import BinaryRows
from spherify.formats.readers.ply_header import Element, Header, parse_header
from spherify.formats.readers.ply_rows import Rows, check_size
from spherify.formats.readers.ply_text import TextRows
from spherify.formats.report import Repair
from spherify.geometry.mesh import Floats, Ints

_INDEX_NAMES = ("vertex_indices", "vertex_index")
_RESTART = -1  # stands between two strips


def read_ply(data: bytes, limits: ReadLimits) -> RawMesh:
    """Read PLY; raises `UnreadableError`."""
    data = data.removeprefix(text.UTF8_BOM)
    header = parse_header(data)
    check_size(header, len(data))
    rows = _rows(data, header)
    vertices: Floats = np.empty((0, 3))
    faces: list[Ints] = []
    repairs: tuple[Repair, ...] = ()
    for element in header.elements:
        if element.name == "vertex":
            check_counts(element.count, 0, limits)
            vertices = _vertices(rows, element)
        elif element.name in ("face", "tristrips"):
            lengths, corners = rows.lists(element, _index_column(element))
            if element.name == "face":
                check_counts(0, int(np.maximum(lengths - 2, 0).sum()), limits)
                triangles, repairs = fans(lengths, corners)
            else:
                triangles = _strips(lengths, corners)
            faces.append(triangles)
        else:
            rows.skip(element)
    triangles = np.concatenate(faces) if faces else np.empty((0, 3), np.int64)
    check_counts(len(vertices), len(triangles), limits)
    wrong = (triangles < 0) | (triangles >= len(vertices))
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        raise UnreadableError(
            f"A face names vertex {triangles[row, column]}, but there are only vertices 0 … {len(vertices) - 1}. "
            "The file is damaged: export it again."
        )
    return RawMesh(vertices, triangles, repairs)


def _rows(data: bytes, header: Header) -> Rows:
    if header.encoding == "ascii":
        return TextRows.of(data, header)
    return BinaryRows(data, header.encoding, header.size)


def _vertices(rows: Rows, element: Element) -> Floats:
    columns = [element.column(axis) for axis in "xyz"]
    if None in columns or element.has_lists:
        raise UnreadableError("The PLY vertices have no x, y and z of their own. Export the mesh again.")
    return rows.scalars(element, [column for column in columns if column is not None])


def _index_column(element: Element) -> int:
    column = element.column(*_INDEX_NAMES)
    if column is None or element.properties[column].count_type is None:
        raise UnreadableError(
            f"The PLY header gives a {element.name} no list vertex_indices. Export the mesh as triangles."
        )
    return column


def _strips(lengths: Ints, items: Ints) -> Ints:
    """Return the triangles of strips: each corner from a strip's third on closes one, every other turned round."""
    rows = np.repeat(np.arange(len(lengths)), lengths)
    places = np.arange(len(items))
    starts_row = np.ones(len(items), dtype=bool)
    starts_row[1:] = rows[1:] != rows[:-1]
    restart = items == _RESTART
    # Where the strip of each item begins: behind the last restart, or at the row's first item.
    begin = np.maximum.accumulate(np.where(restart, places + 1, np.where(starts_row, places, 0)))
    third = places[~restart & (places - begin >= 2)]
    a, b, c = items[third - 2], items[third - 1], items[third]
    odd = (third - begin[third]) % 2 == 1
    triangles = np.stack([np.where(odd, b, a), np.where(odd, a, b), c], axis=1)
    stitch = (a == b) | (b == c) | (c == a)  # they turn a strip round a corner and have no area
    proper: Ints = triangles[~stitch]
    return proper
