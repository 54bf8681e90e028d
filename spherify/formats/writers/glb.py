"""GLB 2.0: one mesh of one primitive, float32 positions and 32-bit indices.

Layout after the glTF 2.0 specification, sections 3.6 and 4: a JSON chunk padded with blanks, a binary chunk padded with
zeros, both to 4 bytes.
"""

from __future__ import annotations

import json
import struct
from typing import Any, Literal

import numpy as np

from spherify.geometry.mesh import TriangleMesh

_FLOAT, _UNSIGNED_INT = 5126, 5125  # componentType
_ARRAY, _ELEMENT_ARRAY = 34962, 34963  # bufferView.target
_TRIANGLES = 4  # primitive.mode


def glb(mesh: TriangleMesh, precision: Literal["double", "float"]) -> bytes:  # float32 always
    """Return GLB with the true bounds of the positions as they were rounded."""
    positions = mesh.vertices.astype("<f4")
    indices = mesh.faces.astype("<u4")
    binary = positions.tobytes() + indices.tobytes()  # multiples of 4 bytes both
    description = json.dumps(_description(positions, indices), separators=(",", ":")).encode("ascii")
    description += b" " * (-len(description) % 4)
    total = 12 + 8 + len(description) + 8 + len(binary)
    return b"".join(
        [
            struct.pack("<4sII", b"glTF", 2, total),
            struct.pack("<I4s", len(description), b"JSON"),
            description,
            struct.pack("<I4s", len(binary), b"BIN\0"),
            binary,
        ]
    )


def _description(positions: np.ndarray, indices: np.ndarray) -> dict[str, Any]:
    return {
        "asset": {"version": "2.0", "generator": "Spherify"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": _TRIANGLES}]}],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": _FLOAT,
                "count": len(positions),
                "type": "VEC3",
                "min": positions.min(axis=0).astype(float).tolist(),
                "max": positions.max(axis=0).astype(float).tolist(),
            },
            {"bufferView": 1, "componentType": _UNSIGNED_INT, "count": indices.size, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": positions.nbytes, "target": _ARRAY},
            {
                "buffer": 0,
                "byteOffset": positions.nbytes,
                "byteLength": indices.nbytes,
                "target": _ELEMENT_ARRAY,
            },
        ],
        "buffers": [{"byteLength": positions.nbytes + indices.nbytes}],
    }
