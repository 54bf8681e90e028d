"""Linear finite elements on a triangle mesh: the cotangent stiffness and the lumped mass.

    ∫ ∇φ_i · ∇φ_j = (L)_ij,  L_ij = -½ (cot α + cot β),  L_ii = -Σ_j L_ij
    ∫ φ_i ≈ (M)_ii = ⅓ of the area of the triangles at i

with α and β the angles opposite the edge ij. L is *integrated* (no unit), symmetric and positive semi-definite, its
kernel the constants; M⁻¹L is the *pointwise* Laplacian, positive at a peak. Pinkall and Polthier, "Computing discrete
minimal surfaces and their conjugates", 1993.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from spherify.geometry import measures
from spherify.geometry.mesh import Floats, Ints
from spherify.geometry.topology import Topology

# Triangles are taken for at least this fat, doubled area over the square of the longest edge: below it cotangents
# are made of rounding. A greater area only scales the triangle's part of L down, so L stays semi-definite.
LEAST_FATNESS: Final = 1e-12


def cotangents(V: Floats, F: Ints) -> Floats:
    """(m, 3) cotangent of the angle at each corner; 0 in a triangle that is a point.

    The angles of a triangle thinner than `LEAST_FATNESS` are rounded, so that every cotangent is finite.
    """
    corners = [measures.gather(V, F[:, k]) for k in range(3)]
    sides = [corners[(k + 2) % 3] - corners[(k + 1) % 3] for k in range(3)]  # opposite corner k
    longest = np.maximum.reduce([measures.dot(side, side) for side in sides])
    doubled_area = np.maximum(measures.norm(measures.cross(sides[0], sides[1])), LEAST_FATNESS * longest)
    cot = np.empty((len(F), 3), order="F")
    for k in range(3):
        inner = -measures.dot(sides[(k + 1) % 3], sides[(k + 2) % 3])
        cot[:, k] = np.divide(inner, doubled_area, out=np.zeros(len(F)), where=doubled_area != 0)
    return cot


def edge_weights(V: Floats, topology: Topology) -> Floats:
    """(e,) ½ (cot α + cot β) of each of ``topology.edges``, -L_ij; one cotangent on the boundary.

    Negative where the angles opposite the edge sum to more than π.
    """
    opposite = np.roll(cotangents(V, topology.faces), 1, axis=1)  # half-edge k lies opposite corner k - 1
    return 0.5 * measures.scatter(topology.halfedge_edges, opposite.reshape(-1), len(topology.edges))


def stiffness_diagonal(weights: Floats, topology: Topology) -> Floats:
    """(n,) L_ii: the sum of the `edge_weights` (e,) at each vertex."""
    a, b = topology.edges[:, 0], topology.edges[:, 1]
    n = topology.n_vertices
    total: Floats = measures.scatter(a, weights, n) + measures.scatter(b, weights, n)
    return total


def lumped_masses(areas: Floats, topology: Topology) -> Floats:
    """(n,) M_ii: a third of the ``areas`` (m,) of the faces at each vertex."""
    return measures.sum_at_vertices(areas, topology.faces, topology.n_vertices) / 3
