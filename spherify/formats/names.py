"""Formats, their media types, and file names that are safe to hand out."""

from __future__ import annotations

import re
import unicodedata
from pathlib import PurePosixPath
from typing import Final

from spherify.formats.errors import InvalidExportError

FORMATS_IN: Final = ("obj", "ply", "stl", "off", "glb", "3mf")
FORMATS_OUT: Final = ("obj", "ply", "stl", "off", "glb")

_MEDIA_TYPES: Final = {
    "obj": "model/obj",  # IANA
    "ply": "application/ply",  # what Blender and the Stanford pages say; none is registered
    "stl": "model/stl",  # IANA
    "off": "text/plain",  # none is registered
    "glb": "model/gltf-binary",  # IANA
    "3mf": "model/3mf",  # IANA
}
_MAX_NAME = 120  # characters; file systems take 255 bytes, and a suffix is still to come


def media_type(mesh_format: str) -> str:
    """Return the media type of one of `FORMATS_IN`; raises `InvalidExportError` for any other."""
    try:
        return _MEDIA_TYPES[mesh_format]
    except KeyError:
        raise InvalidExportError(
            f"there is no mesh format {mesh_format!r}; choose one of {', '.join(FORMATS_IN)}"
        ) from None


def extension(name: str) -> str:
    """Return the lower-case extension of a file name without its dot, "" if it has none."""
    return PurePosixPath(name.replace("\\", "/")).suffix[1:].lower()


def safe_name(name: str, default: str = "mesh") -> str:
    """Return the last part of a path with nothing in it that a shell, header or file system trips over.

    Letters and digits of any script, and ``. _ - ( ) +`` and blanks stay; other characters become ``_``; leading
    dots go; at most 120 characters, the extension kept. A name of which only ``_`` would be left is ``default``.
    """
    last = unicodedata.normalize("NFC", name).replace("\\", "/").rsplit("/", 1)[-1]
    clean = re.sub(r"[^\w.()+ -]", "_", last).strip(" ").lstrip(".")
    path = PurePosixPath(clean or default)
    suffix = path.suffix[:16]
    stem = path.name[: len(path.name) - len(path.suffix)] if path.suffix else path.name
    if not stem.strip("_"):
        stem = default
    return stem[: _MAX_NAME - len(suffix)] + suffix


def safe_stem(name: str, default: str = "mesh") -> str:
    """Return `safe_name` without its extension."""
    clean = safe_name(name, default)
    stem, dot, _ = clean.rpartition(".")
    return stem if dot and stem else clean
