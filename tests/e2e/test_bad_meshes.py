"""What strangers upload, over HTTP: each file gets its own answer, and it helps."""

from __future__ import annotations

import pytest

from tests.e2e.api import Api
from tests.shared import SHARED, shared_mesh

ACCEPTED = {
    "ascii_ply_blank_line.ply": "triangulated",
    "inside_out_horse_big_endian.ply": "turned-outward",
    "quads_fish.obj": "triangulated",
    "tristrips_igea_134k.ply": None,
    "unreferenced_vertices_airplane.obj": "unused-vertices",
    "unwelded_cube.ply": "welded",
}
"""Good meshes in an awkward form, with the repair that the report must name."""

REFUSED = {
    "empty_binary.stl": ("mesh-not-parsable", "no faces"),
    "genus1_kitten.obj": ("mesh-genus", "genus 1"),
    "genus2_double_torus.obj": ("mesh-genus", "genus 2"),
    "inverted_triangles.obj": ("mesh-not-oriented", "winding"),
    "nonmanifold_edge_tetrahedra.obj": ("mesh-not-manifold", "3 edges have more than two faces"),
    "nonmanifold_vertex_hourglass.obj": ("mesh-not-manifold", "1 vertex"),
    "nonorientable_moebius_quads.obj": ("mesh-not-oriented", "one side only"),
    "open_bunny_ascii_extra_props.ply": ("mesh-not-closed", "223 edges"),
    "open_face_scan.obj": ("mesh-not-closed", "168 edges"),
    "point_cloud.ply": ("mesh-not-parsable", "no faces"),
    "test-nan.obj": ("mesh-not-parsable", "Line 12"),
    "three_components_dumbbell.obj": ("mesh-not-connected", "3 components"),
    "triangle_soup.stl": ("mesh-not-closed", "300 edges"),
    "zero_face_index.obj": ("mesh-not-parsable", "counts vertices from 1"),
}
"""The rest, with the problem and the words that tell what is wrong."""


@pytest.mark.parametrize("name", ACCEPTED)
def test_an_awkward_mesh_is_taken(api: Api, name: str) -> None:
    answer = api.upload(shared_mesh(f"bad/{name}"))
    assert answer.status_code == 201, answer.text
    report = answer.json()["report"]
    assert report["eligible"]
    assert (report["genus"], report["components"], report["boundary_edges"]) == (0, 1, 0)
    assert report["volume"] > 0
    repairs = [repair["code"] for repair in report["repairs"]]
    assert ACCEPTED[name] in repairs if ACCEPTED[name] else repairs == []


@pytest.mark.parametrize("name", REFUSED)
def test_a_bad_mesh_is_told_what_is_wrong(api: Api, name: str) -> None:
    slug, words = REFUSED[name]
    answer = api.upload(shared_mesh(f"bad/{name}"))
    problem = answer.json()
    assert answer.status_code == 422
    assert answer.headers["content-type"] == "application/problem+json"
    assert problem["type"] == f"/problems/{slug}"
    assert words in problem["detail"]
    assert api.http.get(problem["type"]).status_code == 200, "each problem has its page"


def test_no_file_of_the_collection_is_left_out() -> None:
    shared_mesh("bad/README.md")
    files = {path.name for path in (SHARED / "bad").iterdir()} - {"README.md"}
    assert files == ACCEPTED.keys() | REFUSED.keys()
