"""Lines and numbers of text formats, quick on good files and exact about where a bad one is bad.

Whole blocks are handed to numpy; only when one does not parse is it gone through word by word, to name the line.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spherify.formats.errors import UnreadableError
from spherify.geometry.mesh import Floats, Ints

UTF8_BOM = b"\xef\xbb\xbf"
UTF16_BOMS = (b"\xff\xfe", b"\xfe\xff")
_BLOCK = 1 << 22
_GREATEST = 2**63 - 1
_NO_DIGITS = 16  # from so many on a number names no vertex: 2^53 has as many, and all formats hold fewer
_SHOWN = 40  # characters of a bad word that go into the sentence


def plain(data: bytes) -> bytes:
    """Return text with LF line ends and no byte order mark; raises `UnreadableError` for UTF-16."""
    if data.startswith(UTF16_BOMS):
        raise UnreadableError("The text is UTF-16. Save it as UTF-8 or plain ASCII.")
    data = data.removeprefix(UTF8_BOM)
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return data


def blocks(data: bytes) -> Iterator[tuple[int, list[bytes]]]:
    """Yield whole lines, stripped, a few MiB at a time, each time with the number of the first, from 1."""
    start, first = 0, 1
    while start < len(data):
        end = data.find(b"\n", start + _BLOCK)
        end = len(data) if end < 0 else end
        lines = [line.strip() for line in data[start:end].split(b"\n")]
        yield first, lines
        first += len(lines)
        start = end + 1


def shown(word: bytes) -> str:
    """Return a word from a file as it may stand in a message: short, printable, quoted."""
    return ascii(word[:_SHOWN].decode("utf-8", "replace")) + ("…" if len(word) > _SHOWN else "")


def numbers(text: bytes, expected: int) -> Floats | None:
    """Parse blank-separated numbers, correctly rounded; None unless there are just as many as expected."""
    return _parsed(text, expected, float)


def integers(text: bytes, expected: int) -> Ints | None:
    """Parse blank-separated integers; None unless there are just as many as expected, and 64 bits hold each."""
    values = _parsed(text, expected, int)
    if values is not None and len(values) and (values.max() == _GREATEST or values.min() == ~_GREATEST):
        return None  # cut to what 64 bits hold, and no longer what the file says
    return values


def _parsed(text: bytes, expected: int, kind: type) -> NDArray[Any] | None:
    if not expected:
        return np.empty(0, kind) if not text.strip() else None
    try:
        values: NDArray[Any] = np.fromstring(text, dtype=kind, sep=" ")
    except ValueError:
        return None
    return values if len(values) == expected else None


def widths(rows: Sequence[bytes], joined: bytes) -> Ints:
    """Return the number of words in each row; ``joined`` is the rows with a blank between."""
    if (
        joined[:1] in (b" ", b"")
        or joined[-1:] == b" "
        or any(gap in joined for gap in (b"  ", b"\t", b"\v", b"\f"))
    ):
        return np.array([len(row.split()) for row in rows], dtype=np.int64)
    return np.array([row.count(b" ") + 1 for row in rows], dtype=np.int64)  # counting is quicker than cutting


def coordinates(rows: Sequence[bytes], line_numbers: Sequence[int] | Ints, least: int = 3) -> Floats:
    """Return the first three numbers of each row, (n, 3); what follows them is not looked at.

    Raises:
        UnreadableError: a row with fewer than ``least`` words, a word that is no number, or a number that is not
            finite; names the line.

    """
    if not rows:
        return np.empty((0, 3))
    joined = b" ".join(rows)
    words = widths(rows, joined)
    if (words < least).any():
        row = int(np.argmax(words < least))
        raise UnreadableError(
            f"Line {line_numbers[row]}: a vertex needs {least} coordinates, but there are {words[row]}. "
            "Export the mesh again."
        )
    if (words != 3).any():
        joined = b" ".join([b" ".join(row.split()[:3]) for row in rows])
    values = numbers(joined, 3 * len(rows))
    if values is None or not np.isfinite(values).all():
        raise _bad_number([row.split()[:3] for row in rows], line_numbers)
    return values.reshape(-1, 3)


def _bad_number(rows: Sequence[Sequence[bytes]], line_numbers: Sequence[int] | Ints) -> UnreadableError:
    for row, line in zip(rows, line_numbers, strict=True):
        for word in row:
            try:
                value = float(word)
            except ValueError:
                return UnreadableError(
                    f"Line {line}: {shown(word)} is not a number. Correct it or export again."
                )
            if not math.isfinite(value):
                return UnreadableError(
                    f"Line {line}: the coordinate {shown(word)} is not a finite number. Remove or mend that vertex."
                )
    return UnreadableError(
        f"Line {line_numbers[0]} or below holds a number that cannot be read. Export again."
    )


def bad_integer(rows: Sequence[bytes], line_numbers: Sequence[int] | Ints) -> UnreadableError:
    """Return the error that names the first word of the rows that is no integer, or one beyond all bounds."""
    for row, line in zip(rows, line_numbers, strict=True):
        for word in row.split():
            if not re.fullmatch(rb"[+-]?\d+", word):
                return UnreadableError(
                    f"Line {line}: {shown(word)} is not a vertex number. Export the mesh again."
                )
            if len(word.lstrip(b"+-0")) >= _NO_DIGITS:
                return UnreadableError(
                    f"Line {line}: a face names vertex {shown(word)}, and no mesh has so many. Export the mesh again."
                )
    return UnreadableError(f"Line {line_numbers[0]} or below holds a face that cannot be read. Export again.")


def bad_index(line: int, named: int, n_vertices: int, first: int) -> UnreadableError:
    """Return the error for a face that names a vertex which is not there; ``first`` is the format's first index."""
    where = f"Line {line}: a face names vertex {named}"
    if first == 1 and named == 0:
        return UnreadableError(f"{where}, but this format counts vertices from 1. Export the mesh again.")
    span = (
        f"there are only vertices {first} … {n_vertices - 1 + first}"
        if n_vertices
        else "there are no vertices"
    )
    return UnreadableError(f"{where}, but {span}. The file is cut off or damaged: export it again.")
