"""OFF of Geomview: a header word, three counts, one line a vertex, one line a face.

The prefixes ST, C and N announce columns behind the position, which are passed over as face colours are.
"""

from __future__ import annotations

import re

import numpy as np

from spherify.formats import text
from spherify.formats.errors import UnreadableError
from spherify.formats.limits import ReadLimits
from spherify.formats.raw import RawMesh, check_claim, check_counts, fans

HEADER = re.compile(rb"(ST)?(C)?(N)?(4)?(n)?OFF(\s+BINARY)?(?=\s|$)")
_COUNT = re.compile(rb"[+-]?\d{1,40}")
_DIGITS = 10  # of a number of corners


def read_off(data: bytes, limits: ReadLimits) -> RawMesh:
    """Read OFF text; raises `UnreadableError` naming the line."""
    rows, numbers = [], []
    for first, lines in text.blocks(text.plain(data)):
        for number, line in enumerate(lines, first):
            content = line.split(b"#", 1)[0].strip()
            if content:
                rows.append(content)
                numbers.append(number)
    header = HEADER.match(rows[0]) if rows else None
    if header is None:
        raise UnreadableError("An OFF file starts with the word OFF. Export the mesh again.")
    if header[4] or header[5]:
        raise UnreadableError("The OFF file holds vertices that are not in 3 dimensions. Export plain OFF.")
    if header[6]:
        raise UnreadableError("Binary OFF is not read. Export it as text OFF or as PLY.")
    rest = rows[0][header.end() :].strip()
    body = 0 if rest else 1
    rows[0] = rest
    words = rows[body].split()[:2] if len(rows) > body else []
    if len(words) != 2 or not all(map(_COUNT.fullmatch, words)):
        raise UnreadableError(
            "The OFF header lacks the numbers of vertices and faces. Export the mesh again."
        )
    n_vertices, n_faces = map(int, words)
    claims = [(n_vertices, "vertices", 6), (n_faces, "faces", 2)]  # "0 0 0\n" and "0\n"
    claims.sort(key=lambda claim: claim[0] >= 0)  # what cannot be is said first
    for claimed, what, least_bytes in claims:
        check_claim(claimed, what, least_bytes, len(data))
    check_counts(n_vertices, 0, limits)
    start, end = body + 1, body + 1 + n_vertices
    if len(rows) < end + n_faces:
        raise UnreadableError(
            f"The OFF header claims {n_vertices:,} vertices and {n_faces:,} faces, but only "
            f"{len(rows) - start:,} lines follow: the file is cut off or damaged. Export or upload it again."
        )
    vertices = text.coordinates(rows[start:end], numbers[start:end])
    return _with_faces(vertices, rows[end : end + n_faces], numbers[end : end + n_faces], limits)


def _with_faces(vertices: np.ndarray, rows: list[bytes], numbers: list[int], limits: ReadLimits) -> RawMesh:
    polygons = []
    for row, number in zip(rows, numbers, strict=True):
        words = row.split()
        length = int(words[0]) if words[0].isdigit() and len(words[0]) < _DIGITS else -1
        if not 0 <= length < len(words):
            raise UnreadableError(
                f"Line {number}: a face starts with the number of its corners, and that many vertex numbers "
                f"follow, but it reads {text.shown(row)}. Export the mesh again."
            )
        polygons.append(words[1 : length + 1])
    lengths = np.array([len(polygon) for polygon in polygons], dtype=np.int64)
    check_counts(len(vertices), int(np.maximum(lengths - 2, 0).sum()), limits)
    joined = [b" ".join(polygon) for polygon in polygons]
    corners = text.integers(b" ".join(joined), int(lengths.sum()))
    if corners is None:
        raise text.bad_integer(joined, numbers)
    wrong = (corners < 0) | (corners >= len(vertices))
    if wrong.any():
        corner = int(np.argmax(wrong))
        polygon = int(np.searchsorted(np.cumsum(lengths), corner, side="right"))
        raise text.bad_index(numbers[polygon], int(corners[corner]), len(vertices), 0)
    faces, repairs = fans(lengths, corners)
    return RawMesh(vertices, faces, repairs)
