from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spherify.formats import ALLOW, MeshRefusedError, MeshReport, write_mesh
from spherify.formats.acceptance import accept
from spherify.formats.errors import UnreadableError
from spherify.formats.judge import unforgiven
from spherify.formats.report import Location
from tests.formats.shapes import CUBE_CORNERS, CUBE_FACES, LIMITS, TETRAHEDRON, accept_obj, cube, tube


def codes(report: MeshReport) -> list[str]:
    return [repair.code for repair in report.repairs]


def refusal_of(vertices: object, faces: object, *allow: str) -> MeshRefusedError:
    with pytest.raises(MeshRefusedError) as refusal:
        accept_obj(vertices, faces, *allow)
    assert refusal.value.report is not None
    assert not refusal.value.report.eligible
    assert refusal.value.errors[0].code == refusal.value.code
    assert str(refusal.value).startswith(refusal.value.errors[0].detail)
    return refusal.value


def test_a_good_mesh_is_taken_as_it_is_and_measured():
    result = accept_obj(CUBE_CORNERS, CUBE_FACES)
    assert np.array_equal(result.mesh.vertices, CUBE_CORNERS)
    assert np.array_equal(result.mesh.faces, CUBE_FACES)
    report = result.report
    assert (report.vertices, report.faces, report.components, report.genus, report.euler) == (8, 12, 1, 0, 2)
    assert (report.boundary_loops, report.boundary_edges, report.degenerate_faces) == (0, 0, 0)
    assert report.bbox == ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    assert (report.area, report.volume) == (pytest.approx(6), pytest.approx(1))
    assert report.sphericity == pytest.approx((np.pi / 6) ** (1 / 3))
    assert report.mean_edge == pytest.approx((12 + 6 * np.sqrt(2)) / 18)
    assert report.least_quality == pytest.approx(np.sqrt(3) / 2)
    assert report.eligible
    assert report.repairs == report.defects == report.allowed == ()


def test_a_report_survives_json():
    vertices, faces = tube(5, 4, torus=False)
    report = refusal_of(vertices, faces).report
    assert report is not None
    assert MeshReport.from_dict(json.loads(json.dumps(report.as_dict()))) == report


# --- what is mended


def test_split_vertices_are_welded_and_keep_their_order():
    result = accept_obj(CUBE_CORNERS[CUBE_FACES].reshape(-1, 3), np.arange(36).reshape(-1, 3))
    assert codes(result.report) == ["welded"]
    assert result.report.repairs[0].count == 28
    first_seen = list(dict.fromkeys(CUBE_FACES.reshape(-1).tolist()))
    assert np.array_equal(result.mesh.vertices, CUBE_CORNERS[first_seen])


def test_minus_zero_and_zero_are_one_place():
    corners = CUBE_CORNERS[CUBE_FACES].reshape(-1, 3)
    corners[::2][corners[::2] == 0] = -0.0
    assert accept_obj(corners, np.arange(36).reshape(-1, 3)).report.vertices == 8


def test_closed_meshes_keep_their_coincident_vertices_apart():
    # A torus drawn together until two opposite vertices of its hole meet: closed, and welding would pinch it.
    vertices, faces = tube(6, 6, torus=True)
    vertices[0] = vertices[21]
    report = accept_obj(vertices, faces, "genus").report
    assert report.vertices == 36
    assert codes(report) == []


def test_an_open_mesh_is_not_welded_where_that_mends_nothing():
    vertices, faces = tube(6, 4, torus=False)
    vertices[0] = vertices[12]
    report = accept_obj(vertices, faces, "boundary").report
    assert (report.vertices, report.boundary_loops, codes(report)) == (24, 2, [])


def test_unused_vertices_are_left_out_and_the_others_keep_their_order():
    padded = np.insert(CUBE_CORNERS, 3, [[9.0, 9.0, 9.0]], axis=0)
    result = accept_obj(padded, CUBE_FACES + (CUBE_FACES >= 3))
    assert np.array_equal(result.mesh.vertices, CUBE_CORNERS)
    assert np.array_equal(result.mesh.faces, CUBE_FACES)
    assert result.report.repairs[0].code == "unused-vertices"
    assert result.report.bbox[1] == (1.0, 1.0, 1.0)


def test_unused_vertices_may_hold_anything():
    padded = np.append(CUBE_CORNERS, [[1e300, 0, 0]], axis=0)
    assert accept_obj(padded, CUBE_FACES).report.volume == pytest.approx(1)


def test_faces_that_name_a_vertex_twice_are_left_out():
    report = accept_obj(CUBE_CORNERS, [*CUBE_FACES.tolist(), [0, 0, 1], [2, 3, 2]]).report
    assert codes(report) == ["collapsed-faces"]
    assert (report.faces, report.repairs[0].count) == (12, 2)


def test_an_inside_out_mesh_is_turned():
    result = accept_obj(CUBE_CORNERS, CUBE_FACES[:, ::-1])
    assert codes(result.report) == ["turned-outward"]
    assert result.report.volume == pytest.approx(1)
    assert result.report.eligible


def test_an_inside_out_mesh_far_from_the_origin_is_turned_too():
    assert codes(accept_obj(CUBE_CORNERS + 1e6, CUBE_FACES[:, ::-1]).report) == ["turned-outward"]
    assert codes(accept_obj(CUBE_CORNERS - 1e6, CUBE_FACES).report) == []


# --- what is refused, and let through


def test_holes_are_counted_and_the_first_edge_is_named():
    vertices, faces = tube(5, 4, torus=False)
    refusal = refusal_of(vertices, faces)
    assert refusal.code == "mesh-not-closed"
    assert (
        "10 edges have one face only, around 2 holes, the first between vertices 0 and 4 (from 0) at (1, 0, 0)"
        in str(refusal)
    )
    assert len(refusal.errors[0].locations) == 10
    first = refusal.errors[0].locations[0]
    assert first.kind == "edge"
    assert first.indices == (0, 4)
    assert first.positions == (tuple(vertices[0]), tuple(vertices[4]))
    allowed = accept_obj(vertices, faces, "boundary").report
    assert (allowed.eligible, allowed.allowed, allowed.genus, allowed.boundary_loops) == (
        True,
        ("boundary",),
        0,
        2,
    )
    assert [defect.code for defect in allowed.defects] == ["mesh-not-closed"]


def test_places_are_named_as_the_file_counts():
    padded = np.concatenate([np.full((3, 3), 7.0), CUBE_CORNERS])
    refusal = refusal_of(padded, CUBE_FACES[1:] + 3)
    assert refusal.errors[0].locations[0].indices == (3, 5)


def test_inner_walls_are_refused_whatever_is_allowed():
    vertices = np.append(TETRAHEDRON[0], [[3.0, 3, 3]], axis=0)
    outer = [[0, 1, 4], [0, 4, 2], [1, 2, 4]]
    refusal = refusal_of(vertices, [*TETRAHEDRON[1].tolist(), *outer], *ALLOW)
    assert refusal.code == "mesh-not-manifold"
    assert "3 edges have more than two faces" in str(refusal)
    assert refusal.report is not None
    assert refusal.report.genus is None


def test_winding_that_turning_mends_is_told_from_a_surface_of_one_side():
    turned = CUBE_FACES.copy()
    turned[3] = turned[3, ::-1]
    refusal = refusal_of(CUBE_CORNERS, turned, *ALLOW)
    assert refusal.code == "mesh-not-oriented"
    assert "across 3 edges" in str(refusal)
    assert "Re-Orient All Faces Coherently" in str(refusal)
    u = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    rim = [
        [np.cos(u) * (2 + s * np.cos(u / 2)), np.sin(u) * (2 + s * np.cos(u / 2)), s * np.sin(u / 2)]
        for s in (-1, 1)
    ]
    band = np.concatenate([np.array(rim[0]).T, np.array(rim[1]).T])
    quads = [(i, i + 1, i + 13, i + 12) if i < 11 else (11, 12, 0, 23) for i in range(12)]
    moebius = refusal_of(band, [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))], *ALLOW)
    assert moebius.code == "mesh-not-oriented"
    assert "one side only" in str(moebius)
    assert moebius.report is not None
    assert (moebius.report.boundary_loops, moebius.report.genus) == (1, None)


def test_components_are_counted_and_the_largest_can_be_taken():
    vertices = np.concatenate([TETRAHEDRON[0] + 10, CUBE_CORNERS])
    faces = np.concatenate([TETRAHEDRON[1], CUBE_FACES + 4])
    refusal = refusal_of(vertices, faces)
    assert refusal.code == "mesh-not-connected"
    assert "2 components, of 12, 4 faces, the second one at vertex 4" in str(refusal)
    assert refusal.errors[0].locations[1] == Location("component", (4,), ((0.0, 0.0, 0.0),))
    taken = accept_obj(vertices, faces, "components")
    assert np.array_equal(taken.mesh.vertices, CUBE_CORNERS)
    assert codes(taken.report) == ["components-left-out"]
    assert taken.report.components == 1


def test_two_bodies_that_share_a_vertex_are_seen_though_every_edge_is_good():
    other = 2 * CUBE_CORNERS[7] - CUBE_CORNERS
    vertices = np.concatenate([CUBE_CORNERS, other[:7]])
    faces = np.concatenate([CUBE_FACES, np.where(CUBE_FACES == 7, 7, CUBE_FACES + 8)[:, ::-1]])
    refusal = refusal_of(vertices, faces)
    assert refusal.code == "mesh-not-manifold"
    assert (
        "1 vertex joins parts that touch in nothing else, the first at vertex 7 (from 0) at (1, 1, 1)"
        in str(refusal)
    )
    report = accept_obj(vertices, faces, "nonmanifold-vertex").report
    assert (report.euler, report.components, report.genus) == (3, 1, 0)


def test_handles_are_counted():
    refusal = refusal_of(*tube(6, 9, torus=True))
    assert refusal.code == "mesh-genus"
    assert "genus 1: 1 handle" in str(refusal)
    report = accept_obj(*tube(6, 9, torus=True), "genus").report
    assert (report.genus, report.euler, report.eligible) == (1, 0, True)
    assert report.volume == pytest.approx(2 * np.pi**2 * 2, rel=0.3)


def test_every_problem_is_told_and_only_those_not_allowed():
    vertices, faces = tube(5, 4, torus=False)
    torus = tube(6, 9, torus=True)
    both = np.concatenate([vertices, torus[0] + 9]), np.concatenate([faces, torus[1] + len(vertices)])
    assert [d.code for d in refusal_of(*both).errors] == [
        "mesh-not-closed",
        "mesh-not-connected",
        "mesh-genus",
    ]
    refusal = refusal_of(*both, "boundary", "genus")
    assert [d.code for d in refusal.errors] == ["mesh-not-connected"]
    assert refusal.report is not None
    assert len(refusal.report.defects) == 3
    assert unforgiven(refusal.report.defects, ALLOW) == ()


def test_three_faces_close_nothing():
    refusal = refusal_of(TETRAHEDRON[0], TETRAHEDRON[1][:3], *ALLOW)
    assert "has 3 faces, and a closed one has at least 4" in str(refusal)
    assert "has 1 face, and" in str(refusal_of(TETRAHEDRON[0], TETRAHEDRON[1][:1], *ALLOW))


def test_a_flat_body_encloses_nothing():
    refusal = refusal_of(CUBE_CORNERS * [1, 1, 0], CUBE_FACES)
    assert refusal.code == "mesh-not-closed"
    assert "encloses no volume" in str(refusal)


@pytest.mark.parametrize(
    ("vertices", "words"),
    [
        (CUBE_CORNERS * 0, "0 units in size"),
        (CUBE_CORNERS * 1e-300, "only 1e-30 to 1e+30"),
        (CUBE_CORNERS * 1e300, "only 1e-30 to 1e+30"),
        (CUBE_CORNERS * 1e-6 + 1e6, "too few digits left. Move it to the origin"),
    ],
)
def test_sizes_that_cannot_be_reckoned_with_are_refused_with_the_cure(vertices: np.ndarray, words: str):
    with pytest.raises(UnreadableError) as refusal:
        accept_obj(vertices, CUBE_FACES)
    assert words in str(refusal.value)


def test_numbers_that_are_not_finite_are_seen_in_binary_files_too():
    for mesh_format, at in (("ply", -12 * 13 - 24), ("stl", 84 + 12), ("glb", -4)):
        data = bytearray(write_mesh(cube(), mesh_format, precision="double"))
        start = at % len(data) if mesh_format != "stl" else at
        width = 8 if mesh_format == "ply" else 4
        data[start : start + width] = np.array([np.nan], f"<f{width}").tobytes()
        with pytest.raises(UnreadableError, match="not a finite number"):
            accept(bytes(data), f"x.{mesh_format}", (), LIMITS)


@pytest.mark.parametrize("data", [b"v 0 0 0\nv 1 0 0\n", b"# nothing\nv 0 0 0\nl 1 1\n"])
def test_points_alone_are_no_surface(data: bytes):
    with pytest.raises(UnreadableError, match=r"no faces, only \d points.*surface"):
        accept(data, "points.obj", (), LIMITS)


def test_a_file_of_nothing_says_so_once():
    with pytest.raises(UnreadableError, match=r"The file has no faces and no points\. Export"):
        accept(bytes(84), "empty.stl", (), LIMITS)


@settings(max_examples=25, deadline=None)
@given(
    scale=st.sampled_from([1e-6, 1e-3, 1.0, 1e3, 1e6, 1e25]),
    shift=st.lists(st.integers(-1000, 1000), min_size=3, max_size=3),
    order=st.permutations(range(8)),
)
def test_the_judgement_does_not_depend_on_scale_place_or_numbering(
    scale: float, shift: list[int], order: list[int]
):
    moved = (CUBE_CORNERS + shift)[np.argsort(order)] * scale
    report = accept_obj(moved, np.array(order)[CUBE_FACES]).report
    assert (report.vertices, report.genus, report.repairs, report.defects) == (8, 0, (), ())
    assert report.sphericity == pytest.approx((np.pi / 6) ** (1 / 3))
    assert report.area == pytest.approx(6 * scale**2)
    assert report.volume == pytest.approx(scale**3)
