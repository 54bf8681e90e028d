"""The body of a binary PLY, in either byte order."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from spherify.formats.errors import UnreadableError
from spherify.formats.readers.ply_header import Element, Property
from spherify.formats.readers.ply_rows import cut_off, ranges
from spherify.geometry.mesh import Floats, Ints

_STRUCT_CODES: Final = {
    "i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "f4": "f", "f8": "d",
}  # fmt: skip


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
            raise cut_off(element, available)
        count = element.count if row.itemsize else 0
        values = np.frombuffer(self.data, row, count, self.at) if count else np.empty(0, row)
        self.at += row.itemsize * count
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
                raise cut_off(element, 0)
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
        """Read rows one after the other; the items are then gathered at once."""
        starts, sizes = self._walk(element, column)
        kind = np.dtype(self.order + element.properties[column].type)
        octets = np.frombuffer(self.data, np.uint8)[ranges(starts, sizes * kind.itemsize)]
        return sizes, octets.view(kind).astype(np.int64)

    def skip(self, element: Element) -> None:
        """See `Rows.skip`."""
        self._walk(element, -1)

    def _walk(self, element: Element, column: int) -> tuple[Ints, Ints]:
        """Pass over an element; return where the items of one list column begin in each row, and how many there are."""
        steps = [self._step(prop) for prop in element.properties]
        data, at = self.data, self.at
        starts, lengths = [], []
        for row in range(element.count):
            for place, (count_at, size) in enumerate(steps):
                if count_at is None:
                    at += size
                    continue
                if at + count_at.size > len(data):
                    raise cut_off(element, row)
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
                raise cut_off(element, row)
        self.at = at
        return np.array(starts, dtype=np.int64), np.array(lengths, dtype=np.int64)

    def _step(self, prop: Property) -> tuple[struct.Struct | None, int]:
        count_at = struct.Struct(self.order + _STRUCT_CODES[prop.count_type]) if prop.count_type else None
        return count_at, np.dtype(prop.type).itemsize
