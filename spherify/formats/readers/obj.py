"""Wavefront OBJ: ``v`` and ``f``, as the file connects them.

Texture coordinates, normals, groups and materials are passed over, so that no vertex is split at a seam and no other
file is ever opened.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from spherify.formats import text
from spherify.formats.errors import UnreadableError
from spherify.formats.limits import ReadLimits
from spherify.formats.raw import RawMesh, check_counts, fans
from spherify.geometry.mesh import Floats, Ints

_COMMENT = re.compile(rb"\s#.*")  # only after a blank: -1.#IND is a bad number, not -1 with a comment
_NEWLINE, _BLANK, _TAB = b"\n \t"
_BEHIND_SLASH = re.compile(rb"/\S*")


@dataclass
class _Parts:
    """What has been read so far."""

    vertices: list[Floats] = field(default_factory=list)
    lengths: list[Ints] = field(default_factory=list)
    corners: list[Ints] = field(default_factory=list)
    lines: list[Ints] = field(default_factory=list)  # of the polygons
    n_vertices: int = 0
    n_triangles: int = 0


def read_obj(data: bytes, limits: ReadLimits) -> RawMesh:
    """Read OBJ text; raises `UnreadableError` naming the line."""
    content = text.plain(data).replace(b"\\\n", b" ")
    parts = _Parts()
    for first, lines in text.blocks(content):
        _read_block(parts, first, lines, limits)
    if not parts.lengths:
        return RawMesh(np.empty((0, 3)), np.empty((0, 3), np.int64))
    lengths, corners = np.concatenate(parts.lengths), np.concatenate(parts.corners)
    beyond = corners >= parts.n_vertices
    if beyond.any():
        corner = int(np.argmax(beyond))
        polygon = int(np.searchsorted(np.cumsum(lengths), corner, side="right"))
        line = int(np.concatenate(parts.lines)[polygon])
        raise text.bad_index(line, int(corners[corner]) + 1, parts.n_vertices, 1)
    faces, repairs = fans(lengths, corners)
    return RawMesh(np.concatenate(parts.vertices), faces, repairs)


def _read_block(parts: _Parts, first: int, lines: list[bytes], limits: ReadLimits) -> None:
    vertex_places, polygon_places = _places(lines)
    vertices, polygons = _picked(lines, vertex_places), _picked(lines, polygon_places)
    vertex_lines, where = vertex_places + first, polygon_places + first
    parts.vertices.append(text.coordinates(vertices, vertex_lines))
    joined = b" ".join(polygons)
    lengths = text.widths(polygons, joined) if polygons else np.empty(0, np.int64)
    before = parts.n_vertices + np.searchsorted(vertex_lines, where)
    parts.corners.append(_indices(polygons, joined, where, lengths, before))
    parts.lengths.append(lengths)
    parts.lines.append(where)
    parts.n_vertices += len(vertices)
    parts.n_triangles += int(np.maximum(lengths - 2, 0).sum())
    check_counts(parts.n_vertices, parts.n_triangles, limits)


def _picked(lines: list[bytes], places: Ints) -> list[bytes]:
    """Return the lines at some places, without their keyword and comments."""
    rows = [lines[place][2:] for place in places.tolist()]
    return [_COMMENT.sub(b"", row) for row in rows] if any(b"#" in row for row in rows) else rows


def _places(lines: list[bytes]) -> tuple[Ints, Ints]:
    """Return where the lines of vertices stand, and those of faces: a letter and a blank."""
    octets = np.frombuffer(b"\n".join([*lines, b"", b""]), dtype=np.uint8)
    starts = np.concatenate([[0], np.flatnonzero(octets == _NEWLINE) + 1])[: len(lines)]
    letter, behind = octets[starts], octets[starts + 1]
    parted = (behind == _BLANK) | (behind == _TAB)
    return np.flatnonzero(parted & (letter == ord("v"))), np.flatnonzero(parted & (letter == ord("f")))


def _indices(polygons: list[bytes], joined: bytes, lines: Ints, lengths: Ints, before: Ints) -> Ints:
    """Return 0-based vertex indices; ``before`` counts the vertices defined above each polygon."""
    named = text.integers(_BEHIND_SLASH.sub(b"", joined) if b"/" in joined else joined, int(lengths.sum()))
    if named is None:
        raise text.bad_integer([_BEHIND_SLASH.sub(b"", row) for row in polygons], lines)
    relative = named < 0
    resolved = np.where(relative, named + np.repeat(before, lengths), named - 1)
    if (resolved < 0).any():
        corner = int(np.argmax(resolved < 0))
        polygon = int(np.searchsorted(np.cumsum(lengths), corner, side="right"))
        if named[corner] == 0:
            raise text.bad_index(int(lines[polygon]), 0, int(before[polygon]), 1)
        raise UnreadableError(
            f"Line {lines[polygon]}: a face counts {-int(named[corner])} vertices back, but only "
            f"{int(before[polygon])} stand above it. Export the mesh again."
        )
    return resolved
