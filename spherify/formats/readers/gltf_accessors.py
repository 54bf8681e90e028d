"""Arrays of a glTF file: accessors over views of its one buffer, held against its size before they are read.

glTF 2.0 specification, sections 3.6 (accessors, views, strides, sparse) and 3.6.2.2 (normalised integers).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from spherify.formats.errors import TooLargeError, UnreadableError

_DTYPES: Final = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS: Final = {"SCALAR": 1, "VEC3": 3}


def item(items: object, index: object, what: str) -> Mapping[str, Any]:
    """Return one object of a list of the description; raises `UnreadableError` unless it is there."""
    if isinstance(items, list) and isinstance(index, int) and 0 <= index < len(items):
        found = items[index]
        if isinstance(found, dict):
            return found
    raise UnreadableError(f"The GLB names {what} {index!r}, which is not there. Export the mesh again.")


def natural(value: object, what: str) -> int:
    """Return a whole number of at least 0; raises `UnreadableError` for anything else."""
    if isinstance(value, int) and value >= 0:
        return value
    raise UnreadableError(f"The GLB gives {what} as {value!r}, which cannot be. Export the mesh again.")


class Accessors:
    """Reads accessors by number.

    Args:
        description: the JSON of the file.
        binary: its binary chunk.

    """

    def __init__(self, description: Mapping[str, Any], binary: bytes) -> None:
        self._description = description
        self._binary = binary

    def read(self, index: object, kind: str, most: int) -> NDArray[Any]:
        """Return an accessor of a kind ("SCALAR" or "VEC3") as (count, width), integers normalised if it says so.

        Raises:
            TooLargeError: it counts more than ``most`` items.
            UnreadableError: it is of another kind, or does not fit its buffer.

        """
        accessor = item(self._description.get("accessors"), index, "accessor")
        count = natural(accessor.get("count"), "the count of an accessor")
        if count > most:
            raise TooLargeError(
                f"A part of the mesh counts {count:,} items; at most {most:,} are taken. Decimate it."
            )
        if accessor.get("type") != kind or accessor.get("componentType") not in _DTYPES:
            raise UnreadableError(
                f"Accessor {index} is not of the type {kind} that its use asks for. Export again."
            )
        dtype = np.dtype(_DTYPES[accessor["componentType"]])
        width = _WIDTHS[kind]
        if "bufferView" in accessor:
            values = self._view(accessor["bufferView"], accessor.get("byteOffset", 0), count, dtype, width)
        else:
            values = np.zeros((count, width), dtype)
        if "sparse" in accessor:
            values = self._replaced(values, accessor["sparse"])
        return _normalised(values) if accessor.get("normalized") is True else values

    def _view(
        self, index: object, offset: object, count: int, dtype: np.dtype[Any], width: int
    ) -> NDArray[Any]:
        view = item(self._description.get("bufferViews"), index, "bufferView")
        if view.get("buffer") != 0 or self._elsewhere():
            raise UnreadableError(
                "The GLB keeps data outside its own binary part, where nothing is read. Export it with all data "
                "embedded."
            )
        start = natural(view.get("byteOffset", 0), "the offset of a view")
        length = natural(view.get("byteLength"), "the length of a view")
        within = natural(offset, "the offset of an accessor")
        row = width * dtype.itemsize
        stride = natural(view.get("byteStride", row), "a stride")
        needed = within + (count - 1) * stride + row if count else within
        if stride < row or needed > length or start + length > len(self._binary):
            raise UnreadableError(
                f"The GLB claims {count:,} items of {row} bytes in view {index}, which holds fewer: the file is cut "
                "off or damaged. Export or upload it again."
            )
        return np.ndarray(
            (count, width), dtype, self._binary, start + within, (stride, dtype.itemsize)
        ).copy()

    def _elsewhere(self) -> bool:
        """Whether the first buffer is another file, or text; only one without an address is the binary part."""
        buffers = self._description.get("buffers")
        first = buffers[0] if isinstance(buffers, list) and buffers else None
        return isinstance(first, dict) and first.get("uri") is not None

    def _replaced(self, values: NDArray[Any], sparse: Mapping[str, Any]) -> NDArray[Any]:
        """Return values with the few rows replaced that a sparse accessor lists."""
        count = natural(sparse.get("count"), "the count of a sparse accessor")
        where, what = sparse["indices"], sparse["values"]
        if count > len(values) or where.get("componentType") not in _DTYPES:
            raise UnreadableError(
                "A sparse accessor of the GLB replaces more than there is. Export the mesh again."
            )
        index_type = np.dtype(_DTYPES[where["componentType"]])
        rows = self._view(where["bufferView"], where.get("byteOffset", 0), count, index_type, 1)[:, 0]
        if index_type.kind != "u" or (count and rows.max() >= len(values)):
            raise UnreadableError(
                "A sparse accessor of the GLB replaces what is not there. Export the mesh again."
            )
        values[rows] = self._view(
            what["bufferView"], what.get("byteOffset", 0), count, values.dtype, values.shape[1]
        )
        return values


def _normalised(values: NDArray[Any]) -> NDArray[Any]:
    if values.dtype.kind == "f":
        return values
    return np.maximum(values.astype(np.float64) / np.iinfo(values.dtype).max, -1.0)


def matrix(node: Mapping[str, Any]) -> NDArray[np.float64]:
    """Return the 4 × 4 matrix of a node, from its ``matrix`` or its translation, rotation and scale (section 3.5.3)."""
    if "matrix" in node:
        return _vector(node["matrix"], 16).reshape(4, 4).T
    x, y, z, w = _vector(node.get("rotation", (0, 0, 0, 1)), 4)
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    result = np.eye(4)
    result[:3, :3] = rotation * _vector(node.get("scale", (1, 1, 1)), 3)
    result[:3, 3] = _vector(node.get("translation", (0, 0, 0)), 3)
    return result


def _vector(values: Sequence[float], length: int) -> NDArray[np.float64]:
    vector = np.array(values, dtype=np.float64)
    if vector.shape != (length,) or not np.isfinite(vector).all():
        raise UnreadableError("A node of the GLB is placed by numbers that cannot be. Export the mesh again.")
    return vector
