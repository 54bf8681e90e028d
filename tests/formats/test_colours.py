"""Colours in files: the page's scale and range, readable by others, positions as without them."""

from __future__ import annotations

import io
import json
import re
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh

from spherify.formats import COLOURED, FORMATS_OUT, InvalidExportError, write_mesh
from spherify.formats.acceptance import read
from spherify.formats.colours import (
    DIVERGING,
    LEAST_TAIL,
    SEQUENTIAL,
    TAILS,
    VertexColours,
    colour_range,
    vertex_colours,
)
from spherify.geometry.fields import FIELDS, vertex_field
from spherify.geometry.mesh import TriangleMesh
from spherify.geometry.samples import SAMPLES
from tests.formats.shapes import LIMITS

PAGE = Path(__file__).resolve().parents[2] / "service" / "web" / "src" / "core" / "colormap.ts"


@pytest.fixture(scope="module")
def head() -> TriangleMesh:
    return SAMPLES["head"].build(400)


@pytest.fixture(scope="module")
def colours(head: TriangleMesh) -> VertexColours:
    return vertex_colours("distance", vertex_field("distance", head, head.vertices))


@pytest.mark.parametrize(("mesh_format", "ascii_"), [("ply", False), ("ply", True), ("obj", False)])
def test_positions_are_the_same_with_colours(
    head: TriangleMesh, colours: VertexColours, mesh_format: str, *, ascii_: bool
):
    raw = read(write_mesh(head, mesh_format, ascii=ascii_, colours=colours), mesh_format, LIMITS)
    assert raw.vertices.tobytes() == head.vertices.tobytes()
    assert np.array_equal(raw.faces, head.faces)


@pytest.mark.parametrize(("mesh_format", "ascii_"), [("ply", False), ("ply", True), ("obj", False)])
def test_another_reader_finds_the_colours(
    head: TriangleMesh, colours: VertexColours, mesh_format: str, *, ascii_: bool
):
    data = write_mesh(head, mesh_format, ascii=ascii_, colours=colours)
    loaded = trimesh.load_mesh(io.BytesIO(data), mesh_format, process=False, maintain_order=True)
    assert np.array_equal(loaded.visual.vertex_colors[:, :3], colours.rgb)


def test_glb_holds_linear_light_on_a_matte_surface(head: TriangleMesh, colours: VertexColours):
    data = write_mesh(head, "glb", colours=colours)
    length = struct.unpack_from("<I", data, 12)[0]
    tree, binary = json.loads(data[20 : 20 + length]), data[28 + length :]
    (primitive,) = tree["meshes"][0]["primitives"]
    assert set(primitive["attributes"]) == {"POSITION", "COLOR_0"}
    accessor = tree["accessors"][primitive["attributes"]["COLOR_0"]]
    assert (accessor["componentType"], accessor["type"], accessor["count"]) == (
        5126,
        "VEC3",
        len(head.vertices),
    )
    view = tree["bufferViews"][accessor["bufferView"]]
    linear = np.frombuffer(binary, "<f4", 3 * len(head.vertices), view["byteOffset"]).reshape(-1, 3)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    assert np.array_equal(np.rint(255 * encoded), colours.rgb)
    assert tree["materials"][primitive["material"]]["pbrMetallicRoughness"]["metallicFactor"] == 0
    raw = read(data, "glb", LIMITS)
    assert np.array_equal(raw.vertices, head.vertices.astype(np.float32))


@pytest.mark.parametrize("mesh_format", sorted(set(FORMATS_OUT) - set(COLOURED)))
def test_formats_without_colours_say_so(head: TriangleMesh, colours: VertexColours, mesh_format: str):
    with pytest.raises(InvalidExportError, match="holds no colours"):
        write_mesh(head, mesh_format, colours=colours)


def test_the_file_says_what_its_colours_mean(head: TriangleMesh, colours: VertexColours):
    assert re.fullmatch(r"colour distance \(1\) from -0\.\d+ to 0\.\d+", colours.note)
    note = colours.note.encode()
    assert b"comment " + note in write_mesh(head, "ply", colours=colours)
    assert b"# " + note in write_mesh(head, "obj", colours=colours)
    assert b'"note":"' + note in write_mesh(head, "glb", colours=colours)


def test_scales_and_fields_are_the_pages():
    source = PAGE.read_text("utf-8")
    for name, points in (("DIVERGING", DIVERGING), ("SEQUENTIAL", SEQUENTIAL)):
        block = re.search(rf"const {name}: .*?= \[\n(.*?)\n\];", source, re.S)
        assert block is not None
        found = re.findall(r"\[(\d+), (\d+), (\d+)\]", block[1])
        assert [tuple(map(int, point)) for point in found] == list(points)
    for field, about in FIELDS.items():
        block = re.search(rf"\n  {field}: {{(.*?)\n  }},", source, re.S)
        assert block is not None
        assert f"diverging: {str(about.diverging).lower()}," in block[1]
        assert f"tail: {TAILS[field]:g}," in block[1]
    assert f"const LEAST_TAIL = {LEAST_TAIL:g};" in source


def test_the_range_leaves_slivers_out_and_is_symmetric_about_zero():
    values = np.linspace(-1, 3, 1001)
    values[0], values[-1], values[1] = -1e9, 1e9, np.nan
    low, high = colour_range(values, diverging=False)
    assert -1 < low < -0.9
    assert 2.9 < high < 3
    assert colour_range(values, diverging=True) == (-high, high)
    assert colour_range(np.full(5, 2.0), diverging=True) == pytest.approx((1.998, 2.002))
    assert colour_range(np.zeros(5), diverging=False) == (-1, 1)
    assert colour_range(np.full(5, np.nan), diverging=False) == (0, 1)


def test_limbs_that_vanish_do_not_take_the_colours_of_all_the_rest():
    body, limbs = np.linspace(0.5, 1.5, 920), np.linspace(-30, 90, 80)
    low, high = colour_range(np.concatenate([body, limbs]), diverging=True, tail=TAILS["curvature"])
    assert 0.5 < low < 0.7
    assert 1.3 < high < 1.8
    edges = np.concatenate([np.zeros(950), np.full(50, 5.0)])  # of a cube: its faces are flat
    assert colour_range(edges, diverging=True, tail=TAILS["curvature"]) == (0, 5)


def test_the_middle_and_both_ends_of_a_scale():
    values = np.concatenate([np.linspace(-1, 1, 101), [-1e9, 1e9, np.nan]])
    found = vertex_colours("distance", values)
    assert tuple(found.rgb[50]) == DIVERGING[3]
    assert tuple(found.rgb[101]) == DIVERGING[0]
    assert tuple(found.rgb[102]) == DIVERGING[-1]
    assert tuple(found.rgb[103]) == DIVERGING[0]
