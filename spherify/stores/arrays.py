"""Named arrays as one file: an ``.npz`` with the same bytes every time, and a checksum at its end.

`numpy.load` reads it like any other. What differs: members in the given order, row by row, no time stamps, no
compression (positions do not compress, and zlib's versions differ in their bytes), never a pickle; and the comment
that ends a zip file is the SHA-256, in hexadecimal, of everything before it. It is verified before anything is parsed.
"""

from __future__ import annotations

import hashlib
import io
import os
import re
import struct
import zipfile
import zlib
from collections.abc import Collection, Mapping
from typing import Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from spherify.jobs.errors import DamagedBlobError

_DIGITS: Final = 64
_HEADER: Final = 30  # bytes before the name of a member
_END: Final = 16 * 1024  # bytes at the end of a file that hold the directory of a few dozen arrays
_HEXADECIMAL: Final = re.compile(rb"[0-9a-f]{64}")
_OF_ANOTHER_FORM: Final = (
    zipfile.BadZipFile, zlib.error, struct.error, NotImplementedError, ValueError, EOFError, LookupError
)  # fmt: skip
"""What the readers of zip files and of arrays raise."""


def dump_arrays(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Return the file that holds these arrays.

    Raises:
        ValueError: an array of Python objects.

    """
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name, array in arrays.items():
            member = io.BytesIO()
            np.lib.format.write_array(member, np.asarray(array, order="C"), allow_pickle=False)
            info = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
            archive.writestr(info, member.getvalue())
        archive.comment = b"0" * _DIGITS
    content = buffer.getvalue()[:-_DIGITS]
    return content + _checksum(content)


def load_arrays(source: bytes | BinaryIO) -> dict[str, NDArray[Any]]:
    """Return the arrays of a file, read-only.

    Raises:
        DamagedBlobError: it is cut off, altered, or something else altogether.

    """
    content = source if isinstance(source, bytes) else source.read()
    if content[-_DIGITS:] != _checksum(content[:-_DIGITS]):
        raise DamagedBlobError("these are no intact arrays: the checksum at the end does not fit")
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            return {name.removesuffix(".npy"): _array(archive.read(name)) for name in archive.namelist()}
    except _OF_ANOTHER_FORM as e:
        raise DamagedBlobError(f"these are no arrays: {e!r}") from e


def glance_at_arrays(
    source: BinaryIO, wanted: Collection[str]
) -> tuple[str, frozenset[str], dict[str, NDArray[Any]]]:
    """Return the checksum at the end of a file, the names of its arrays, and those that are wanted and there.

    Nothing else is read, and what is read is checked by its CRC-32: that the rest is intact too is verified by whoever
    reads it, with `load_arrays`.

    Args:
        source: seekable.
        wanted: names of arrays.

    Raises:
        DamagedBlobError: it is cut off, what is wanted is altered, or it is something else altogether.

    """
    size = source.seek(0, os.SEEK_END)
    end = _read_at(
        source, max(size - _END, 0), _END
    )  # with the directory, at once: each read may be a request
    try:
        with zipfile.ZipFile(
            io.BytesIO(end)
        ) as archive:  # which counts from the first byte of what it is given
            members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
        if not _HEXADECIMAL.fullmatch(archive.comment):
            raise DamagedBlobError("there is no checksum at the end")
        before = size - len(end)
        if min((info.header_offset for info in members.values()), default=-before) != -before:
            raise DamagedBlobError("a part is missing")
        found = {
            name: _array(_member(source, members[name], before, end)) for name in wanted if name in members
        }
    except _OF_ANOTHER_FORM as e:
        raise DamagedBlobError(f"these are no arrays: {e!r}") from e
    return archive.comment.decode(), frozenset(members), found


def _member(source: BinaryIO, info: zipfile.ZipInfo, before: int, end: bytes) -> bytes:
    """Return one array's bytes, checked; `before` is how many come before the ones at the end, which are known."""
    extent = _HEADER + len(info.filename.encode()) + info.file_size  # stored as they are, see `dump_arrays`
    place = info.header_offset
    piece = end[place : place + extent] if place >= 0 else _read_at(source, place + before, extent)
    content = piece[extent - info.file_size :]
    if zlib.crc32(content) != info.CRC:
        raise DamagedBlobError(f"{info.filename} is not what was written")
    return content


def _read_at(source: BinaryIO, place: int, length: int) -> bytes:
    source.seek(place)
    return source.read(length)


def checksum_of(content: bytes) -> str:
    """Return the checksum that an intact file ends with: of the states of a run, it names one."""
    return content[-_DIGITS:].decode("ascii")


def _checksum(content: bytes) -> bytes:
    return hashlib.sha256(content).hexdigest().encode()


def _array(member: bytes) -> NDArray[Any]:
    array: NDArray[Any] = np.lib.format.read_array(io.BytesIO(member), allow_pickle=False)
    array.setflags(write=False)
    return array
