"""Stiffness and mass, against what is known exactly and against elements computed one by one; and their solver."""

from __future__ import annotations

import numpy as np
import pytest

from spherify.geometry import measures
from spherify.geometry.laplacian import cotangents, edge_weights, lumped_masses, stiffness_diagonal
from spherify.geometry.mesh import TriangleMesh
from spherify.geometry.samples.solids import icosphere
from spherify.geometry.sparse import SymmetricSolver
from spherify.geometry.topology import Topology
from tests.geometry.shapes import ROUNDING, open_bump, sample, small_samples

MESHES = small_samples()


def stiffness(mesh):
    """L as a full matrix."""
    topology = Topology.of(len(mesh.vertices), mesh.faces)
    weights = edge_weights(mesh.vertices, topology)
    L = np.diag(stiffness_diagonal(weights, topology))
    a, b = topology.edges.T
    L[a, b] = L[b, a] = -weights
    return L


def masses(mesh):
    topology = Topology.of(len(mesh.vertices), mesh.faces)
    return lumped_masses(measures.face_areas(mesh.vertices, mesh.faces), topology)


def stiffness_by_elements(mesh):
    """∫ ∇φ_i · ∇φ_j, a triangle at a time, from the gradients of the hat functions."""
    L = np.zeros((len(mesh.vertices),) * 2)
    for face in mesh.faces:
        p = mesh.vertices[face]
        doubled = np.cross(p[1] - p[0], p[2] - p[0])
        area = np.linalg.norm(doubled) / 2
        gradients = [
            np.cross(doubled, p[(k + 2) % 3] - p[(k + 1) % 3]) / np.dot(doubled, doubled) for k in range(3)
        ]
        for i in range(3):
            for j in range(3):
                L[face[i], face[j]] += area * np.dot(gradients[i], gradients[j])
    return L


@pytest.mark.parametrize("name", MESHES)
class TestEveryMesh:
    def test_stiffness_is_that_of_the_elements(self, name):
        L = stiffness(MESHES[name])
        expected = stiffness_by_elements(MESHES[name])
        assert abs(L - expected).max() <= 10 * ROUNDING * abs(expected).max()

    def test_constants_are_its_kernel_and_no_other_function(self, name):
        L = stiffness(MESHES[name])
        assert abs(L.sum(axis=1)).max() <= ROUNDING * abs(L).max()
        eigenvalues = np.linalg.eigvalsh(L)
        assert eigenvalues[0] >= -ROUNDING * eigenvalues[-1]
        assert eigenvalues[1] > 1e-4 * eigenvalues[-1]

    def test_the_energy_of_the_positions_is_twice_the_area(self, name):
        """Σ xᵀLx over the coordinates is ∫ |∇p|², and the identity of a surface has |∇p|² = 2."""
        mesh = MESHES[name]
        area = measures.face_areas(mesh.vertices, mesh.faces).sum()
        energy = np.sum(mesh.vertices * (stiffness(mesh) @ mesh.vertices))
        assert energy == pytest.approx(2 * area, rel=ROUNDING)
        assert masses(mesh).sum() == pytest.approx(area, rel=ROUNDING)

    def test_turning_and_scaling_change_nothing_that_they_should_not(self, name):
        mesh = MESHES[name]
        turn, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
        other = mesh.with_vertices(7 * mesh.vertices @ turn.T + [1, 2, 3])
        assert stiffness(other) == pytest.approx(stiffness(mesh), rel=1e-9, abs=1e-9)
        assert masses(other) == pytest.approx(49 * masses(mesh), rel=1e-9)


def test_linear_functions_are_harmonic_in_the_plane():
    flat = open_bump(9).vertices * [1, 1, 0] + np.random.default_rng(3).uniform(-0.05, 0.05, (81, 3)) * [
        1,
        1,
        0,
    ]
    mesh = TriangleMesh.checked(flat, open_bump(9).faces)
    inner = np.setdiff1d(np.arange(81), Topology.of(81, mesh.faces).boundary_vertices)
    linear = mesh.vertices @ [2.0, -3.0, 0.0] + 1
    assert abs(stiffness(mesh) @ linear)[inner].max() < ROUNDING * 100
    assert abs(stiffness(mesh) @ linear**2)[inner].max() > 0.1


def test_eigenvalues_of_the_sphere_are_met_to_second_order():
    """-Δf = 6f / r² for the harmonic f = xy on a sphere of radius r; for coordinates it is 2x / r², exactly."""
    errors = []
    for frequency in (4, 8, 16):
        mesh = icosphere(frequency)
        mesh = mesh.with_vertices(3 * mesh.vertices)
        x, y, _ = mesh.vertices.T
        assert quotient(mesh, x) == pytest.approx(2 / 9, rel=ROUNDING)
        errors.append(abs(quotient(mesh, x * y) - 6 / 9))
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([2, 2], abs=0.1)


def quotient(mesh, f):
    """Rayleigh's quotient of a function."""
    topology = Topology.of(len(f), mesh.faces)
    a, b = topology.edges.T
    energy = np.sum(edge_weights(mesh.vertices, topology) * (f[a] - f[b]) ** 2)
    return energy / np.sum(masses(mesh) * f**2)


def test_triangles_without_area_leave_everything_finite_and_semi_definite():
    V = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1, 0], [1, -1, 0], [1, -1, 0]]
    mesh = TriangleMesh.checked(V, [[0, 1, 2], [0, 2, 3], [0, 4, 1], [1, 4, 2], [4, 5, 2]])
    assert np.isfinite(cotangents(mesh.vertices, mesh.faces)).all()
    eigenvalues = np.linalg.eigvalsh(stiffness(mesh))
    assert eigenvalues[0] >= -ROUNDING * eigenvalues[-1]
    point = TriangleMesh.checked(np.zeros((3, 3)), [[0, 1, 2]])
    assert (cotangents(point.vertices, point.faces) == 0).all()


class TestSolver:
    mesh = sample("quadruped", 300)
    topology = Topology.of(len(mesh.vertices), mesh.faces)

    def system(self, seed=0):
        rng = np.random.default_rng(seed)
        off = -rng.uniform(0.1, 1, len(self.topology.edges))
        diagonal = stiffness_diagonal(-off, self.topology) + rng.uniform(0.01, 1, len(self.mesh.vertices))
        return diagonal, off, rng.normal(size=(len(self.mesh.vertices), 3))

    def test_solves_one_system_after_another(self):
        solver = SymmetricSolver(len(self.mesh.vertices), self.topology.edges)
        for seed in (0, 1):
            diagonal, off, B = self.system(seed)
            A = np.diag(diagonal)
            a, b = self.topology.edges.T
            A[a, b] = A[b, a] = off
            assert solver.solve(diagonal, off, B) == pytest.approx(np.linalg.solve(A, B), rel=1e-9, abs=1e-9)

    def test_the_same_bits_whatever_was_solved_before(self):
        used, fresh = (SymmetricSolver(len(self.mesh.vertices), self.topology.edges) for _ in range(2))
        used.solve(*self.system(1))
        assert used.solve(*self.system()).tobytes() == fresh.solve(*self.system()).tobytes()

    def test_no_solution_is_none(self):
        solver = SymmetricSolver(len(self.mesh.vertices), self.topology.edges)
        diagonal, off, B = self.system()
        assert solver.solve(0 * diagonal, 0 * off, B) is None
        assert solver.solve(diagonal * np.nan, off, B) is None
        assert solver.solve(diagonal, off * np.inf, B) is None
