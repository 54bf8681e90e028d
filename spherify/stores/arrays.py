"""Named arrays as one file: an ``.npz`` with the same bytes every time, and a checksum inside.

`numpy.load` reads it like any other. What differs: members in the given order, no time stamps, no compression
(positions do not compress, and zlib's versions differ in their bytes), never a pickle, and a last member
``sha256`` over the names and bytes of all others.
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

CHECKSUM: Final = "sha256"


def dump_arrays(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Return the file that holds these arrays.

    Raises:
        ValueError: an array of Python objects, or the reserved name ``sha256``.

    """
    if CHECKSUM in arrays:
        raise ValueError(f"{CHECKSUM} is the name of the checksum")
    digest = hashlib.sha256()
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name, array in arrays.items():
            member = _member(array)
            _feed(digest, name, member)
            _put(archive, name, member)
        _put(archive, CHECKSUM, _member(np.array(digest.hexdigest().encode())))
    return buffer.getvalue()


def load_arrays(source: bytes | BinaryIO) -> dict[str, NDArray[Any]]:
    """Return the arrays of a file, once its checksum has been verified.

    Raises:
        DamagedBlobError: it is cut off, altered, or something else altogether.

    """
    stream = io.BytesIO(source) if isinstance(source, bytes) else source
    try:
        with zipfile.ZipFile(stream) as archive:
            members = {
                info.filename.removesuffix(".npy"): _bytes(archive, info) for info in archive.infolist()
            }
        stated = _array(members.pop(CHECKSUM)).item()
        digest = hashlib.sha256()
        for name, member in members.items():
            _feed(digest, name, member)
        if digest.hexdigest().encode() != stated:
            raise DamagedBlobError("the checksum does not fit")
        return {name: _array(member) for name, member in members.items()}
    # what zipfile and numpy raise on bytes that are not theirs is not documented; these have been seen
    except (
        zipfile.BadZipFile,
        ValueError,
        KeyError,
        EOFError,
        NotImplementedError,
        OSError,
        SyntaxError,
    ) as e:
        raise DamagedBlobError(f"these are no intact arrays: {e}") from e


def _member(array: NDArray[Any]) -> bytes:
    buffer = io.BytesIO()
    np.lib.format.write_array(
        buffer, np.ascontiguousarray(array) if array.ndim else array, allow_pickle=False
    )
    return buffer.getvalue()


def _array(member: bytes) -> NDArray[Any]:
    array: NDArray[Any] = np.lib.format.read_array(io.BytesIO(member), allow_pickle=False)
    array.setflags(write=False)
    return array


def _put(archive: zipfile.ZipFile, name: str, member: bytes) -> None:
    archive.writestr(zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0)), member)


def _bytes(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> bytes:
    if info.compress_type != zipfile.ZIP_STORED:
        raise DamagedBlobError("a compressed member: not one of our files")
    return archive.read(info)


def _feed(digest: Any, name: str, member: bytes) -> None:  # noqa: ANN401 (hashlib names no public type)
    digest.update(f"{name}\0{len(member)}\0".encode())
    digest.update(member)
