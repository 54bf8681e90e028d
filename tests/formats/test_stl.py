from __future__ import annotations

import numpy as np
import pytest

from spherify.formats import text, write_mesh
from spherify.formats.errors import TooLargeError, UnreadableError
from spherify.formats.limits import ReadLimits
from spherify.formats.readers.stl import is_binary, read_stl
from spherify.geometry.samples import SAMPLES
from tests.formats.shapes import CUBE_CORNERS, CUBE_FACES, LIMITS, cube

BINARY = write_mesh(cube(), "stl")
ASCII = write_mesh(cube(), "stl", ascii=True)
FACET = b"facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"


@pytest.mark.parametrize(
    "variant",
    [
        BINARY,
        b"solid but binary".ljust(80) + BINARY[80:],
        ASCII,
        ASCII.replace(b"\n", b"\r\n"),
        ASCII.replace(b"\n", b"\r"),
        b"\xef\xbb\xbf" + ASCII,
        ASCII.upper(),
        ASCII.replace(b"vertex ", b"\t vertex\t "),
        ASCII.replace(b"endloop", b"# a comment\n; another\n// a third\n\nendloop"),
        ASCII.replace(b"spherify", b"caf\xe9 with a long name"),
        ASCII.replace(b"endsolid spherify\n", b""),
        ASCII.replace(b"endfacet\n", b"endfacet\nendsolid one\nsolid two\n", 1),
    ],
    ids=range(12),
)  # fmt: skip
def test_variants_of_one_cube_read_alike(variant: bytes):
    raw = read_stl(variant, LIMITS)
    assert np.array_equal(raw.vertices, CUBE_CORNERS[CUBE_FACES].reshape(-1, 3))
    assert np.array_equal(raw.faces.reshape(-1), np.arange(36))


def test_long_texts_read_alike_wherever_they_are_cut_and_however_odd_one_facet_is(
    monkeypatch: pytest.MonkeyPatch,
):
    """Facets are read many at once where they are regular; the cuts between blocks fall anywhere in one."""
    mesh = SAMPLES["stone"].build(600)
    expected = mesh.vertices[mesh.faces].reshape(-1, 3).astype(np.float32)
    whole = write_mesh(mesh, "stl", ascii=True)
    middle = whole.index(b"vertex", len(whole) // 2)
    commented = whole[:middle] + b"# odd\n" + whole[middle:]
    for block in (1 << 22, 40_001, 777):
        monkeypatch.setattr(text, "_BLOCK", block)
        for data in (whole, commented, whole.replace(b"\nvertex", b"\n      vertex"), whole.upper()):
            assert np.array_equal(read_stl(data, LIMITS).vertices.astype(np.float32), expected)


def test_corners_do_not_lend_each_other_numbers():
    odd = FACET.replace(b"vertex 0 0 0", b"vertex 0 0 0 7").replace(b"vertex 1 0 0", b"vertex 1 0")
    with pytest.raises(UnreadableError, match="Line 5: a vertex needs 3 coordinates, but there are 2"):
        read_stl(b"solid x\n" + odd, LIMITS)


def test_only_a_file_of_just_the_right_size_is_binary():
    assert is_binary(BINARY)
    assert not is_binary(BINARY[:-1])
    assert not is_binary(bytes(34))  # 84 bytes less 50: shorter than a header
    assert is_binary(bytes(84))


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (BINARY[:-1], "claims 12 triangles, but the file ends after 11"),
        (BINARY[:80] + b"\xff\xff\xff\xff" + BINARY[84:], "claims 4,294,967,295 triangles, but the file ends"),
        (b"solid x\n" + FACET.replace(b"vertex 0 1 0\n", b""), "Line 6: a facet of STL has 3 vertices, but this"),
        (b"solid x\n" + FACET.replace(b"endloop", b"vertex 1 1 0\nendloop"), "but this one has 4"),
        (b"solid x\n" + FACET.replace(b"1 0 0", b"1 zero 0"), "Line 5: 'zero' is not a number"),
        (b"solid x\n" + FACET.replace(b"1 0 0", b"1 nan 0"), "Line 5: the coordinate 'nan'"),
        (b"solid x\n" + FACET.replace(b"outer", b"inner"), "Line 3: 'inner loop' is not STL"),
        (b"solid x\n" + FACET + FACET.partition(b"endloop")[0], "ends inside a facet"),
    ],
)  # fmt: skip
def test_what_is_damaged_is_refused(data: bytes, words: str):
    with pytest.raises(UnreadableError) as refusal:
        read_stl(data, LIMITS)
    assert words in str(refusal.value)


@pytest.mark.parametrize("data", [BINARY, ASCII])
def test_counts_are_capped(data: bytes):
    with pytest.raises(TooLargeError, match="at most 11"):
        read_stl(data, ReadLimits(max_faces=11))
