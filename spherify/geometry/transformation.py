"""The elementary steps I_C and O_C, and what is ours around them: window, step bound, relaxation, rescaling.

Vartziotis, section 2, eqs. 2 and 3. C is a length; t lies in [0, 1]; a vertex moves along its normal by at most C.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, TypeAlias

import numpy as np

from spherify.geometry import measures
from spherify.geometry.mesh import Floats, Ints
from spherify.geometry.topology import Topology

Direction: TypeAlias = Callable[[Floats], Floats]  # I or O: t to signed distance in units of C

# Curvatures that differ by less than this, relative to the largest, are equal. Rounding leaves some 1e-15 between
# the vertices of a Platonic solid, and some 1e-16 times the aspect ratio of the triangles on a flat face; a mesh
# whose curvature truly varies by 1e-10 is a sphere for every purpose.
EQUAL_CURVATURE: Final = 1e-10


def normalised_curvature(K: Floats, window: tuple[float, float]) -> Floats | None:
    """(n,) t = (K - K_min) / (K_max - K_min), clipped to [0, 1]; None when K is constant.

    K_min and K_max are the given percentiles of K, linearly interpolated; (0, 100) are the extremes of the paper.
    Where most vertices lie on flat faces both percentiles can fall on the same curvature, which would leave t
    undefined on a mesh that is not round: then the extremes are taken.
    """
    least_width = EQUAL_CURVATURE * float(np.abs(K).max())
    for percentiles in (window, (0.0, 100.0)):
        K_min, K_max = (float(K_at) for K_at in np.percentile(K, percentiles))
        if not K_max - K_min <= least_width:  # what is not a number goes on and is caught as a collapse
            return np.clip((K - K_min) / (K_max - K_min), 0, 1)
    return None


def inward(t: Floats) -> Floats:
    """(n,) signed distance along the normal, in units of C, of I_C(p) = p - C·t·n_p (eq. 2)."""
    return -t


def outward(t: Floats) -> Floats:
    """(n,) signed distance along the normal, in units of C, of O_C(p) = p + C·(1 - t)·n_p (eq. 3)."""
    return 1 - t


def bounded(distance: Floats, bound: float, V: Floats, F: Ints, areas: Floats) -> Floats:
    """(n,) distances cut to ± ``bound`` times the least altitude of the triangles at each vertex. Ours.

    Thin parts and small triangles then move no further than their own size allows.
    """
    altitudes = measures.least_altitudes(V, F, areas)
    least = np.full(len(V), np.inf)
    np.minimum.at(least, F.reshape(-1), np.repeat(altitudes, 3))
    return np.clip(distance, -bound * least, bound * least)


def neighbour_weights(F: Ints, areas: Floats, exponent: float, n: int) -> Floats:
    """(n,) weight of each vertex as a neighbour: (sum of the areas of the triangles at it)^exponent. Ours.

    0 is uniform; 1 draws crowded regions apart. Relative to the largest, so that no power overflows.
    """
    if exponent == 0:
        return np.ones(n)
    at_vertices = measures.sum_at_vertices(areas, F, n)
    weights: Floats = (at_vertices / at_vertices.max()) ** exponent
    return weights


def relaxed(V: Floats, normals: Floats, topology: Topology, weights: Floats, fraction: float) -> Floats:
    """(n, 3) positions moved by ``fraction`` of the umbrella vector Σ w_q (q - p) / Σ w_q, tangentially. Ours.

    Args:
        V: (n, 3) positions.
        normals: (n, 3) unit normals; the part of the umbrella vector along them is left out.
        topology: of the mesh.
        weights: (n,) w_q.
        fraction: 0 … 1.

    """
    n = topology.n_vertices
    a, b = topology.edges[:, 0], topology.edges[:, 1]
    weighted = V * weights[:, None]
    summed = measures.scatter(a, measures.gather(weighted, b), n) + measures.scatter(
        b, measures.gather(weighted, a), n
    )
    total = (measures.scatter(a, np.take(weights, b), n) + measures.scatter(b, np.take(weights, a), n))[
        :, None
    ]
    umbrella = np.divide(summed, total, out=V.copy(), where=total != 0) - V
    tangential = umbrella - measures.dot(umbrella, normals)[:, None] * normals
    return V + fraction * tangential
