from __future__ import annotations

import struct

import numpy as np
import pytest

from spherify.formats import write_mesh
from spherify.formats.errors import TooLargeError, UnreadableError
from spherify.formats.limits import ReadLimits
from spherify.formats.readers.ply import read_ply
from tests.formats.shapes import CUBE_CORNERS, CUBE_FACES, CUBE_QUADS, LIMITS, cube

ASCII = write_mesh(cube(), "ply", ascii=True)
BINARY = write_mesh(cube(), "ply")
MIXED = [CUBE_QUADS[0], *CUBE_FACES[2:4].tolist(), *CUBE_QUADS[2:]]  # the second square as two triangles


def header(encoding: str, *elements: str) -> bytes:
    return "\n".join(["ply", f"format {encoding} 1.0", *elements, "end_header", ""]).encode()


def binary_cube(order: str, faces: list[tuple[int, ...]] | list[list[int]], extra: bool = False) -> bytes:
    """Return a binary PLY in a byte order; ``extra`` adds columns before, between and behind those that count."""
    name = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    vertex = ["property float x", "property float y", "property float z"]
    face = ["property list uchar int vertex_index"]
    if extra:
        vertex = ["property uchar red", *vertex, "property double confidence"]
        face = [
            "property short flags",
            "property list ushort float texcoord",
            *face,
            "property float quality",
        ]
    data = header(name, "element vertex 8", *vertex, f"element face {len(faces)}", *face)
    for point in CUBE_CORNERS:
        data += struct.pack(
            order + ("B3fd" if extra else "3f"), *([7] if extra else []), *point, *([0.5] if extra else [])
        )
    for row, corners in enumerate(faces):
        if extra:
            data += struct.pack(f"{order}hH{row % 3}f", -1, row % 3, *[0.25] * (row % 3))
        data += struct.pack(f"{order}B{len(corners)}i", len(corners), *corners)
        data += struct.pack(order + "f", 1.5) if extra else b""
    return data


def is_cube(data: bytes) -> bool:
    raw = read_ply(data, LIMITS)
    return np.array_equal(raw.vertices, CUBE_CORNERS) and np.array_equal(raw.faces, CUBE_FACES)


@pytest.mark.parametrize(
    "variant",
    [
        ASCII,
        b"\xef\xbb\xbf" + ASCII,
        ASCII.replace(b"\n", b"\r\n"),
        ASCII.replace(b"\n", b"\r"),
        ASCII.replace(b"end_header\n", b"end_header\n\n").replace(b"\n3 ", b"\n\n3 "),
        ASCII.replace(b"\n3 ", b"\ncomment in the body\n# and this\n3 "),
        ASCII.replace(b"ply\n", b"ply\ncomment end_header is a word\nobj_info x\n"),
        ASCII.replace(b"vertex_indices", b"vertex_index").replace(b"uchar int", b"uint8 uint32"),
        ASCII.replace(b"double x", b"float32 x").replace(b" ", b"  \t"),
        ASCII.replace(b"element face", b"element material 2\nproperty int a\nproperty list uchar float b\nelement face")
        .replace(b"\n3 0 2 3", b"\n7 1 0.5\n8 0\n3 0 2 3", 1),
        ASCII.replace(b"z\nelement", b"z\nproperty float c\nelement")
        .replace(b".0\n", b".0 nan\n").replace(b"ascii 1.0 nan", b"ascii 1.0"),
    ],
    ids=range(11),
)  # fmt: skip
def test_variants_of_one_ascii_cube_read_alike(variant: bytes):
    assert is_cube(variant)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("extra", [False, True])
@pytest.mark.parametrize("faces", [CUBE_FACES.tolist(), list(CUBE_QUADS), MIXED], ids=["3", "4", "mixed"])
def test_binary_cubes_read_alike(order: str, extra: bool, faces: list[list[int]]):
    assert is_cube(binary_cube(order, faces, extra))


@pytest.mark.parametrize("end", [b"\r\n", b"\r"])
def test_a_binary_body_may_follow_any_line_end(end: bytes):
    head, sign, body = BINARY.partition(b"end_header\n")
    assert is_cube(head.replace(b"\n", end) + sign.replace(b"\n", end) + body)


def test_ascii_faces_of_mixed_sizes_with_lists_before_and_behind():
    faces = "".join(
        f"{k % 3}{' 0.5' * (k % 3)} {len(f)} {' '.join(map(str, f))} 9\n" for k, f in enumerate(MIXED)
    )
    data = header(
        "ascii", "element vertex 8", "property double x", "property double y", "property double z",
        f"element face {len(MIXED)}", "property list uchar float texcoord",
        "property list uchar int vertex_indices", "property int flag",
    )  # fmt: skip
    data += "".join(f"{x} {y} {z}\n" for x, y, z in CUBE_CORNERS).encode() + faces.encode()
    assert is_cube(data)


def strips(encoding: str, *rows: list[int]) -> bytes:
    head = header(
        encoding, "element vertex 5", "property float x", "property float y", "property float z",
        f"element tristrips {len(rows)}", "property list int int vertex_indices",
    )  # fmt: skip
    points = np.arange(15.0).reshape(5, 3)
    if encoding == "ascii":
        lines = [*points.astype(str).tolist(), *[[str(len(row)), *map(str, row)] for row in rows]]
        return head + "\n".join(" ".join(line) for line in lines).encode()
    return (
        head
        + points.astype("<f4").tobytes()
        + b"".join(np.array([len(row), *row], "<i4").tobytes() for row in rows)
    )


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian"])
def test_strips_alternate_begin_anew_and_turn_corners_without_area(encoding: str):
    raw = read_ply(strips(encoding, [0, 1, 2, 3, -1, 1, 2, 4], [0, 1, 1, 2, 3], [4, 3, 2], [0, 1]), LIMITS)
    assert raw.faces.tolist() == [[0, 1, 2], [2, 1, 3], [1, 2, 4], [1, 2, 3], [4, 3, 2]]


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"ply\nformat ascii 1.0\n", "no end_header"),
        (b"ply\nend_header\n", "no format line"),
        (header("binary_middle_endian"), "Line 2 of the PLY header"),
        (header("ascii", "element vertex many"), "Line 3 of the PLY header"),
        (header("ascii", "property float x"), "Line 3 of the PLY header"),
        (header("ascii", "element face 1", "property list float int vertex_indices"), "Line 4 of the PLY header"),
        (header("ascii", "element vertex 1", "property float x") + b"0\n", "no x, y and z"),
        (header("ascii", "element vertex 4000000000", "property float x"), "claims 4,000,000,000 rows of vertex"),
        (header("binary_little_endian", "element vertex 3000000000", "property float x"), "claims 3,000,000,000 rows"),
        (ASCII.replace(b"element face 12", b"element face 13"), "claims 13 rows of face, but the file ends after 12"),
        (BINARY.replace(b"element face 12", b"element face 13"), "claims 13 rows of face"),
        (BINARY[:-1], "claims 12 rows of face, but the file ends after 11"),
        (ASCII.replace(b"\n3 0 2 3", b"\n3 0 2 8"), "A face names vertex 8, but there are only vertices 0 … 7"),
        (ASCII.replace(b"\n3 0 2 3", b"\n3 0 2 -1"), "A face names vertex -1"),
        (ASCII.replace(b"\n3 0 2 3", b"\n3 0 2 " + b"9" * 20), f"a face names vertex '{'9' * 20}', and no mesh has"),
        (ASCII.replace(b"\n3 0 2 3", b"\n3 0 2"), "the row does not hold what the header says"),
        (ASCII.replace(b"\n3 0 2 3", b"\n3 0 2 3 1"), "the row does not hold what the header says"),
        (ASCII.replace(b"\n3 0 2 3", b"\n-3 0 2 3"), "the row does not hold what the header says"),
        (ASCII.replace(b"\n3 0 2 3", b"\n3 0 2.5 3"), "'2.5' is not a vertex number"),
        (ASCII.replace(b"\n3 0 2 3", b"\n3 0 x 3"), "'x' is not a vertex number"),
        (ASCII.replace(b"1.0 0.0 0.0", b"1.0 0.0", 1), "Line 11: a vertex has 3 values by the header, but 2"),
        (ASCII.replace(b"1.0 0.0 0.0", b"1.0 nan 0.0", 1), "Line 11: the coordinate 'nan'"),
        (ASCII.replace(b"vertex_indices", b"corners"), "gives a face no list vertex_indices"),
        (header("binary_little_endian", "element vertex 0", "property float x", "property float y", "property float z",
                "element face 2", "property list char int vertex_indices") + b"\x00\xff", "has the length -1"),
        (header("binary_little_endian", "element vertex 0", "property float x", "property float y", "property float z",
                "element face 1", "property list uint int vertex_indices") + b"\xff\xff\xff\xff", "ends after 0"),
    ],
)  # fmt: skip
def test_what_is_damaged_is_refused(data: bytes, words: str):
    with pytest.raises(UnreadableError) as refusal:
        read_ply(data, LIMITS)
    assert words in str(refusal.value)


@pytest.mark.parametrize("data", [ASCII, BINARY, binary_cube("<", MIXED)])
def test_counts_are_capped(data: bytes):
    with pytest.raises(TooLargeError, match="at most 7"):
        read_ply(data, ReadLimits(max_vertices=7))
    with pytest.raises(TooLargeError, match="at most 11"):
        read_ply(data, ReadLimits(max_faces=11))
