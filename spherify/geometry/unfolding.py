"""Unfolding on the sphere: a nearly round surface becomes star-shaped, limbs that sank in as folded strings included.

Seen from the centre c every vertex has a direction u = (p - c) / |p - c| and a radius |p - c|. If the triangles of the
directions all face outward, no radii whatever can make a face look inward. So the two are treated apart: the
transformation moves radii, and each direction is drawn to the weighted mean of its neighbours' directions,

    u ← normalised(u + φ (m - (m·u) u)),  m = Σ w_q q / Σ w_q,  log w_q = e · smoothed log(area of the triangles at q)

As convex combinations these unfold (Tutte, "How to draw a graph", 1963; Floater, "Parametrization and smooth
approximation of surface triangulations", 1997). Uniform weights shrink a limb of length l and radius r to a tip of
exp(-2 l/r) of the area; weights that grow with the area as above to exp(-2 l / (r √(1 + 4e))). They depend on what they
bring about, so they are smoothed along the surface and only approached, or they would swing to and fro.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from spherify.geometry import measures
from spherify.geometry.mesh import Floats, Ints
from spherify.geometry.topology import Topology

FRACTION: Final = 0.6  # φ
SMOOTHINGS: Final = (
    8  # of the logarithms of the areas: a vertex and the mean of its neighbours, half and half
)
LEAST_LOG_WEIGHT: Final = -600.0  # e^-600: sums of weights do not vanish
LEAST_AREA: Final = 1e-300  # under a logarithm


@dataclass(frozen=True, eq=False, slots=True)
class Unfolded:
    """What some rounds led to.

    Attributes:
        positions: (n, 3)
        log_weights: (n,) log w, 0 the greatest.
        inward: number of faces that look towards the centre.
        least_area: least area of a triangle of the directions over their mean area.

    """

    positions: Floats
    log_weights: Floats
    inward: int
    least_area: float


def unfolded(
    V: Floats,
    topology: Topology,
    centre: Floats,
    log_weights: Floats,
    *,
    exponent: float,
    damping: float,
    rounds: int,
) -> Unfolded:
    """Bring the weights up to date once, then draw all directions at once, ``rounds`` times; radii stay.

    Args:
        V: (n, 3) positions.
        topology: of the mesh, closed.
        centre: (3,) c.
        log_weights: (n,) log w so far.
        exponent: e.
        damping: share of the way the logarithms of the weights go, in (0, 1]; 1 forgets those so far.
        rounds: how often.

    """
    F, n = topology.faces, topology.n_vertices
    a, b = topology.edges[:, 0], topology.edges[:, 1]

    def around(values: Floats) -> Floats:
        """Sum (n,) or (n, 3) over the neighbours."""
        total: Floats = measures.scatter(a, values[b], n) + measures.scatter(b, values[a], n)
        return total

    spokes = V - centre
    radii = measures.norm(spokes)[:, None]
    U = spokes / radii
    level = np.log(np.maximum(measures.sum_at_vertices(measures.face_areas(U, F), F, n), LEAST_AREA))
    degrees = around(np.ones(n))
    for _ in range(SMOOTHINGS):
        level = 0.5 * (level + around(level) / degrees)
    log_weights = log_weights + damping * (exponent * level - log_weights)
    log_weights = np.maximum(log_weights - log_weights.max(), LEAST_LOG_WEIGHT)
    weights = np.exp(log_weights)
    total = around(weights)[:, None]
    weights = weights[:, None]
    for _ in range(rounds):
        mean = around(weights * U) / total
        U = measures.normalised(U + FRACTION * (mean - measures.dot(mean, U)[:, None] * U))
    inward, least_area = folds(U, F)
    return Unfolded(np.asfortranarray(centre + radii * U), log_weights, inward, least_area)


def folds(U: Floats, F: Ints) -> tuple[int, float]:
    """Count the triangles of directions U (n, 3) that look inward; and their least area over their mean."""
    vectors = measures.area_vectors(U, F)
    areas = measures.norm(vectors)
    inward = int((measures.dot(vectors, measures.gather(U, F[:, 0])) <= 0).sum())
    return inward, float(areas.min() / areas.mean())
