"""Wavefront OBJ: ``v`` and ``f``, as the file connects them.

Texture coordinates, normals, groups and materials are passed over, so that no vertex is split at a seam and no other
file is ever opened.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from itertools import accumulate

import numpy as np

from spherify.formats import text
from spherify.formats.errors import UnreadableError
from spherify.formats.limits import ReadLimits
from spherify.formats.raw import RawMesh, check_counts, fans
from spherify.geometry.mesh import Floats, Ints

_COMMENT = re.compile(rb"\s#.*")  # only after a blank: -1.#IND is a bad number, not -1 with a comment
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
    vertices, vertex_lines = _picked(lines, first, (b"v ", b"v\t"))
    polygons, polygon_lines = _picked(lines, first, (b"f ", b"f\t"))
    parts.vertices.append(text.coordinates(vertices, vertex_lines))
    joined = b" ".join(polygons)
    lengths = text.widths(polygons, joined) if polygons else np.empty(0, np.int64)
    where = np.array(polygon_lines, dtype=np.int64)
    before = parts.n_vertices + np.searchsorted(np.array(vertex_lines, dtype=np.int64), where)
    parts.corners.append(_indices(polygons, joined, polygon_lines, lengths, before))
    parts.lengths.append(lengths)
    parts.lines.append(where)
    parts.n_vertices += len(vertices)
    parts.n_triangles += int(np.maximum(lengths - 2, 0).sum())
    check_counts(parts.n_vertices, parts.n_triangles, limits)


def _picked(lines: list[bytes], first: int, keywords: tuple[bytes, ...]) -> tuple[list[bytes], list[int]]:
    """Return the lines with one of the keywords, of 2 bytes, without it and comments; and their numbers."""
    numbers = [number for number, line in enumerate(lines, first) if line.startswith(keywords)]
    rows = [lines[number - first][2:] for number in numbers]
    return [_COMMENT.sub(b"", row) if b"#" in row else row for row in rows], numbers


def _indices(
    polygons: list[bytes], joined: bytes, polygon_lines: list[int], lengths: Ints, before: Ints
) -> Ints:
    """Return 0-based vertex indices; ``before`` counts the vertices defined above each polygon."""
    named = text.integers(_BEHIND_SLASH.sub(b"", joined) if b"/" in joined else joined, int(lengths.sum()))
    if named is None:
        raise text.bad_integer([_BEHIND_SLASH.sub(b"", row) for row in polygons], polygon_lines)
    relative = named < 0
    resolved = np.where(relative, named + np.repeat(before, lengths), named - 1)
    if (resolved < 0).any():
        corner = int(np.argmax(resolved < 0))
        polygon = int(np.searchsorted(list(accumulate(lengths.tolist())), corner, side="right"))
        if named[corner] == 0:
            raise text.bad_index(polygon_lines[polygon], 0, int(before[polygon]), 1)
        raise UnreadableError(
            f"Line {polygon_lines[polygon]}: a face counts {-int(named[corner])} vertices back, but only "
            f"{int(before[polygon])} stand above it. Export the mesh again."
        )
    return resolved
