"""The body of an ASCII PLY."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from spherify.formats import text
from spherify.formats.errors import UnreadableError
from spherify.formats.readers.ply_header import Element, Header
from spherify.formats.readers.ply_rows import cut_off, ranges
from spherify.geometry.mesh import Floats, Ints

_GREATEST = 2**53  # up to it float64 holds every integer


@dataclass
class TextRows:
    """Elements of an ASCII PLY: one row a line, blank lines and comments between them passed over."""

    rows: list[bytes]
    numbers: list[int]
    at: int = 0

    @classmethod
    def of(cls, data: bytes, header: Header) -> TextRows:
        """Cut the body into rows."""
        rows, numbers = [], []
        for first, lines in text.blocks(text.plain(data[header.size :])):
            for number, line in enumerate(lines, first + header.lines):
                if line and not line.startswith((b"comment", b"obj_info", b"#")):
                    rows.append(line)
                    numbers.append(number)
        return cls(rows, numbers)

    def _next(self, element: Element) -> tuple[list[bytes], list[int]]:
        start, self.at = self.at, self.at + element.count
        if self.at > len(self.rows):
            raise cut_off(element, len(self.rows) - start)
        return self.rows[start : self.at], self.numbers[start : self.at]

    def scalars(self, element: Element, columns: Sequence[int]) -> Floats:
        """See `Rows.scalars`."""
        rows, numbers = self._next(element)
        words = [row.split() for row in rows]
        width = len(element.properties)
        for row, number in zip(words, numbers, strict=True):
            if len(row) != width:
                raise UnreadableError(
                    f"Line {number}: a {element.name} has {width} values by the header, but {len(row)} stand here. "
                    "Export the mesh again."
                )
        picked = [b" ".join([row[column] for column in columns]) for row in words]
        return text.coordinates(picked, numbers, least=len(columns))

    def lists(self, element: Element, column: int) -> tuple[Ints, Ints]:
        """See `Rows.lists`."""
        rows, numbers = self._next(element)
        joined = b" ".join(rows)
        widths = text.widths(rows, joined) if rows else np.empty(0, np.int64)
        values = text.numbers(joined, int(widths.sum()))
        if values is None:
            raise text.bad_integer(rows, numbers)
        ends = np.cumsum(widths)
        at = ends - widths
        start, lengths = at, np.zeros(len(rows), dtype=np.int64)
        for place, prop in enumerate(element.properties):
            inside = at < ends
            if prop.count_type is None:
                at = at + 1
                continue
            counts = np.where(inside, values[np.minimum(at, len(values) - 1)], -1) if len(values) else at
            _check_rows(
                inside & (counts >= 0) & (counts == np.floor(counts)) & (counts <= ends - at),
                numbers,
                element,
            )
            counts = counts.astype(np.int64)
            if place == column:
                start, lengths = at + 1, counts
            at = at + 1 + counts
        _check_rows(at == ends, numbers, element)
        items = values[ranges(start, lengths)]
        whole = (items == np.floor(items)) & (np.abs(items) < _GREATEST)
        if not whole.all():
            row = int(np.searchsorted(np.cumsum(lengths), int(np.argmin(whole)), side="right"))
            raise text.bad_integer([rows[row]], [numbers[row]])
        return lengths, items.astype(np.int64)

    def skip(self, element: Element) -> None:
        """See `Rows.skip`."""
        self._next(element)


def _check_rows(good: np.ndarray, numbers: list[int], element: Element) -> None:
    if not good.all():
        line = numbers[int(np.argmin(good))]
        raise UnreadableError(
            f"Line {line}: the row does not hold what the header says of a {element.name}. Export the mesh again."
        )
