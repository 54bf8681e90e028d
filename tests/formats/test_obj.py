from __future__ import annotations

import numpy as np
import pytest

from spherify.formats.errors import TooLargeError, UnreadableError
from spherify.formats.limits import ReadLimits
from spherify.formats.readers.obj import read_obj
from spherify.formats.text import widths
from tests.formats.shapes import CUBE_CORNERS, CUBE_FACES, CUBE_QUADS, LIMITS, obj_bytes

CUBE = obj_bytes(CUBE_CORNERS, CUBE_FACES)


def is_cube(data: bytes) -> bool:
    raw = read_obj(data, LIMITS)
    return np.array_equal(raw.vertices, CUBE_CORNERS) and np.array_equal(raw.faces, CUBE_FACES)


@pytest.mark.parametrize(
    "variant",
    [
        CUBE,
        b"\xef\xbb\xbf" + CUBE,
        CUBE.replace(b"\n", b"\r\n"),
        CUBE.replace(b"\n", b"\r"),
        CUBE.replace(b"\n", b"\n\n  # between\n"),
        CUBE.replace(b"\n", b"  # behind\n"),
        CUBE.replace(b" ", b"\t"),
        CUBE.replace(b" ", b"   ").replace(b"\n", b"  \n  "),
        CUBE.replace(b"1.0", b"1.0e+00"),
        b"# caf\xe9 in Latin-1\n" + CUBE,
        b"mtllib /etc/passwd\nusemtl x\no a\ng b\ns 1\nvn 0 0 1\nvt 0 0\nl 1 2\np 1\n" + CUBE,
        obj_bytes(CUBE_CORNERS, CUBE_QUADS),
        obj_bytes(CUBE_CORNERS, CUBE_QUADS).replace(b"f ", b"f \\\n "),
    ],
    ids=lambda data: repr(data[:24]),
)
def test_variants_of_one_cube_read_alike(variant: bytes):
    assert is_cube(variant)


def test_colours_and_weights_behind_positions_are_passed_over():
    lines = CUBE.splitlines()
    lines[0] += b" 0.1 0.2 0.3"
    lines[1] += b" 1.0"
    assert is_cube(b"\n".join(lines))


def test_texture_and_normal_numbers_split_no_vertex():
    corners = ["{}", "{}/9", "{}//7", "{}/1/2"]
    faces = [
        " ".join(corners[i % 4].format(c + 1) for i, c in enumerate(face)) for face in CUBE_FACES.tolist()
    ]
    positions = b"\n".join(CUBE.splitlines()[:8])
    assert is_cube(positions + "".join(f"\nf {face}" for face in faces).encode())


def test_negative_numbers_count_back_from_the_line_they_stand_on():
    data = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 0 0 1\nf -4 -1 -3\n"
    assert read_obj(data, LIMITS).faces.tolist() == [[0, 1, 2], [0, 3, 1]]


def test_digits_read_back_as_the_same_float64():
    values = np.random.default_rng(1).normal(size=(50, 3)) * 10.0 ** np.arange(-25, 25)[:, None]
    assert np.array_equal(read_obj(obj_bytes(values, [[0, 1, 2]]), LIMITS).vertices, values)


def test_a_file_longer_than_a_block_reads_as_one():
    n = 300_000
    grid = np.arange(3 * n, dtype=float).reshape(-1, 3)
    data = obj_bytes(grid, [[0, 1, n - 1]])
    assert len(data) > 1 << 22
    raw = read_obj(data, LIMITS)
    assert np.array_equal(raw.vertices, grid)
    assert raw.faces.tolist() == [[0, 1, n - 1]]


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"v 0 0 0\nv 1 0 nan\nf 1 2 1\n", "Line 2: the coordinate 'nan' is not a finite number"),
        (b"v 0 0 0\n\nv 1 0 -inf\n", "Line 3: the coordinate '-inf'"),
        (b"v 0 0 1e999\n", "Line 1: the coordinate '1e999'"),
        (b"v 0 0 0\nv 1 0 -1.#IND\n", "Line 2: '-1.#IND' is not a number"),
        (b"v 0 0,5 0\n", "Line 1: '0,5' is not a number"),
        (b"v 0 0\n", "Line 1: a vertex needs 3 coordinates, but there are 2"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "Line 4: a face names vertex 0, but this format counts"),
        (
            b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 4\n",
            "Line 5: a face names vertex 4, but there are only",
        ),
        (
            b"v 0 0 0\nv 1 0 0\nf -1 -2 -3\nv 0 1 0\n",
            "Line 3: a face counts 3 vertices back, but only 2 stand",
        ),
        (b"v 0 0 0\nf 1 x 1\n", "Line 2: 'x' is not a vertex number"),
        (b"v 0 0 0\nf 1.5 1 1\n", "Line 2: '1.5' is not a vertex number"),
        (b"f 1 2 3\n", "there are no vertices"),
        (b"v 0 0 0\nf 1 1 99999999999999999999999\n", "a face names vertex '99999999999999999999999', and"),
    ],
)
def test_bad_lines_are_named(data: bytes, words: str):
    with pytest.raises(UnreadableError) as refusal:
        read_obj(data, LIMITS)
    assert words in str(refusal.value)


def test_counts_are_capped():
    with pytest.raises(TooLargeError, match="8 vertices or more; at most 7"):
        read_obj(CUBE, ReadLimits(max_vertices=7))
    with pytest.raises(TooLargeError, match="12 triangles or more; at most 11"):
        read_obj(CUBE, ReadLimits(max_faces=11))


@pytest.mark.parametrize(
    "rows",
    [[b"1 2 3"], [b"1  2", b"1 2 3"], [b"1\t2 3"], [b""], [b"1", b""], [b"", b"1"], [b" 1 2"], [b"1 2 "]],
)
def test_words_are_counted_whatever_parts_them(rows: list[bytes]):
    assert widths(rows, b" ".join(rows)).tolist() == [len(row.split()) for row in rows]
