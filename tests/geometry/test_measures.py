"""Lengths, angles, areas and volumes where they are known, and how they converge where they are limits."""

from __future__ import annotations

import math

import numpy as np
import pytest

from spherify.geometry import measures
from spherify.geometry.curvature import vertex_curvature
from spherify.geometry.mesh import TriangleMesh
from spherify.geometry.quality import all_outward, inward_faces, triangle_quality
from spherify.geometry.roundness import shape_of, sphericity
from spherify.geometry.samples.solids import icosphere
from spherify.geometry.topology import Topology
from tests.geometry.shapes import icosahedron, octahedron, open_bump, prism, sample, tetrahedron


def topology_of(mesh):
    return Topology.of(len(mesh.vertices), mesh.faces)


def angles(mesh):
    topology = topology_of(mesh)
    normals = measures.face_normals(mesh.vertices, mesh.faces)
    return measures.dihedral_angles(
        mesh.vertices, topology.interior_edges, topology.interior_edge_faces, normals
    )


def total_mean_curvature(mesh):
    """Σ l·θ over the edges: twice the integral of the mean curvature."""
    lengths = measures.edge_lengths(mesh.vertices, topology_of(mesh).interior_edges)
    return float((lengths * angles(mesh)).sum())


@pytest.mark.parametrize("seed", range(5))
def test_faces_that_lie_on_each_other_are_folded_by_half_a_turn(seed):
    corners = np.random.default_rng(seed).normal(size=(3, 3))
    for faces in ([[0, 1, 2], [0, 2, 1]], [[2, 1, 0], [1, 2, 0]]):
        pillow = TriangleMesh(corners, np.array(faces))
        np.testing.assert_array_equal(angles(pillow), math.pi)
        normals = measures.face_normals(corners, pillow.faces)
        np.testing.assert_array_equal(measures.vertex_normals(normals, pillow.faces, 3), 0)


# Inner dihedral angles of the Platonic solids with triangles.
PLATONIC = {
    "tetrahedron": (tetrahedron(), math.acos(1 / 3), 3),
    "octahedron": (octahedron(), math.acos(-1 / 3), 4),
    "icosahedron": (icosahedron(), math.acos(-math.sqrt(5) / 3), 5),
}


@pytest.mark.parametrize("name", PLATONIC)
def test_platonic_solids(name):
    mesh, inner, degree = PLATONIC[name]
    theta = math.pi - inner
    np.testing.assert_allclose(angles(mesh), theta, rtol=1e-14)
    edge = float(measures.edge_lengths(mesh.vertices, topology_of(mesh).edges)[0])
    area = math.sqrt(3) / 4 * edge**2
    expected = {
        "length": edge * theta,
        "vtk": 1.5 * edge * theta / (2 * area),
        "dual-area": degree * edge * theta / 4 / (degree * area / 3),
    }
    for measure, value in expected.items():
        np.testing.assert_allclose(
            vertex_curvature(mesh.vertices, topology_of(mesh), measure), value, rtol=1e-14
        )
    np.testing.assert_allclose(triangle_quality(mesh.vertices, mesh.faces), 1, rtol=1e-14)


def test_edges_of_a_cube_and_of_a_prism():
    """Steiner: Σ l·θ of a polyhedron is its edges times their turn."""
    assert total_mean_curvature(sample("cube", 26)) == pytest.approx(12 * 2 * math.pi / 2)
    for sides in (3, 6, 50):
        side = 2 * math.sin(math.pi / sides)
        expected = 2 * sides * side * math.pi / 2 + sides * 2.0 * (2 * math.pi / sides)
        assert total_mean_curvature(prism(sides, 2.0)) == pytest.approx(expected)


def test_a_long_prism_has_the_curvature_of_a_cylinder():
    """Per length and circumference: 1/(2r), from the edges along it; Σ lθ/2 = ∫H dA, rims apart."""
    sides, height, rims = 200, 1000.0, math.pi * 2 * math.pi
    mesh = prism(sides, height)
    assert (total_mean_curvature(mesh) - rims) / 2 / (2 * math.pi * height) == pytest.approx(0.5, rel=1e-4)


def test_reversed_winding_flips_every_sign():
    mesh = sample("non-convex-sphere", 252)
    flipped = TriangleMesh.checked(mesh.vertices, mesh.faces[:, ::-1])
    np.testing.assert_allclose(angles(flipped), -angles(mesh), atol=1e-14)
    for measure in ("vtk", "length", "dual-area"):
        K = vertex_curvature(mesh.vertices, topology_of(mesh), measure)
        np.testing.assert_allclose(
            vertex_curvature(mesh.vertices, topology_of(flipped), measure), -K, atol=1e-13
        )
    origin = np.zeros(3)
    volume = measures.volume(mesh.vertices, mesh.faces, origin)
    assert measures.volume(mesh.vertices, flipped.faces, origin) == pytest.approx(-volume)
    assert volume > 0


def test_convex_edges_are_positive_and_dents_negative():
    assert (angles(icosphere(6)) > 0).all()
    dented = sample("non-convex-sphere", 642)
    assert angles(dented).min() < -0.1


def order(errors):
    """Exponent of the mesh width by which errors at halved widths fall, at the finest level."""
    return math.log2(errors[-2] / errors[-1])


def test_orders_on_the_sphere():
    area, volume, roundness, total = [], [], [], []
    for frequency in (4, 8, 16, 32):
        mesh = icosphere(frequency)
        shape = shape_of(mesh.vertices, topology_of(mesh))
        area.append(4 * math.pi - shape.area)
        volume.append(4 * math.pi / 3 - shape.volume)
        roundness.append(1 - shape.sphericity)
        total.append(abs(total_mean_curvature(mesh) - 8 * math.pi))
        assert shape.radius_variation < 1e-14
    for errors in (area, volume, roundness, total):
        assert order(errors) == pytest.approx(2, abs=0.02)
    assert roundness[-1] == pytest.approx(6.2e-5, rel=0.05)


def test_total_mean_curvature_of_a_long_ellipsoid():
    """Prolate, half axes 1, 1, 2: ∫H dA = 2π·(c + a²/√(c²-a²)·artanh-type); by quadrature of H over the surface."""
    u = (np.arange(20000) + 0.5) * math.pi / 20000
    a, c = 1.0, 2.0
    w = np.sqrt((a * np.cos(u)) ** 2 + (c * np.sin(u)) ** 2)
    profile = a * c / w**3 / 2 + c / (a * w) / 2
    expected = 2 * float((profile * 2 * math.pi * a * np.sin(u) * w).sum()) * math.pi / 20000
    errors = []
    for frequency in (8, 16, 32):
        mesh = icosphere(frequency)
        mesh = mesh.with_vertices(mesh.vertices * np.array([a, a, c]))
        errors.append(abs(total_mean_curvature(mesh) - expected))
    assert order(errors) == pytest.approx(2, abs=0.1)


def test_pointwise_measures_are_one_on_the_unit_sphere():
    mesh = icosphere(16)
    for measure in ("vtk", "dual-area"):
        K = vertex_curvature(mesh.vertices, topology_of(mesh), measure)
        assert float(K.mean()) == pytest.approx(1, abs=0.01)
        # Not each of them in the limit: at the twelve vertices of five edges the triangles stay unequal.
        np.testing.assert_allclose(K, 1, atol=0.15)


def test_sphericity_of_known_solids():
    assert sphericity(4 * math.pi, 4 * math.pi / 3) == pytest.approx(1, abs=1e-15)
    cube = sample("cube", 26)
    assert shape_of(cube.vertices, topology_of(cube)).sphericity == pytest.approx((math.pi / 6) ** (1 / 3))
    assert sphericity(0, 0) == 0


def test_volume_of_an_open_surface_is_that_of_the_cone_over_its_centroid():
    mesh = open_bump()
    shape = shape_of(mesh.vertices, topology_of(mesh))
    assert shape.volume == pytest.approx(measures.volume(mesh.vertices + 7, mesh.faces, shape.centroid + 7))
    assert shape.volume != pytest.approx(measures.volume(mesh.vertices, mesh.faces, np.zeros(3)))


def test_degenerate_triangles_have_no_normal_and_no_quality():
    V = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 0, 0]])
    F = np.array([[0, 1, 2], [0, 3, 0]])
    assert (measures.face_normals(V, F) == 0).all()
    assert (triangle_quality(V, F) == 0).all()
    assert (measures.least_altitudes(V, F, measures.face_areas(V, F)) == 0).all()
    assert inward_faces(V, F, np.array([0.0, 0, -1])) == 2


def test_whether_all_faces_look_outward_and_have_some_area():
    mesh, centre = icosphere(4), np.array([0.1, 0.0, 0.0])
    areas = measures.face_areas(mesh.vertices, mesh.faces)
    least = float(areas.min() / areas.mean())
    assert all_outward(mesh.vertices, mesh.faces, centre, 0.999 * least)
    assert not all_outward(mesh.vertices, mesh.faces, centre, 1.001 * least)
    turned = mesh.faces.copy()
    turned[7] = turned[7][::-1]
    assert not all_outward(mesh.vertices, turned, centre, 0.0)
    flat = mesh.faces.copy()
    flat[7, 1] = flat[7, 0]
    assert not all_outward(mesh.vertices, flat, centre, 0.0)


def test_inward_faces_are_counted_one_by_one():
    mesh = icosphere(3)
    for count in (0, 1, 7):
        faces = mesh.faces.copy()
        faces[:count] = faces[:count, ::-1]
        assert inward_faces(mesh.vertices, faces, np.zeros(3)) == count


def test_a_shape_is_the_sum_of_its_faces_to_the_last_bit_however_many_blocks_they_are():
    rng = np.random.default_rng(5)
    for mesh in (icosphere(3), icosphere(30)):
        assert (len(mesh.faces) > 3 * measures.BLOCK) == (len(mesh.faces) > 1_000)
        V, F, topology = mesh.vertices * rng.uniform(0.9, 1.1, 3), mesh.faces, topology_of(mesh)
        shape, areas = shape_of(V, topology), measures.face_areas(V, F)
        assert shape.area == areas.sum()
        assert np.array_equal(shape.centroid, measures.area_centroid(V, F, areas))
        assert shape.volume == measures.volume(V, F, shape.centroid)
        assert shape.mean_edge == measures.edge_lengths(V, topology.edges).mean()


def test_every_block_is_looked_at_for_faces_that_look_inward():
    mesh = icosphere(30)
    assert all_outward(mesh.vertices, mesh.faces, np.zeros(3), 0.1)
    for face in (0, measures.BLOCK, len(mesh.faces) - 1):
        faces = mesh.faces.copy()
        faces[face] = faces[face, ::-1]
        assert not all_outward(mesh.vertices, faces, np.zeros(3), 0.0)


def test_a_shape_knows_by_the_way_that_all_faces_look_outward_or_knows_nothing():
    rng, topology = np.random.default_rng(6), topology_of(icosphere(3))
    known = 0
    for amount in (*np.linspace(0, 0.5, 40), 1e-9):
        V = 3 * icosphere(3).vertices + amount * rng.standard_normal((topology.n_vertices, 3))
        shape = shape_of(V, topology)
        areas = measures.face_areas(V, topology.faces)
        assert shape.least_area == areas.min() / areas.mean()
        assert shape.outward == all_outward(V, topology.faces, shape.centroid, 0.0)
        known += shape.outward
    assert 10 < known < 40
    assert not shape_of(np.zeros_like(V), topology).outward
    tip = V.copy()
    tip[topology.edges[0, 0]] = tip[topology.edges[0, 1]] * (
        1 + 1e-14
    )  # outward or not: only rounding would say
    assert not shape_of(tip, topology).outward
