"""The header of a PLY file: which elements follow, and how each row of them is laid out."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final, Literal

from spherify.formats.errors import UnreadableError
from spherify.formats.text import shown

Encoding = Literal["ascii", "<", ">"]

_ENCODINGS: Final[dict[bytes, Encoding]] = {
    b"ascii": "ascii",
    b"binary_little_endian": "<",
    b"binary_big_endian": ">",
}
_TYPES: Final = {
    name: code
    for code, names in {
        "i1": (b"char", b"int8"),
        "u1": (b"uchar", b"uint8"),
        "i2": (b"short", b"int16"),
        "u2": (b"ushort", b"uint16"),
        "i4": (b"int", b"int32"),
        "u4": (b"uint", b"uint32"),
        "f4": (b"float", b"float32"),
        "f8": (b"double", b"float64"),
    }.items()
    for name in names
}
_END: Final = re.compile(rb"(?:^|[\r\n])end_header[ \t]*(\r\n|\n|\r|$)")
_COUNT_DIGITS = 18


@dataclass(frozen=True, slots=True)
class Property:
    """One column: a scalar of ``type`` (numpy's code without byte order), or a list with a ``count_type``."""

    name: str
    type: str
    count_type: str | None = None


@dataclass(frozen=True, slots=True)
class Element:
    """``count`` rows of the same properties."""

    name: str
    count: int
    properties: tuple[Property, ...]

    @property
    def has_lists(self) -> bool:
        """Whether rows differ in length."""
        return any(prop.count_type for prop in self.properties)

    def column(self, *names: str) -> int | None:
        """Return the place of the first property with one of the names, None if there is none."""
        return next((place for place, prop in enumerate(self.properties) if prop.name in names), None)


@dataclass(frozen=True, slots=True)
class Header:
    """What a PLY file says of itself; ``size`` is the number of bytes before its body, ``lines`` that of lines."""

    encoding: Encoding
    elements: tuple[Element, ...]
    size: int
    lines: int


def parse_header(data: bytes) -> Header:
    """Read the header; raises `UnreadableError` naming the line."""
    end = _END.search(data)
    if end is None:
        raise UnreadableError(
            "The PLY header has no end_header: the file is cut off. Export or upload it again."
        )
    lines = re.split(rb"\r\n|\n|\r", data[: end.start() + 1].rstrip())
    encoding: Encoding | None = None
    elements: list[tuple[str, int, list[Property]]] = []
    for number, line in enumerate(lines, 1):
        match line.split():
            case [b"ply"] | [] | [b"comment" | b"obj_info", *_]:
                pass
            case [b"format", kind, _] if kind in _ENCODINGS:
                encoding = _ENCODINGS[kind]
            case [b"element", name, count] if count.isdigit() and len(count) <= _COUNT_DIGITS:
                elements.append((name.decode("latin-1"), int(count), []))
            case [b"property", b"list", count_type, item, name] if (
                elements and item in _TYPES and _TYPES.get(count_type, "f")[0] in "iu"
            ):
                elements[-1][2].append(Property(name.decode("latin-1"), _TYPES[item], _TYPES[count_type]))
            case [b"property", kind, name] if elements and kind in _TYPES:
                elements[-1][2].append(Property(name.decode("latin-1"), _TYPES[kind]))
            case _:
                raise UnreadableError(
                    f"Line {number} of the PLY header, {shown(line)}, means nothing. Export again."
                )
    if encoding is None:
        raise UnreadableError("The PLY header has no format line. Export the mesh again.")
    body = tuple(Element(name, count, tuple(properties)) for name, count, properties in elements)
    return Header(encoding, body, end.end(), len(lines) + 1)
