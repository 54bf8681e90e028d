from __future__ import annotations

import numpy as np
import pytest

from spherify.geometry.fields import FIELDS, FieldName, best_fit_sphere, vertex_field
from spherify.geometry.mesh import TriangleMesh
from spherify.geometry.samples import SAMPLES
from tests.geometry.shapes import icosphere

SCALES = (1e-25, 1.0, 1e25)


@pytest.mark.parametrize("scale", SCALES)
def test_a_sphere_has_the_fields_of_a_sphere(scale: float) -> None:
    unit = icosphere(3)
    place = scale * np.array([3.0, -2.0, 5.0])
    mesh = TriangleMesh.checked(unit.vertices * scale + place, unit.faces)
    fields = {name: vertex_field(name, mesh, mesh.vertices) for name in FIELDS}
    assert np.abs(fields["curvature"] * scale - 1).max() < 0.2  # 1 but for the vertices of degree 5
    assert np.abs(fields["distance"]).max() < 1e-12
    assert (fields["displacement"] == 0).all()
    assert 0.8 < fields["quality"].min() <= fields["quality"].max() <= 1


def test_the_best_fit_sphere_is_found_from_an_uneven_part_and_whatever_the_place() -> None:
    mesh = icosphere(3)
    centre, radius = np.array([1e4, 2.0, -3e3]), 7.0
    found, r = best_fit_sphere(mesh.vertices * radius + centre, mesh.faces)
    assert np.allclose(found, centre, atol=1e-7)
    assert r == pytest.approx(radius, rel=1e-9)
    upper = mesh.faces[(mesh.vertices[mesh.faces][:, :, 2] > 0).all(axis=1)]
    assert best_fit_sphere(mesh.vertices, upper)[1] == pytest.approx(1, rel=1e-9)


def test_distance_is_positive_outside_the_sphere_and_counts_area_rather_than_vertices() -> None:
    mesh = icosphere(3)
    V = mesh.vertices.copy()
    V[0] *= 1.5
    distance = vertex_field("distance", mesh, V)
    assert distance.argmax() == 0
    assert 0.3 < distance[0] < 0.5


def test_displacement_counts_in_mean_edges_of_the_start() -> None:
    mesh = SAMPLES["cube"].build(600)
    edges = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])
    ends = mesh.vertices[edges]
    mean_edge = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).mean()  # each edge twice: the same mean
    moved = vertex_field("displacement", mesh, mesh.vertices + np.array([0, 0, 2 * mean_edge]))
    assert np.allclose(moved, 2)


def test_quality_is_that_of_the_worst_triangle() -> None:
    mesh = icosphere(2)
    V = mesh.vertices.copy()
    a, b, c = mesh.faces[0]
    V[a] = (V[b] + V[c]) / 2  # the first triangle is flat now
    quality = vertex_field("quality", mesh, V)
    assert np.allclose(quality[[a, b, c]], 0, atol=1e-12)
    apart = np.setdiff1d(np.arange(len(V)), mesh.faces[(mesh.faces == a).any(axis=1)])
    assert quality[apart].min() > 0.8


@pytest.mark.parametrize("name", FIELDS)
def test_fields_do_not_depend_on_the_numbering(name: FieldName) -> None:
    mesh = SAMPLES["stone"].build(600)
    order = np.random.default_rng(1).permutation(len(mesh.vertices))
    place = np.argsort(order)
    other = TriangleMesh.checked(mesh.vertices[order], place[mesh.faces])
    V = mesh.vertices * [1.0, 1.1, 0.9]
    assert np.allclose(vertex_field(name, other, V[order]), vertex_field(name, mesh, V)[order])
