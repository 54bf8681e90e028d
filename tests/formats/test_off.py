from __future__ import annotations

import numpy as np
import pytest

from spherify.formats import write_mesh
from spherify.formats.errors import TooLargeError, UnreadableError
from spherify.formats.limits import ReadLimits
from spherify.formats.readers.off import read_off
from tests.formats.shapes import CUBE_CORNERS, CUBE_FACES, CUBE_QUADS, LIMITS, cube

CUBE = write_mesh(cube(), "off")
QUADS = (
    "OFF\n8 6 0\n"
    + "".join(f"{x} {y} {z}\n" for x, y, z in CUBE_CORNERS)
    + "".join(f"4 {a} {b} {c} {d}\n" for a, b, c, d in CUBE_QUADS)
).encode()


@pytest.mark.parametrize(
    "variant",
    [
        CUBE,
        QUADS,
        b"\xef\xbb\xbf" + CUBE,
        CUBE.replace(b"\n", b"\r\n"),
        CUBE.replace(b"\n", b"\r"),
        CUBE.replace(b"\n", b"\n# comment\n\n"),
        CUBE.replace(b"\n", b" # comment\n"),
        CUBE.replace(b"OFF\n8 12 0", b"OFF 8 12 0"),
        CUBE.replace(b"OFF\n8 12 0", b"OFF 8 12"),
        CUBE.replace(b"OFF", b"COFF").replace(b".0\n", b".0 255 0 0 255\n"),
        CUBE.replace(b"OFF", b"NOFF").replace(b".0\n", b".0 0.5 0.5 0.7\n"),
        CUBE.replace(b"\n3 ", b"  \n  3   ") + b"\n",
        QUADS.replace(b"4 0 2 3 1", b"4 0 2 3 1  0.5 0.5 0.5").replace(b"4 4 5 7 6", b"4 4 5 7 6 255"),
    ],
    ids=range(13),
)
def test_variants_of_one_cube_read_alike(variant: bytes):
    raw = read_off(variant, LIMITS)
    assert np.array_equal(raw.vertices, CUBE_CORNERS)
    assert np.array_equal(raw.faces, CUBE_FACES)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"4OFF\n1 1 0\n", "not in 3 dimensions"),
        (b"nOFF\n3 1 1 0\n", "not in 3 dimensions"),
        (b"OFF BINARY\n\x00\x01", "Binary OFF is not read"),
        (b"OFF\n", "lacks the numbers"),
        (b"OFF\neight 12 0\n", "lacks the numbers"),
        (b"OFF\n3000000000 1 0\n0 0 0\n", "claims 3,000,000,000 vertices"),
        (b"OFF\n3 4000000000 0\n0 0 0\n", "claims 4,000,000,000 faces"),
        (b"OFF\n-1 -1 0\n", "claims -1 vertices"),
        (b"OFF\n4 -4 6\n", "claims -4 faces, which cannot be"),
        (b"OFF\n99999999999999999999 1 0\n", "claims 99,999,999,999,999,999,999 vertices"),
        (CUBE[:-12], "only 19 lines follow"),
        (
            CUBE.replace(b"3 0 2 3", b"3 0 2 8"),
            "Line 11: a face names vertex 8, but there are only vertices 0 … 7",
        ),
        (CUBE.replace(b"3 0 2 3", b"3 0 2 -1"), "Line 11: a face names vertex -1"),
        (CUBE.replace(b"3 0 2 3", b"4 0 2 3"), "Line 11: a face starts with the number of its corners"),
        (CUBE.replace(b"3 0 2 3", b"x 0 2 3"), "Line 11: a face starts with the number of its corners"),
        (CUBE.replace(b"3 0 2 3", b"3 0 2 x"), "Line 11: 'x' is not a vertex number"),
        (
            CUBE.replace(b"3 0 2 3", b"3 0 2 " + b"9" * 20),
            f"Line 11: a face names vertex '{'9' * 20}', and no mesh",
        ),
        (CUBE.replace(b"3 0 2 3", b"9" * 5000 + b" 0 2 3"), "Line 11"),
        (CUBE.replace(b"1.0 0.0 0.0", b"1.0 nan 0.0", 1), "Line 4: the coordinate 'nan'"),
    ],
)
def test_what_is_damaged_is_refused(data: bytes, words: str):
    with pytest.raises(UnreadableError) as refusal:
        read_off(data, LIMITS)
    assert words in str(refusal.value)


def test_counts_are_capped():
    with pytest.raises(TooLargeError, match="at most 7"):
        read_off(CUBE, ReadLimits(max_vertices=7))
    with pytest.raises(TooLargeError, match="at most 11"):
        read_off(QUADS, ReadLimits(max_faces=11))
