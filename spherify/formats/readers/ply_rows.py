"""Rows of PLY elements as arrays, from text or bytes.

Both sources give the same: scalar columns, and one list column as lengths and items one after the other.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from spherify.formats import text
from spherify.formats.errors import UnreadableError
from spherify.formats.raw import check_claim
from spherify.formats.readers.ply_header import Element, Header, Property
from spherify.geometry.mesh import Floats, Ints

_STRUCT_CODES: Final = {
    "i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "f4": "f", "f8": "d",
}  # fmt: skip


class Rows(Protocol):
    """A source of elements, in the order of the header."""

    def scalars(self, element: Element, columns: Sequence[int]) -> Floats:
        """Consume an element without lists; return the columns asked for, (count, len(columns))."""
        ...

    def lists(self, element: Element, column: int) -> tuple[Ints, Ints]:
        """Consume an element; return the lengths and the items of one list column."""
        ...


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
            raise _cut_off(element, len(self.rows) - start)
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
        if not columns:
            return np.empty((element.count, 0))
        picked = [b" ".join([row[column] for column in columns]) for row in words]
        return text.coordinates(picked, numbers, least=len(columns))

    def lists(self, element: Element, column: int) -> tuple[Ints, Ints]:
        """See `Rows.lists`."""
        rows, numbers = self._next(element)
        widths = np.array([len(row.split()) for row in rows], dtype=np.int64)
        values = text.numbers(b" ".join(rows), int(widths.sum()))
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
        items = values[_ranges(start, lengths)]
        whole = items == np.floor(items)
        if not whole.all():
            row = int(np.searchsorted(np.cumsum(lengths), int(np.argmin(whole)), side="right"))
            raise text.bad_integer([rows[row]], [numbers[row]])
        return lengths, items.astype(np.int64)


def _check_rows(good: np.ndarray, numbers: list[int], element: Element) -> None:
    if not good.all():
        line = numbers[int(np.argmin(good))]
        raise UnreadableError(
            f"Line {line}: the row does not hold what the header says of a {element.name}. Export the mesh again."
        )


@dataclass
class BinaryRows:
    """Elements of a binary PLY; ``order`` is numpy's sign for the byte order."""

    data: bytes
    order: str
    at: int

    def scalars(self, element: Element, columns: Sequence[int]) -> Floats:
        """See `Rows.scalars`."""
        row = np.dtype(
            [(f"p{place}", self.order + prop.type) for place, prop in enumerate(element.properties)]
        )
        available = (len(self.data) - self.at) // max(row.itemsize, 1)
        if row.itemsize and element.count > available:
            raise _cut_off(element, available)
        count = element.count if row.itemsize else 0
        values = np.frombuffer(self.data, row, count, self.at) if count else np.empty(0, row)
        self.at += row.itemsize * count
        if not columns:
            return np.empty((count, 0))
        return np.stack([values[f"p{place}"].astype(np.float64) for place in columns], axis=1)

    def lists(self, element: Element, column: int) -> tuple[Ints, Ints]:
        """See `Rows.lists`."""
        return self._even_lists(element, column) or self._uneven_lists(element, column)

    def _even_lists(self, element: Element, column: int) -> tuple[Ints, Ints] | None:
        """Read rows that all have lists of the same lengths as the first one; None if they have not."""
        if not element.count:
            return np.empty(0, np.int64), np.empty(0, np.int64)
        at, fields = self.at, []
        for place, prop in enumerate(element.properties):
            if prop.count_type is None:
                fields.append((f"p{place}", self.order + prop.type))
                at += np.dtype(prop.type).itemsize
                continue
            count_type = np.dtype(self.order + prop.count_type)
            if at + count_type.itemsize > len(self.data):
                raise _cut_off(element, 0)
            count = int(np.frombuffer(self.data, count_type, 1, at)[0])
            at += count_type.itemsize + count * np.dtype(prop.type).itemsize
            if count < 0 or at > len(self.data):
                return None  # the slow way names the row
            fields += [(f"n{place}", count_type.str), (f"p{place}", self.order + prop.type, (count,))]  # type: ignore[list-item]  # a subarray
        row = np.dtype(fields)
        if self.at + row.itemsize * element.count > len(self.data):
            return None
        values = np.frombuffer(self.data, row, element.count, self.at)
        for name in row.names or ():
            if name.startswith("n") and (values[name] != values[name][0]).any():
                return None
        self.at += row.itemsize * element.count
        items = values[f"p{column}"].astype(np.int64)
        return np.full(element.count, items.shape[1], dtype=np.int64), items.reshape(-1)

    def _uneven_lists(self, element: Element, column: int) -> tuple[Ints, Ints]:
        """Walk from row to row; only the lengths are read one by one."""
        steps = [self._step(prop) for prop in element.properties]
        data, at = self.data, self.at
        starts, lengths = [], []
        for row in range(element.count):
            for place, (count_at, size) in enumerate(steps):
                if count_at is None:
                    at += size
                    continue
                if at + count_at.size > len(data):
                    raise _cut_off(element, row)
                count = count_at.unpack_from(data, at)[0]
                if count < 0:
                    raise UnreadableError(
                        f"The list of {element.name} {row} has the length {count}. Export the mesh again."
                    )
                at += count_at.size
                if place == column:
                    starts.append(at)
                    lengths.append(count)
                at += count * size
            if at > len(data):
                raise _cut_off(element, row)
        self.at = at
        kind = np.dtype(self.order + element.properties[column].type)
        sizes = np.array(lengths, dtype=np.int64)
        octets = np.frombuffer(data, np.uint8)[
            _ranges(np.array(starts, dtype=np.int64), sizes * kind.itemsize)
        ]
        return sizes, octets.view(kind).astype(np.int64)

    def _step(self, prop: Property) -> tuple[struct.Struct | None, int]:
        count_at = struct.Struct(self.order + _STRUCT_CODES[prop.count_type]) if prop.count_type else None
        return count_at, np.dtype(prop.type).itemsize


def _ranges(starts: Ints, lengths: Ints) -> Ints:
    """Return start, start + 1, … for each pair, one after the other."""
    return np.repeat(starts - (np.cumsum(lengths) - lengths), lengths) + np.arange(int(lengths.sum()))


def _cut_off(element: Element, there: int) -> UnreadableError:
    return UnreadableError(
        f"The PLY header claims {element.count:,} rows of {element.name}, but the file ends after {there:,}: it is "
        "cut off or damaged. Export or upload it again."
    )


def check_size(header: Header, size: int) -> None:
    """Raise `UnreadableError` when the header claims more rows than the body can hold."""
    for element in header.elements:
        if header.encoding == "ascii":
            least = max(2 * len(element.properties), 1)
        else:
            least = sum(np.dtype(prop.count_type or prop.type).itemsize for prop in element.properties)
        check_claim(element.count, f"rows of {element.name}", max(least, 1), size - header.size + 1)
