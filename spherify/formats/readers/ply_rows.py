"""What both bodies of a PLY file, text and binary, have in common.

Both give the same: scalar columns as arrays, and one list column as lengths and items one after the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from spherify.formats.errors import UnreadableError
from spherify.formats.raw import check_claim
from spherify.formats.readers.ply_header import Element, Header
from spherify.geometry.mesh import Floats, Ints


class Rows(Protocol):
    """A source of elements, in the order of the header."""

    def scalars(self, element: Element, columns: Sequence[int]) -> Floats:
        """Consume an element without lists; return the columns asked for, (count, len(columns))."""
        ...

    def lists(self, element: Element, column: int) -> tuple[Ints, Ints]:
        """Consume an element; return the lengths and the items of one list column."""
        ...

    def skip(self, element: Element) -> None:
        """Consume an element."""
        ...


def ranges(starts: Ints, lengths: Ints) -> Ints:
    """Return start, start + 1, … for each pair, one after the other."""
    return np.repeat(starts - (np.cumsum(lengths) - lengths), lengths) + np.arange(int(lengths.sum()))


def cut_off(element: Element, there: int) -> UnreadableError:
    """Return the error for a file that ends after ``there`` rows of an element."""
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
