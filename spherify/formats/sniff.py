"""Which format a file is in: told by its content, and held against its name."""

from __future__ import annotations

import re
from typing import Final

from spherify.formats.errors import UnreadableError
from spherify.formats.names import FORMATS_IN, extension
from spherify.formats.readers.off import HEADER as OFF_HEADER
from spherify.formats.readers.stl import is_binary
from spherify.formats.text import UTF8_BOM, UTF16_BOMS, shown

_LIST: Final = ", ".join(FORMATS_IN).upper()
_PLY: Final = re.compile(rb"ply\s")
_STL: Final = re.compile(rb"solid\b", re.IGNORECASE)
_COMMENT: Final = re.compile(rb"(?:\s+|#[^\r\n]*)*")
_OBJ: Final = re.compile(
    rb"(?:v[ \t]+[-+.\d]|v[nt][ \t]|f[ \t]+[-\d]|(?:o|g|s|mtllib|usemtl|l|p|vp|mg|lod)(?:[ \t]|[\r\n]))"
)


def content_format(data: bytes) -> str | None:
    """Return the format whose signs the content bears, None if it bears none."""
    if data.startswith(b"glTF"):
        return "glb"
    if data.startswith(b"PK\x03\x04"):
        return "3mf"  # its reader looks for the model inside
    text = data.removeprefix(UTF8_BOM)
    if _PLY.match(text):
        return "ply"
    if is_binary(data):
        return "stl"
    start = _COMMENT.match(text)
    at = start.end() if start else 0
    if OFF_HEADER.match(text, at):
        return "off"
    if _STL.match(text, at):
        return "stl"
    if _OBJ.match(text, at):
        return "obj"
    return None


def agreed_format(data: bytes, name: str) -> str:
    """Return the format to read, in which content and name agree.

    A name with no extension, or with one we do not know, has no say.

    Raises:
        UnreadableError: ``unsupported-mesh-format`` if the content bears the signs of no format and the name does
            not help, or of another format than the name says; ``mesh-not-parsable`` if the name says what it is
            and the content is nothing we know.
    """
    if not data:
        raise UnreadableError("The file is empty. Export or upload it again.")
    if data.startswith(UTF16_BOMS):
        raise UnreadableError("The text is UTF-16. Save it as UTF-8 or plain ASCII.")
    named = extension(name) if extension(name) in FORMATS_IN else None
    found = content_format(data)
    if found is None and named == "stl" and b"\0" in data[:4096]:
        return "stl"  # binary STL has no sign but its size, so this one is cut off: its reader says where
    if found is None and named is not None:
        raise UnreadableError(
            f"The file is named .{named}, but its content is not {named.upper()}: it starts with {_start(data)}. "
            f"Export it again as one of {_LIST}."
        )
    if found is None:
        raise UnreadableError(
            f"The content is in no format that is read here: it starts with {_start(data)}. Use one of {_LIST}.",
            "unsupported-mesh-format",
        )
    if named is not None and named != found:
        raise UnreadableError(
            f"The file is named .{named}, but its content is {found.upper()}. Name it .{found}, or export it as "
            f"{named.upper()}.",
            "unsupported-mesh-format",
        )
    return found


def _start(data: bytes) -> str:
    return shown(data.lstrip()[:24] or data[:24])
