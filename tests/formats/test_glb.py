from __future__ import annotations

import copy
import json
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from spherify.formats.errors import TooLargeError, UnreadableError
from spherify.formats.limits import ReadLimits
from spherify.formats.readers.glb import read_glb
from tests.formats.shapes import CUBE_CORNERS, CUBE_FACES, LIMITS

BINARY = CUBE_CORNERS.astype("<f4").tobytes() + CUBE_FACES.astype("<u4").tobytes()
DESCRIPTION = {
    "asset": {"version": "2.0"},
    "scene": 0,
    "scenes": [{"nodes": [0]}],
    "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    "accessors": [
        {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1]},
        {"bufferView": 1, "componentType": 5125, "count": 36, "type": "SCALAR"},
    ],
    "bufferViews": [
        {"buffer": 0, "byteOffset": 0, "byteLength": 96},
        {"buffer": 0, "byteOffset": 96, "byteLength": 144},
    ],
    "buffers": [{"byteLength": 240}],
}  # fmt: skip


def container(description: object, binary: bytes = BINARY) -> bytes:
    text = json.dumps(description).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(binary))
    return (
        head
        + struct.pack("<I4s", len(text), b"JSON")
        + text
        + struct.pack("<I4s", len(binary), b"BIN\0")
        + binary
    )


CUBE = container(DESCRIPTION)


def changed(change: Callable[[Any], object], binary: bytes = BINARY) -> bytes:
    description = copy.deepcopy(DESCRIPTION)
    change(description)
    return container(description, binary)


def test_nodes_are_placed_one_in_another():
    quarter_turn = [0, 0, np.sqrt(0.5), np.sqrt(0.5)]  # about z
    data = changed(
        lambda d: d.update(
            nodes=[
                {"children": [1, 2], "translation": [10, 0, 0]},
                {"mesh": 0, "rotation": quarter_turn, "scale": [2, 2, 2]},
                {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1]},
            ]
        )
    )
    raw = read_glb(data, LIMITS)
    x, y, z = (2 * CUBE_CORNERS).T
    np.testing.assert_allclose(raw.vertices[:8], np.stack([10 - y, x, z], 1), atol=1e-12)
    np.testing.assert_allclose(raw.vertices[8:], CUBE_CORNERS + np.array([10, 0, 5]))
    assert np.array_equal(raw.faces, np.concatenate([CUBE_FACES, CUBE_FACES + 8]))


def test_a_mirror_keeps_the_outside_out():
    raw = read_glb(changed(lambda d: d["nodes"][0].update(scale=[-1, 1, 1])), LIMITS)
    assert np.array_equal(raw.faces, CUBE_FACES[:, ::-1])


def test_without_scenes_every_root_is_shown():
    raw = read_glb(
        changed(lambda d: (d.pop("scenes"), d.pop("scene"), d["nodes"].append({"mesh": 0}))), LIMITS
    )
    assert len(raw.vertices) == 16


def test_materials_textures_and_points_are_passed_over():
    def change(d: Any) -> None:
        d["materials"] = [{"name": str(n)} for n in range(5)]
        d["images"] = [{"uri": "file:///etc/passwd"}]
        primitives = d["meshes"][0]["primitives"]
        primitives[0]["material"] = 99
        primitives.append({"attributes": {"POSITION": 0}, "mode": 0})

    assert np.array_equal(read_glb(changed(change), LIMITS).faces, CUBE_FACES)


@pytest.mark.parametrize(
    ("mode", "faces"), [(5, [[0, 2, 3], [3, 2, 1], [3, 1, 0]]), (6, [[0, 2, 3], [0, 3, 1], [0, 1, 0]])]
)
def test_strips_and_fans(mode: int, faces: list[list[int]]):
    def change(d: Any) -> None:
        d["meshes"][0]["primitives"][0]["mode"] = mode
        d["accessors"][1].update(count=5)

    corners = np.array([0, 2, 3, 1, 0], "<u4").tobytes()
    if mode == 5:
        faces = [[0, 2, 3], [3, 2, 1], [3, 1, 0]]
    raw = read_glb(changed(change, BINARY[:96] + corners.ljust(len(BINARY) - 96, b"\0")), LIMITS)
    assert raw.faces.tolist() == faces


def test_without_indices_each_three_corners_are_a_triangle():
    def change(d: Any) -> None:
        d["meshes"][0]["primitives"][0].pop("indices")
        d["accessors"][0]["count"] = 6

    assert read_glb(changed(change), LIMITS).faces.tolist() == [[0, 1, 2], [3, 4, 5]]


def test_strided_sparse_and_normalised_positions():
    rows = np.zeros(8, np.dtype([("p", "<i2", 3), ("pad", "<i2")]))
    rows["p"] = CUBE_CORNERS * 32767
    binary = rows.tobytes() + BINARY[96:] + np.array([7, 0], "<u1").tobytes() + bytes(2)
    binary += np.array([[-32767, 0, 0], [0, 0, 16384]], "<i2").tobytes()

    def change(d: Any) -> None:
        views = d["bufferViews"]
        views[0].update(byteLength=64, byteStride=8)
        views[1].update(byteOffset=64)
        views.append({"buffer": 0, "byteOffset": 208, "byteLength": 2})
        views.append({"buffer": 0, "byteOffset": 212, "byteLength": 12})
        d["accessors"][0].update(
            componentType=5122,
            normalized=True,
            sparse={
                "count": 2,
                "indices": {"bufferView": 2, "componentType": 5121},
                "values": {"bufferView": 3},
            },
        )

    expected = CUBE_CORNERS.copy()
    expected[[7, 0]] = [[-1, 0, 0], [0, 0, 16384 / 32767]]
    assert np.array_equal(read_glb(changed(change, binary), LIMITS).vertices, expected)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"glTF", "ends inside its header"),
        (b"glTF\x01" + CUBE[5:], "version 1; only version 2"),
        (CUBE[:-4], "is cut off or damaged"),
        (CUBE.replace(b'"asset"', b"'asset'"), "JSON description of the GLB cannot be read"),
        (container([1]), "is no object"),
        (container("[" * 100 + "]" * 100), "is no object"),
        (
            changed(lambda d: d.update(extensionsRequired=["KHR_draco_mesh_compression"])),
            "without compression",
        ),
        (changed(lambda d: d["bufferViews"][0].update(buffer=1)), "outside its own binary part"),
        (changed(lambda d: d["buffers"][0].update(uri="cube.bin")), "outside its own binary part"),
        (changed(lambda d: d["buffers"][0].update(uri="cube.bin"), b""), "outside its own binary part"),
        (
            changed(lambda d: d["bufferViews"][0].update(byteLength=95)),
            "claims 8 items of 12 bytes in view 0",
        ),
        (changed(lambda d: d["bufferViews"][1].update(byteOffset=10**9)), "holds fewer"),
        (changed(lambda d: d["bufferViews"][1].update(byteOffset=-4)), "offset of a view as -4"),
        (changed(lambda d: d["bufferViews"][0].update(byteStride=4)), "holds fewer"),
        (changed(lambda d: d["accessors"][0].update(count="8")), "count of an accessor as '8'"),
        (changed(lambda d: d["accessors"][0].update(type="VEC2")), "not of the type VEC3"),
        (changed(lambda d: d["accessors"][1].update(count=35)), "not 3 a triangle"),
        (changed(lambda d: d["scenes"][0].update(nodes=[-1])), "names node -1"),
        (changed(lambda d: d["nodes"][0].update(mesh=3)), "names mesh 3"),
        (changed(lambda d: d["nodes"][0].update(children=[0])), "hangs in two places"),
        (changed(lambda d: d["nodes"][0].update(scale=[1, 2])), "placed by numbers that cannot be"),
        (changed(lambda d: d["nodes"][0].update(matrix="x")), "not as glTF 2.0 has it"),
        (changed(lambda d: d["meshes"][0].pop("primitives")), "not as glTF 2.0 has it"),
        (changed(lambda d: d.update(nodes=7)), "names node 0"),
        (CUBE[:-4] + b"\x08\0\0\0", "names a vertex outside 0 … 7"),
    ],
)
def test_what_is_damaged_is_refused(data: bytes, words: str):
    with pytest.raises(UnreadableError) as refusal:
        read_glb(data, LIMITS)
    assert words in str(refusal.value)


def test_a_description_nested_too_deep_is_refused():
    text = b"[" * 200_000
    head = struct.pack("<4sII", b"glTF", 2, 20 + len(text)) + struct.pack("<I4s", len(text), b"JSON")
    with pytest.raises(UnreadableError, match="cannot be read"):
        read_glb(head + text, LIMITS)


def test_counts_are_capped_before_anything_is_allocated():
    def claim(d: Any) -> None:
        d["accessors"][0].update(count=2 * 10**8)
        d["accessors"][0].pop("bufferView")

    with pytest.raises(TooLargeError, match="200,000,000"):
        read_glb(changed(claim), LIMITS)
    with pytest.raises(TooLargeError, match="36 items; at most 33"):
        read_glb(CUBE, ReadLimits(max_faces=11))
    with pytest.raises(TooLargeError, match="more than 3 parts"):
        read_glb(changed(lambda d: d["meshes"][0].update(primitives=d["meshes"][0]["primitives"] * 4)),
                 ReadLimits(max_primitives=3))  # fmt: skip
