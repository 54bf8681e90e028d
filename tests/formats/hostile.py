"""Builders of small files made to cost much."""

from __future__ import annotations

import json
import struct
import zlib
from typing import Any

MIB = 1 << 20


def zip_bomb(head: bytes, unit: bytes, mebibytes: int) -> bytes:
    """Return a 3MF whose model is ``head`` and then ``unit`` over and over, this many MiB unpacked.

    One MiB is deflated once, ended with a full flush, and its packed bytes are repeated; the checksum is left wrong, as
    nobody should get so far as to look at it.
    """
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    first = packer.compress(head) + packer.flush(zlib.Z_FULL_FLUSH)
    block = (unit * (MIB // len(unit) + 1))[: MIB // len(unit) * len(unit)]
    again = packer.compress(block) + packer.flush(zlib.Z_FULL_FLUSH)
    packed = first + again * mebibytes + packer.flush()
    name = b"3D/3dmodel.model"
    sizes = (0, len(packed), len(head) + len(block) * mebibytes, len(name), 0)
    local = struct.pack("<4s5H3I2H", b"PK\x03\x04", 20, 0, 8, 0, 0x21, *sizes) + name + packed
    entry = struct.pack("<4s6H3I5H2I", b"PK\x01\x02", 20, 20, 0, 8, 0, 0x21, *sizes, 0, 0, 0, 0, 0) + name
    return local + entry + struct.pack("<4s4H2IH", b"PK\x05\x06", 0, 0, 1, 1, len(entry), len(local), 0)


MODEL_HEAD = (
    b'<?xml version="1.0"?><model xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>'
    b'<object id="1"><mesh><vertices>'
)
VERTEX = b'<vertex x="0" y="0" z="0"/>'
COMPONENTS_HEAD = MODEL_HEAD.replace(b"<mesh><vertices>", b"<components>")
COMPONENT = b'<component objectid="1" transform="1 0 0 0 1 0 0 0 1 0 0 0"/>'


def glb(description: dict[str, Any], binary: bytes = b"") -> bytes:
    """Return a GLB container."""
    text = json.dumps({"asset": {"version": "2.0"}, **description}).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(binary))
    return (
        head
        + struct.pack("<I4s", len(text), b"JSON")
        + text
        + struct.pack("<I4s", len(binary), b"BIN\0")
        + binary
    )


def glb_claiming(count: int) -> bytes:
    """Return a GLB with accessors that count items without a buffer behind them."""
    return glb(
        {
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
            "accessors": [
                {"componentType": 5126, "count": count, "type": "VEC3"},
                {"componentType": 5125, "count": 3 * count, "type": "SCALAR"},
            ],
        }
    )


def glb_of_primitives(number: int) -> bytes:
    """Return a GLB with many primitives of one triangle each."""
    return glb(
        {
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}] * number}],
            "accessors": [{"componentType": 5126, "count": 3, "type": "VEC3", "bufferView": 0}],
            "bufferViews": [{"buffer": 0, "byteLength": 36}],
            "buffers": [{"byteLength": 36}],
        },
        struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0),
    )


def glb_of_nodes(number: int) -> bytes:
    """Return a GLB of one triangle at the end of a chain of very many nodes that hold nothing."""
    return glb(
        {
            "scenes": [{"nodes": [0]}],
            "nodes": [*({"children": [n]} for n in range(1, number)), {"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
            "accessors": [{"componentType": 5126, "count": 3, "type": "VEC3"}],
        }
    )


def glb_of_points(nodes: int, primitives: int) -> bytes:
    """Return a GLB whose many nodes all show one mesh of many points."""
    return glb({"nodes": [{"mesh": 0}] * nodes, "meshes": [{"primitives": [{"mode": 0}] * primitives}]})


def glb_sharing(number: int, count: int) -> bytes:
    """Return a GLB whose many primitives all count the same many vertices, so that a copy for each adds up."""
    return glb(
        {
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}] * number}],
            "accessors": [
                {"componentType": 5126, "count": count, "type": "VEC3"},
                {"componentType": 5125, "count": 3, "type": "SCALAR"},
            ],
        }
    )


def obj_of_materials(number: int) -> bytes:
    """Return an OBJ tetrahedron among very many materials."""
    points = b"v 1 1 1\nv 1 -1 -1\nv -1 1 -1\nv -1 -1 1\n"
    uses = b"".join(b"usemtl m%d\nf 1 2 3\n" % n for n in range(number))
    return b"mtllib x.mtl\n" + points + uses


def obj_of_one_polygon(corners: int) -> bytes:
    """Return an OBJ with a single face of very many corners."""
    return b"v 0 0 0\n" * 9 + b"f" + b" 1 2 3 4 5 6 7 8 9" * (corners // 9) + b"\n"


def ply_of_one_polygon(corners: int) -> bytes:
    """Return a binary PLY with a single face of very many corners."""
    head = (
        b"ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
        b"property float z\nelement face 1\nproperty list uint uchar vertex_indices\nend_header\n"
    )
    return head + bytes(12) + struct.pack("<I", corners) + bytes(corners)


def ply_claiming(encoding: str, count: int) -> bytes:
    """Return a PLY header that claims very many vertices and faces, and nothing behind it."""
    return (
        f"ply\nformat {encoding} 1.0\nelement vertex {count}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {count}\nproperty list uchar int vertex_indices\nend_header\n"
    ).encode()
