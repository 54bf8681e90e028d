"""Named arrays as one file: an ``.npz`` with the same bytes every time, and a checksum at its end.

`numpy.load` reads it like any other. What differs: members in the given order, row by row, no time stamps, no
compression (positions do not compress, and zlib's versions differ in their bytes), never a pickle; and the comment
that ends a zip file is the SHA-256, in hexadecimal, of everything before it. It is verified before anything is parsed.
"""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Mapping
from typing import Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from spherify.jobs.errors import DamagedBlobError

_DIGITS: Final = 64


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
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return {name.removesuffix(".npy"): _array(archive.read(name)) for name in archive.namelist()}


def _checksum(content: bytes) -> bytes:
    return hashlib.sha256(content).hexdigest().encode()


def _array(member: bytes) -> NDArray[Any]:
    array: NDArray[Any] = np.lib.format.read_array(io.BytesIO(member), allow_pickle=False)
    array.setflags(write=False)
    return array
