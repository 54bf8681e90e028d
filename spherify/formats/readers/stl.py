"""STL, binary and ASCII: three positions a triangle and no connectivity; normals are passed over."""

from __future__ import annotations

import numpy as np

from spherify.formats import text
from spherify.formats.errors import UnreadableError
from spherify.formats.limits import ReadLimits
from spherify.formats.raw import RawMesh, check_counts

HEADER_BYTES = 84  # 80 of free text, and the number of triangles
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_STRUCTURE = (b"facet", b"outer", b"endloop", b"endfacet", b"solid", b"endsolid", b"color")
_COMMENTS = (b"#", b";", b"//")


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
    parts = []
    corners = facets = 0
    for first, lines in text.blocks(data):
        rows, numbers = [], []
        for number, line in enumerate(lines, first):
            if not line or line.startswith(_COMMENTS):
                continue
            keyword, *rest = line.split(None, 1)
            keyword = keyword.lower()
            if keyword == b"vertex":
                rows.append(b"".join(rest))
                numbers.append(number)
                corners += 1
            elif keyword == b"endloop":
                facets += 1
                if corners != 3 * facets:
                    raise UnreadableError(
                        f"Line {number}: a facet of STL has 3 vertices, but this one has {corners - 3 * facets + 3}. "
                        "Export the mesh as triangles."
                    )
            elif not keyword.startswith(_STRUCTURE):
                raise UnreadableError(f"Line {number}: {text.shown(line)} is not STL. Export the mesh again.")
        check_counts(0, facets, limits)
        parts.append(text.coordinates(rows, numbers))
    if corners != 3 * facets:
        raise UnreadableError("The STL file ends inside a facet: it is cut off. Export or upload it again.")
    return _soup(np.concatenate(parts))


def _soup(corners: np.ndarray) -> RawMesh:
    return RawMesh(corners, np.arange(len(corners), dtype=np.int64).reshape(-1, 3))
