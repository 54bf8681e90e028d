from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from spherify.formats import FORMATS_IN, FORMATS_OUT, InvalidExportError, media_type, safe_name, safe_stem
from spherify.formats.names import extension


def test_every_format_has_a_media_type():
    assert set(FORMATS_OUT) < set(FORMATS_IN)
    assert [media_type(name).count("/") for name in FORMATS_IN] == [1] * len(FORMATS_IN)


def test_an_unknown_format_has_none_and_the_error_lists_the_known():
    with pytest.raises(InvalidExportError, match="obj, ply, stl, off, glb, 3mf"):
        media_type("dae")


@pytest.mark.parametrize(
    ("name", "safe"),
    [
        ("bunny.obj", "bunny.obj"),
        ("../../etc/passwd", "passwd"),
        ("C:\\meshes\\cow.PLY", "cow.PLY"),
        ('a"b;c\r\nSet-Cookie: x.obj', "a_b_c__Set-Cookie_ x.obj"),
        (".hidden", "hidden"),
        ("", "mesh"),
        ("..", "mesh"),
        ("\N{CAT}\N{CAT}.obj", "mesh.obj"),
        ("_", "mesh"),
        ("Würfel 2.stl", "Würfel 2.stl"),
        ("x" * 300 + ".obj", "x" * 116 + ".obj"),
    ],
)
def test_names_are_made_safe(name: str, safe: str):
    assert safe_name(name) == safe


def test_the_stem_has_no_extension():
    assert safe_stem("folder/cow.v2.obj") == "cow.v2"
    assert safe_stem("cow") == "cow"


@given(st.text())
def test_a_safe_name_is_one_harmless_part_of_a_path_and_stays_itself(name: str):
    safe = safe_name(name)
    assert safe
    assert len(safe) <= 120
    assert not set(safe) & set("/\\\0\r\n\"';:<>|?*")
    assert not safe.startswith(".")
    assert safe_name(safe) == safe


def test_extensions_are_told_whatever_the_case_and_the_slashes():
    assert extension("a/b.d/mesh.OBJ") == "obj"
    assert extension("a.b\\mesh") == ""
