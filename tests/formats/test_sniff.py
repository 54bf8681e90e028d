from __future__ import annotations

import pytest

from spherify.formats import write_mesh
from spherify.formats.errors import UnreadableError
from spherify.formats.sniff import agreed_format, content_format
from tests.formats.shapes import cube
from tests.formats.test_3mf import package

CONTENT = {name: write_mesh(cube(), name) for name in ("obj", "ply", "stl", "off", "glb")} | {
    "3mf": package()
}


@pytest.mark.parametrize("mesh_format", CONTENT)
@pytest.mark.parametrize("name", ["mesh", "mesh.{}", "mesh.upload", "MESH.{}"])
def test_content_is_recognised_and_agrees_with_its_name(mesh_format: str, name: str):
    assert agreed_format(CONTENT[mesh_format], name.format(mesh_format.upper())) == mesh_format


@pytest.mark.parametrize(
    ("content", "mesh_format"),
    [
        (b"# made by hand\n\n# twice\nv 0 0 0\n", "obj"),
        (b"\xef\xbb\xbf# BOM\r\nmtllib x.mtl\r\n", "obj"),
        (b"o thing\rv 0 0 0\r", "obj"),
        (b"# comment\nOFF\n3 1 0\n", "off"),
        (b"COFF 3 1 0\n", "off"),
        (b"OFF BINARY\n", "off"),
        (b"ply\r\nformat ascii 1.0\r\n", "ply"),
        (b"\n  SOLID thing\n", "stl"),
        (b"solid" + b" " * 75 + bytes(4), "stl"),
    ],
)
def test_awkward_beginnings_are_recognised(content: bytes, mesh_format: str):
    assert content_format(content) == mesh_format


@pytest.mark.parametrize(
    ("content", "name", "code", "words"),
    [
        (b"", "x.stl", "mesh-not-parsable", "empty"),
        (
            b"<!DOCTYPE html><html>",
            "x.stl",
            "mesh-not-parsable",
            "is not STL: it starts with '<!DOCTYPE html>",
        ),
        (b"hello world", "x.obj", "mesh-not-parsable", "is not OBJ"),
        (b"<!DOCTYPE html><html>", "x.html", "unsupported-mesh-format", "OBJ, PLY, STL, OFF, GLB, 3MF"),
        (b"*Node\n*Include, input=/etc/passwd\n", "x.inp", "unsupported-mesh-format", "OBJ, PLY"),
        (b"*Node\n*Include, input=/etc/passwd\n".ljust(84), "x", "unsupported-mesh-format", "OBJ, PLY"),
        (b"PK\x03\x04" + bytes(50), "x.zip", "unsupported-mesh-format", "no format that is read here"),
        (b"BZh91AY&SY", "x.obj.bz2", "unsupported-mesh-format", "no format"),
        (CONTENT["ply"], "x.obj", "unsupported-mesh-format", "its content is PLY. Name it .ply"),
        (CONTENT["obj"], "x.3mf", "unsupported-mesh-format", "its content is OBJ"),
        (b"\xff\xfev\x00 \x000\x00", "x.obj", "mesh-not-parsable", "UTF-16"),
    ],
)
def test_what_is_refused_says_why(content: bytes, name: str, code: str, words: str):
    with pytest.raises(UnreadableError) as refusal:
        agreed_format(content, name)
    assert refusal.value.code == code
    assert words in str(refusal.value)


def test_a_cut_off_binary_stl_is_still_told_by_its_name():
    assert agreed_format(CONTENT["stl"][:-10], "x.stl") == "stl"
    with pytest.raises(UnreadableError, match="no format"):
        agreed_format(CONTENT["stl"][:-10], "x")
