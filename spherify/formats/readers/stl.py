"""STL, binary and ASCII: three positions a triangle and no connectivity; normals are passed over."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spherify.formats import text
from spherify.formats.errors import UnreadableError
from spherify.formats.limits import ReadLimits
from spherify.formats.raw import RawMesh, check_counts

HEADER_BYTES = 84  # 80 of free text, and the number of triangles
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_STRUCTURE = (b"facet", b"outer", b"endloop", b"endfacet", b"solid", b"endsolid", b"color")
_COMMENTS = (b"#", b";", b"//")
_FACET_LINES = 7  # facet, outer loop, three vertices, endloop, endfacet
_VERTEX_LINES = (2, 3, 4)


def claimed_triangles(data: bytes) -> int:
    """Return the number of triangles in the header of a binary STL, -1 if the file is shorter than a header."""
    return int.from_bytes(data[80:HEADER_BYTES], "little") if len(data) >= HEADER_BYTES else -1


def is_binary(data: bytes) -> bool:
    """Whether the size is the one a binary STL with this header has: the only sure sign there is."""
    claimed = claimed_triangles(data)
    return claimed >= 0 and HEADER_BYTES + claimed * TRIANGLE.itemsize == len(data)


def read_stl(data: bytes, limits: ReadLimits) -> RawMesh:
    """Read STL; raises `UnreadableError`."""
    if (
        not is_binary(data)
        and data.removeprefix(text.UTF8_BOM).lstrip()[:5].lower() == b"solid"
        and b"\0" not in data
    ):
        return _read_ascii(text.plain(data), limits)
    return _read_binary(data, limits)


def _read_binary(data: bytes, limits: ReadLimits) -> RawMesh:
    claimed = claimed_triangles(data)
    available = (len(data) - HEADER_BYTES) // TRIANGLE.itemsize
    if claimed < 0 or claimed > available:
        raise UnreadableError(
            f"The STL header claims {max(claimed, 0):,} triangles, but the file ends after {max(available, 0):,}: "
            "it is cut off or damaged. Export or upload it again."
        )
    check_counts(0, claimed, limits)
    triangles = np.frombuffer(data, TRIANGLE, count=claimed, offset=HEADER_BYTES)
    return _soup(triangles["corners"].reshape(-1, 3).astype(np.float64))


def _read_ascii(data: bytes, limits: ReadLimits) -> RawMesh:
    reader = _TextReader()
    parts = []
    for first, lines in text.blocks(data):
        begun = next((at for at, line in enumerate(lines) if line.startswith(b"facet")), len(lines))
        reader.take(lines[:begun], first)  # the end of a facet, or a header
        regular = _regular(lines, begun) if reader.between_facets else None
        if regular is not None:
            parts += [reader.coordinates(), regular]
            reader.facets += len(regular) // 3
            reader.corners += len(regular)
            begun += len(regular) // 3 * _FACET_LINES
        reader.take(lines[begun:], first + begun)
        check_counts(0, reader.facets, limits)
        parts.append(reader.coordinates())
    if not reader.between_facets:
        raise UnreadableError("The STL file ends inside a facet: it is cut off. Export or upload it again.")
    return _soup(np.concatenate(parts))


class _TextReader:
    """Takes lines one after the other; quick enough for what is odd, and exact about where it is wrong."""

    def __init__(self) -> None:
        self.corners = 0
        self.facets = 0
        self._rows: list[bytes] = []
        self._numbers: list[int] = []

    @property
    def between_facets(self) -> bool:
        """Whether every facet so far has its corners."""
        return self.corners == 3 * self.facets

    def take(self, lines: Sequence[bytes], first: int) -> None:
        """Read lines, the first of which has the number ``first``; raises `UnreadableError`."""
        for number, line in enumerate(lines, first):
            if not line or line.startswith(_COMMENTS):
                continue
            keyword, *rest = line.split(None, 1)
            keyword = keyword.lower()
            if keyword == b"vertex":
                self._rows.append(b"".join(rest))
                self._numbers.append(number)
                self.corners += 1
            elif keyword == b"endloop":
                self.facets += 1
                if not self.between_facets:
                    raise UnreadableError(
                        f"Line {number}: a facet of STL has 3 vertices, but this one has "
                        f"{self.corners - 3 * self.facets + 3}. Export the mesh as triangles."
                    )
            elif not keyword.startswith(_STRUCTURE):
                raise UnreadableError(f"Line {number}: {text.shown(line)} is not STL. Export the mesh again.")

    def coordinates(self) -> np.ndarray:
        """Return the corners read since the last call, (k, 3)."""
        rows, numbers = self._rows, self._numbers
        self._rows, self._numbers = [], []
        return text.coordinates(rows, numbers)


def _regular(lines: Sequence[bytes], begin: int) -> np.ndarray | None:
    """Read facets as every program writes them, seven lines each, at once: corners (3k, 3), or None if they are not so.

    ``lines[begin]`` is the first line of a facet; the last one, cut by the end of the lines, is left over.
    """
    k = (len(lines) - begin) // _FACET_LINES
    while k and lines[begin + k * _FACET_LINES - 1] != b"endfacet":
        k -= 1  # what stands at the end of the file, or of a body
    columns = [
        lines[begin + place : begin + k * _FACET_LINES : _FACET_LINES] for place in range(_FACET_LINES)
    ]
    fixed = {1: b"outer loop", 5: b"endloop", 6: b"endfacet"}
    if not k or any(columns[place].count(line) != k for place, line in fixed.items()):
        return None
    if _joined(columns[0]).count(b"\nfacet") != k:
        return None
    corners = [b""] * (3 * k)
    for corner, place in enumerate(_VERTEX_LINES):
        corners[corner::3] = columns[place]
    words = _joined(corners)
    if words.count(b"\nvertex ") != 3 * k or (text.widths(corners, b" ".join(corners)) != 4).any():
        return None
    values = text.numbers(words.replace(b"\nvertex ", b" "), 9 * k)
    return values.reshape(-1, 3) if values is not None and np.isfinite(values).all() else None


def _joined(lines: Sequence[bytes]) -> bytes:
    """Return lines with a line end before each."""
    return b"\n".join([b"", *lines])


def _soup(corners: np.ndarray) -> RawMesh:
    return RawMesh(corners, np.arange(len(corners), dtype=np.int64).reshape(-1, 3))
