"""Which format a file is in: told by its content, and held against its name."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Final

from spherify.formats.errors import UnreadableError
from spherify.formats.names import FORMATS_IN, extension
from spherify.formats.readers.off import HEADER as OFF_HEADER
from spherify.formats.readers.stl import is_binary
from spherify.formats.text import UTF8_BOM, UTF16_BOMS, shown

_LIST: Final = ", ".join(FORMATS_IN).upper()
_MODEL_PART: Final = re.compile(rb"\.model", re.IGNORECASE)
_PLY: Final = re.compile(rb"ply\s")
_STL: Final = re.compile(rb"solid\b", re.IGNORECASE)
_COMMENT: Final = re.compile(rb"(?:\s+|#[^\r\n]*)*")
_OBJ: Final = re.compile(
    rb"(?:v[ \t]+[-+.\d]|v[nt][ \t]|f[ \t]+[-\d]|(?:o|g|s|mtllib|usemtl|l|p|vp|mg|lod)(?:[ \t]|[\r\n]))"
)


def content_format(data: bytes) -> str | None:
    """Return the format whose signs the content bears, None if it bears none."""
    return next((mesh_format for mesh_format, sign in _SIGNS if sign(data)), None)


def _begins(pattern: re.Pattern[bytes]) -> Callable[[bytes], bool]:
    """Return a test whether a text begins with a pattern, comments and blank lines put aside."""

    def test(data: bytes) -> bool:
        start = _COMMENT.match(data, len(UTF8_BOM) if data.startswith(UTF8_BOM) else 0)
        return start is not None and pattern.match(data, start.end()) is not None

    return test


_SIGNS: Final[tuple[tuple[str, Callable[[bytes], bool]], ...]] = (
    ("glb", lambda data: data.startswith(b"glTF")),
    # The names of the parts stand unpacked in the archive's directory.
    ("3mf", lambda data: data.startswith(b"PK\x03\x04") and _MODEL_PART.search(data) is not None),
    ("ply", lambda data: _PLY.match(data.removeprefix(UTF8_BOM)) is not None),
    ("stl", is_binary),  # before the texts: a binary STL may begin with any word
    ("off", _begins(OFF_HEADER)),
    ("stl", _begins(_STL)),
    ("obj", _begins(_OBJ)),
)


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
    check_name(name, found)
    return found


def check_name(name: str, mesh_format: str) -> None:
    """Raise `UnreadableError`, ``unsupported-mesh-format``, if a name says another format than the content has."""
    named = extension(name)
    if named in FORMATS_IN and named != mesh_format:
        raise UnreadableError(
            f"The file is named .{named}, but its content is {mesh_format.upper()}. Name it .{mesh_format}, or export "
            f"it as {named.upper()}.",
            "unsupported-mesh-format",
        )


def _start(data: bytes) -> str:
    return shown(data.lstrip()[:24] or data[:24])
