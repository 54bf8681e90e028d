"""Real meshes, good and bad, by the tables that came with them."""

from __future__ import annotations

import pytest

from spherify.formats import ALLOW, MeshRefusedError, ReadLimits, read_mesh
from tests.shared import SHARED, shared_mesh

PATIENT = ReadLimits(seconds=100)  # what is tried here is the reading, not how busy the machine is

GOOD = {
    "spot.obj": (2930, 5856, 0.679),
    "cat-low-resolution.obj": (7949, 15894, 0.578),
    "koala.obj": (49999, 99994, 0.630),
    "castalia.obj": (2048, 4092, 0.868),
    "216Kleopatra.obj": (2048, 4092, 0.737),
    "nefertiti-lowres.obj": (35002, 70000, 0.681),
    "decimated-max.obj": (5272, 10540, 0.827),
    "20mm-xyz-cube.stl": (132, 260, 0.770),
    "cylinder.stl": (210, 416, 0.733),
    "bumpy-cube.obj": (19970, 39936, 0.852),
    "sharp_sphere.off": (10443, 20882, 0.541),
    "sphere.3mf": (1442, 2880, 1.000),
    "scallop.glb": (60002, 120000, 0.740),
    "turbineblade.ply": (99519, 199034, 0.428),
}

# Awkward, and taken: vertices, faces, sphericity, what was mended.
MENDED = {
    "inside_out_horse_big_endian.ply": (48485, 96966, 0.554, ["turned-outward"]),
    "quads_fish.obj": (112, 220, 0.488, ["triangulated"]),
    "unwelded_cube.ply": (8, 12, 0.806, ["triangulated", "welded"]),
    "tristrips_igea_134k.ply": (134345, 268686, 0.878, []),
    "unreferenced_vertices_airplane.obj": (5400, 10796, 0.443, ["unused-vertices"]),
    "ascii_ply_blank_line.ply": (8, 12, 0.806, ["triangulated"]),
}

REFUSED = {
    "open_face_scan.obj": ("mesh-not-closed", ["168 edges have one face only, around 1 hole"]),
    "open_bunny_ascii_extra_props.ply": ("mesh-not-closed", ["223 edges have one face only, around 5 holes"]),
    "genus1_kitten.obj": ("mesh-genus", ["genus 1"]),
    "genus2_double_torus.obj": ("mesh-genus", ["genus 2"]),
    "three_components_dumbbell.obj": ("mesh-not-connected", ["3 components, of 420, 420, 76 faces"]),
    "nonmanifold_edge_tetrahedra.obj": ("mesh-not-manifold", ["3 edges have more than two faces", "has 4"]),
    "nonmanifold_vertex_hourglass.obj": ("mesh-not-manifold", ["1 vertex joins parts", "at vertex 22"]),
    "nonorientable_moebius_quads.obj": (
        "mesh-not-oriented",
        ["one side only", "Also: The mesh is not closed"],
    ),
    "inverted_triangles.obj": ("mesh-not-oriented", ["23889 edges", "Also: The mesh is not closed"]),
    "triangle_soup.stl": ("mesh-not-closed", ["300 edges", "Also: The mesh has 100 components"]),
    "test-nan.obj": ("mesh-not-parsable", ["Line 12", "not a finite number"]),
    "zero_face_index.obj": (
        "mesh-not-parsable",
        ["Line 16: a face names vertex 0", "counts vertices from 1"],
    ),
    "empty_binary.stl": ("mesh-not-parsable", ["no faces"]),
    "point_cloud.ply": ("mesh-not-parsable", ["no faces, only 5 points"]),
}

# What the switches let in.
ALLOWED = {
    "open_face_scan.obj": ("boundary", 17157, 34144),
    "open_bunny_ascii_extra_props.ply": ("boundary", 34834, 69451),
    "genus1_kitten.obj": ("genus", 9447, 18894),
    "three_components_dumbbell.obj": ("components", 212, 420),
    "nonmanifold_vertex_hourglass.obj": ("nonmanifold-vertex", 23, 40),
}


@pytest.mark.parametrize("name", GOOD)
def test_good_meshes_are_taken_as_they_are(name: str):
    report = read_mesh(shared_mesh(name), name, limits=PATIENT).report
    vertices, faces, sphericity = GOOD[name]
    assert (report.vertices, report.faces, report.genus, report.components) == (vertices, faces, 0, 1)
    assert report.sphericity == pytest.approx(sphericity, abs=5e-4)
    assert report.volume > 0
    assert {repair.code for repair in report.repairs} <= {"welded"}


@pytest.mark.parametrize("name", MENDED)
def test_awkward_meshes_are_mended(name: str):
    report = read_mesh(shared_mesh(f"bad/{name}"), name, limits=PATIENT).report
    vertices, faces, sphericity, repairs = MENDED[name]
    assert (report.vertices, report.faces, report.genus) == (vertices, faces, 0)
    assert report.sphericity == pytest.approx(sphericity, abs=5e-4)
    assert [repair.code for repair in report.repairs] == repairs


@pytest.mark.parametrize("name", REFUSED)
def test_bad_meshes_get_their_answer(name: str):
    code, words = REFUSED[name]
    with pytest.raises(MeshRefusedError) as refusal:
        read_mesh(shared_mesh(f"bad/{name}"), name, limits=PATIENT)
    assert refusal.value.code == code
    assert [word for word in words if word not in str(refusal.value)] == []


@pytest.mark.parametrize("name", ALLOWED)
def test_switches_let_in_what_can_be_run(name: str):
    switch, vertices, faces = ALLOWED[name]
    report = read_mesh(shared_mesh(f"bad/{name}"), name, limits=PATIENT, allow=[switch]).report
    assert (report.vertices, report.faces, report.eligible, report.allowed) == (
        vertices,
        faces,
        True,
        (switch,),
    )


@pytest.mark.parametrize("name", ["nonmanifold_edge_tetrahedra.obj", "nonorientable_moebius_quads.obj"])
def test_no_switch_lets_in_what_cannot(name: str):
    with pytest.raises(MeshRefusedError):
        read_mesh(shared_mesh(f"bad/{name}"), name, limits=PATIENT, allow=ALLOW)


def test_every_bad_mesh_has_its_answer():
    if not SHARED.exists():
        pytest.skip("the shared meshes are not on this machine")
    names = {path.name for path in (SHARED / "bad").iterdir()} - {"README.md"}
    assert names == MENDED.keys() | REFUSED.keys()
    assert {path.name for path in SHARED.iterdir() if path.is_file()} - {"README.md"} == GOOD.keys()
