from __future__ import annotations

import io
import zipfile

import numpy as np
import pytest

from spherify.formats.errors import TooLargeError, UnreadableError
from spherify.formats.limits import ReadLimits
from spherify.formats.readers.threemf import read_3mf
from tests.formats.shapes import CUBE_CORNERS, CUBE_FACES, LIMITS

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"
RELATIONS = (
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
    '<Relationship Target="/3D/{}" Id="r" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>'
    "</Relationships>"
)
MESH = (
    "<mesh><vertices>"
    + "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in CUBE_CORNERS.tolist())
    + "</vertices><triangles>"
    + "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in CUBE_FACES.tolist())
    + "</triangles></mesh>"
)
CUBE_OBJECT = f'<object id="1" type="model">{MESH}</object>'


def model(resources: str = CUBE_OBJECT, build: str = '<item objectid="1"/>', prolog: str = "") -> str:
    return (
        f'<?xml version="1.0"?>{prolog}<model unit="millimeter" xmlns="{CORE}" xmlns:p="{PRODUCTION}">'
        f"<resources>{resources}</resources><build>{build}</build></model>"
    )


def package(root: str | None = None, name: str = "3dmodel.model", **parts: str) -> bytes:
    """Return a 3MF archive; further parts by name."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("_rels/.rels", RELATIONS.format(name))
        archive.writestr(f"3D/{name}", model() if root is None else root)
        for part, content in parts.items():
            archive.writestr(f"3D/{part}.model", content)
    return file.getvalue()


def test_the_root_is_found_by_its_relation_and_by_its_usual_name():
    assert np.array_equal(read_3mf(package(name="other.model"), LIMITS).vertices, CUBE_CORNERS)
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("3D/3DModel.model", model())
    assert np.array_equal(read_3mf(file.getvalue(), LIMITS).faces, CUBE_FACES)


def test_transforms_act_on_rows_and_mirrors_keep_the_outside_out():
    transform = "-2 0 0 0 3 0 0 0 4 10 20 30"
    raw = read_3mf(package(model(build=f'<item objectid="1" transform="{transform}"/>')), LIMITS)
    assert np.array_equal(raw.vertices, CUBE_CORNERS * [-2, 3, 4] + [10, 20, 30])
    assert np.array_equal(raw.faces, CUBE_FACES[:, ::-1])


def test_components_are_placed_one_in_another():
    parts = (
        CUBE_OBJECT
        + '<object id="2"><components><component objectid="1" transform="1 0 0 0 1 0 0 0 1 1 0 0"/>'
        + '<component objectid="1"/></components></object>'
    )
    raw = read_3mf(package(model(parts, '<item objectid="2" transform="2 0 0 0 2 0 0 0 2 0 0 0"/>')), LIMITS)
    assert np.array_equal(
        raw.vertices, np.concatenate([(CUBE_CORNERS + np.array([1, 0, 0])) * 2, CUBE_CORNERS * 2])
    )
    assert np.array_equal(raw.faces, np.concatenate([CUBE_FACES, CUBE_FACES + 8]))


def test_objects_of_other_parts_with_equal_ids_are_kept_apart():
    far = MESH.replace('x="1.0"', 'x="5.0"')
    root = model(
        '<object id="9"><components><component objectid="1" p:path="/3D/one.model"/>'
        '<component objectid="1" p:path="/3D/Two.model"/></components></object>',
        '<item objectid="9"/>',
    )
    data = package(root, one=model(build=""), two=model(f'<object id="1">{far}</object>', build=""))
    raw = read_3mf(data, LIMITS)
    assert len(raw.vertices) == 16
    assert raw.vertices[:8, 0].max() == 1
    assert raw.vertices[8:, 0].max() == 5


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (package(model()[:-200]), "breaks off or is damaged"),
        (package(model(prolog='<!DOCTYPE m [<!ENTITY a "b">]>')), "declares a document type"),
        (package(model().replace('x="1.0"', "", 1)), "Line 1 of the 3MF model lacks a number"),
        (package(model().replace('x="1.0"', 'x="one"', 1)), "holds a wrong one"),
        (package(model().replace('v1="0"', 'v1="8"', 1)), "names a vertex outside 0 … 7"),
        (package(model(build='<item objectid="7"/>')), "places object '7', which is not there"),
        (package(model(build='<item objectid="1" p:path="/3D/gone.model"/>')), "which is not there"),
        (package(model(build='<item objectid="1" transform="1 0"/>')), "wrong one"),
        (package()[:-30], "cannot be unpacked"),
    ],
)
def test_what_is_damaged_is_refused(data: bytes, words: str):
    with pytest.raises(UnreadableError) as refusal:
        read_3mf(data, LIMITS)
    assert words in str(refusal.value)


def test_an_archive_without_a_model_is_no_3mf():
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("cow.obj", "v 0 0 0")
    with pytest.raises(UnreadableError, match="no 3MF") as refusal:
        read_3mf(file.getvalue(), LIMITS)
    assert refusal.value.code == "unsupported-mesh-format"


def test_a_damaged_byte_is_seen_by_the_checksum():
    data = bytearray(package())
    with zipfile.ZipFile(io.BytesIO(bytes(data))) as archive:
        stored = archive.getinfo("3D/3dmodel.model")
    data[stored.header_offset + 60] ^= 0xFF
    with pytest.raises(UnreadableError):
        read_3mf(bytes(data), LIMITS)


def test_components_in_a_circle_end():
    ring = '<object id="1"><components><component objectid="1"/></components></object>'
    with pytest.raises(TooLargeError, match="deep"):
        read_3mf(package(model(ring)), LIMITS)


def test_components_that_double_at_each_level_end():
    levels = [CUBE_OBJECT] + [
        f'<object id="{n}"><components>{f"<component objectid={chr(34)}{n - 1}{chr(34)}/>" * 2}</components></object>'
        for n in range(2, 30)
    ]
    with pytest.raises(TooLargeError, match="4,096 parts"):
        read_3mf(package(model("".join(levels), '<item objectid="29"/>')), LIMITS)


def test_counts_are_capped_while_parsing():
    with pytest.raises(TooLargeError, match="at most 7"):
        read_3mf(package(), ReadLimits(max_vertices=7))
    with pytest.raises(TooLargeError, match="at most 11"):
        read_3mf(package(), ReadLimits(max_faces=11))
    with pytest.raises(TooLargeError, match="unpacks to more"):
        read_3mf(package(), ReadLimits(max_unpacked_bytes=1000))
