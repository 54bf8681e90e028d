"""The paper's shapes: closed, genus 0, outward, well shaped, at any resolution, the same every time."""

from __future__ import annotations

import numpy as np
import pytest

from spherify.geometry.errors import InvalidConfigError
from spherify.geometry.measures import norm
from spherify.geometry.metrics import metrics_of
from spherify.geometry.samples import SAMPLES
from spherify.geometry.samples.creatures import Implicit
from spherify.geometry.samples.implicit import surface
from spherify.geometry.samples.solids import cylinder, icosphere
from spherify.geometry.topology import Topology
from tests.geometry.shapes import uneven_sphere

NAMES = ["stone", "quadruped", "sphere-bar", "cube", "cylinder", "non-convex-sphere", "head"]
COARSEST = {"quadruped": 1000, "head": 400, "sphere-bar": 300, "cylinder": 150}


def test_names():
    assert list(SAMPLES) == NAMES
    assert all(sample.name == name for name, sample in SAMPLES.items())


@pytest.mark.parametrize("resolution", [1, 700, 2000])
@pytest.mark.parametrize("name", NAMES)
def test_each_is_a_sound_well_shaped_sphere(name, resolution):
    mesh = SAMPLES[name].build(resolution)
    topology = Topology.of(len(mesh.vertices), mesh.faces)
    assert topology.closed
    assert topology.genus == 0
    assert topology.euler == 2
    assert topology.n_components == 1
    for defects in (
        topology.misoriented_edges,
        topology.nonmanifold_vertices,
        topology.unreferenced_vertices,
    ):
        assert len(defects) == 0
    metrics = metrics_of(mesh.vertices, topology, measure="vtk", step=0)
    assert metrics.volume > 0
    assert metrics.mean_quality > 0.85
    assert metrics.least_quality > 0.15
    wanted = max(resolution, COARSEST.get(name, 42 if name != "cube" else 26))
    assert 0.7 * wanted <= len(mesh.vertices) <= 1.35 * wanted
    again = SAMPLES[name].build(resolution)
    assert again.vertices.tobytes() == mesh.vertices.tobytes()
    assert again.faces.tobytes() == mesh.faces.tobytes()


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("stone", 0.85, 0.95),
        ("quadruped", 0.4, 0.65),
        ("sphere-bar", 0.75, 0.85),
        ("cube", 0.80, 0.81),
        ("cylinder", 0.82, 0.84),
        ("non-convex-sphere", 0.75, 0.85),
        ("head", 0.8, 0.88),
    ],
)
def test_how_far_each_is_from_a_sphere(name, low, high):
    mesh = SAMPLES[name].build(1000)
    topology = Topology.of(len(mesh.vertices), mesh.faces)
    assert low < metrics_of(mesh.vertices, topology, measure="vtk", step=0).sphericity < high


def test_the_quadruped_stands_on_four_feet_and_has_a_tail_two_ears_and_a_muzzle():
    x, y, z = SAMPLES["quadruped"].build(2562).vertices.T

    def pieces(selected):
        """Number of separate clusters of points, by gaps wider than a foot is long."""
        points, left, count = np.stack([x, y, z], axis=1)[selected], None, 0
        left = np.ones(len(points), dtype=bool)
        while left.any():
            count += 1
            front = [int(np.flatnonzero(left)[0])]
            left[front[0]] = False
            while front:
                near = left & (norm(points - points[front.pop()]) < 0.15)
                left[near] = False
                front += [int(i) for i in np.flatnonzero(near)]
        return count

    assert pieces(z < 0.25) == 4
    assert pieces((x < -1.5) & (z > 0.5)) == 1
    assert pieces(z > 1.9) == 2
    assert pieces(x > 1.6) == 1


def test_icospheres_are_round_and_even():
    for frequency in (1, 2, 5, 16):
        mesh = icosphere(frequency)
        assert len(mesh.vertices) == 10 * frequency**2 + 2
        np.testing.assert_allclose(norm(mesh.vertices), 1, rtol=1e-14)
        lengths = norm(
            np.diff(mesh.vertices[Topology.of(len(mesh.vertices), mesh.faces).edges], axis=1)[:, 0]
        )
        assert lengths.max() / lengths.min() < 1.35
        np.testing.assert_allclose(mesh.vertices.mean(axis=0), 0, atol=1e-14)


def test_the_cylinder_has_flat_ends_and_the_stated_size():
    x, y, z = cylinder(2000).vertices.T
    radius = np.hypot(x, y)
    assert radius.max() == pytest.approx(1)
    assert z.max() == pytest.approx(2)
    assert ((np.abs(np.abs(z) - 2) < 1e-12) | (np.abs(radius - 1) < 1e-12)).all()


def test_a_body_that_is_no_sphere_is_refused():
    ring = Implicit(
        lambda P: np.hypot(np.hypot(P[:, 0], P[:, 1]) - 1, P[:, 2]) - 0.4,
        (-1.5, -1.5, -0.5),
        (1.5, 1.5, 0.5),
        100,
    )
    with pytest.raises(InvalidConfigError, match="closed and of genus 0"):
        surface(ring, 300)


def test_the_uneven_sphere_of_these_tests_is_round_and_uneven():
    mesh = uneven_sphere(8)
    metrics = metrics_of(mesh.vertices, Topology.of(len(mesh.vertices), mesh.faces), measure="vtk", step=0)
    assert metrics.radius_ratio > 0.9999
    assert metrics.least_quality < 0.8
    assert metrics.inward_faces == 0
