"""Unfolding on the sphere: a nearly round surface becomes star-shaped, limbs that sank in as folded strings included.

Seen from the centre c every vertex has a direction u = (p - c) / |p - c| and a radius |p - c|. If the triangles of the
directions all face outward, no radii whatever can make a face look inward. So the two are treated apart: the
transformation moves radii (`evened_out`), and each direction is drawn to the weighted mean of those of its neighbours,

    u ← normalised(u + φ (m - (m·u) u)),  m = Σ w_q q / Σ w_q,  log w_q = e · smoothed log(area of the triangles at q)

until no face looks inward. As convex combinations these unfold (Tutte, "How to draw a graph", 1963; Floater,
"Parametrization and smooth approximation of surface triangulations", 1997). Uniform weights shrink a limb of length l
and radius r to a tip of exp(-2 l/r) of the area; weights that grow with the area as above to exp(-2 l / (r √(1 + 4e))).
They depend on what they bring about, so they are smoothed along the surface and only approached, or they would swing to
and fro. And they are late: where so few triangles are left that some rounds of drawing change them all, the largest
grow until they pass the centre, and directions cover the sphere no more; or folds come and go. Fewer rounds between two
looks at the areas, and weights that differ less, unfold those too (on a large surface they would only take longer).
What limbs then have left may be less than 1e-9 of the mean area: `spread` draws these triangles apart without
turning any. Equal radii do not make the greatest sphericity of uneven triangles, for the large ones cut off more of the
ball: so the run does not end here (`spherify.geometry.ascent`).
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
LEAST_ALTITUDE: Final = 1e-30
LEAST_AREA: Final = 1e-300  # under a logarithm
SPREAD: Final = 0.5  # of the way to the point where the product of the areas around a vertex is the greatest
NO_FLIP: Final = (
    0.25  # of its altitude, that a corner gives up at most: all three of a triangle leave a quarter
)
CROWDED: Final = 1e-3  # share of the mean area, of a triangle whose corners are drawn apart
EVENING: Final = 0.05  # of the greatest curvature of the radii, the step of evening them out
LEAST_RADIUS: Final = 0.5  # of what it was before: no vertex passes the centre, not even by inward steps only
EQUAL_RADII: Final = 1e-15  # a curvature below this share of the radius is rounding


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


def spread(V: Floats, topology: Topology, centre: Floats, rounds: int) -> Unfolded:
    """Draw triangles of directions apart that have all but vanished, all of which look outward, and keep to do so.

    Each corner of a triangle of less than CROWDED times the mean area makes SPREAD of a step of Newton's method in its
    tangent plane towards the greatest product of the areas around it, a barrier that no triangle passes; but none comes
    nearer to the opposite side of a triangle by more than NO_FLIP of its distance, nor goes further than NO_FLIP of the
    shortest edge at it. With h the distance of u from the great circle through the other corners of a triangle, and m
    the normal of that circle: g = Σ m/h, H = Σ m mᵀ/h², both in the tangent plane, u ← normalised(u + H⁻¹g/2).

    Args:
        V: (n, 3) positions; radii stay.
        topology: of the mesh, closed.
        centre: (3,) c.
        rounds: how often.

    Returns:
        its log_weights are empty.

    """
    F, n = topology.faces, topology.n_vertices
    spokes = V - centre
    radii = measures.norm(spokes)[:, None]
    U = spokes / radii
    for _ in range(rounds):
        first, second = _tangents(U)
        along, shortest, nearer = np.zeros((n, 5)), np.full(n, np.inf), np.zeros(n)
        areas = measures.face_areas(U, F)
        crowded = np.zeros(n, dtype=np.bool_)
        crowded[F[areas < CROWDED * areas.mean()]] = True
        shares = []  # m/h at the corners
        for k in range(3):
            p, q, r = (F[:, (k + j) % 3] for j in range(3))
            across = np.cross(U[q], U[r] - U[q])
            length = np.maximum(measures.norm(across), LEAST_AREA)
            altitude = np.maximum(measures.dot(across, U[p] - U[q]) / length, LEAST_ALTITUDE)
            by = 1 / (length * altitude)
            x, y = by * measures.dot(across, first[p]), by * measures.dot(across, second[p])
            shares.append((x, y))
            for column, values in enumerate((x, y, x * x, x * y, y * y)):
                along[:, column] += measures.scatter(p, values, n)
            edge = measures.norm(U[q] - U[p])
            np.minimum.at(shortest, p, edge)
            np.minimum.at(shortest, q, edge)
        g, (a, b, c) = along[:, :2], along[:, 2:].T
        determinant = np.maximum(a * c - b * b, LEAST_AREA)
        s, t = (c * g[:, 0] - b * g[:, 1]) / determinant, (a * g[:, 1] - b * g[:, 0]) / determinant
        for k, (x, y) in enumerate(shares):
            np.maximum.at(nearer, F[:, k], -(x * s[F[:, k]] + y * t[F[:, k]]))
        most = NO_FLIP * np.minimum(
            1 / np.maximum(nearer, LEAST_AREA), shortest / np.maximum(np.hypot(s, t), LEAST_AREA)
        )
        by = np.where(crowded, np.minimum(SPREAD, most), 0)[:, None]
        U = measures.normalised(U + by * (s[:, None] * first + t[:, None] * second))
    inward, least_area = folds(U, F)
    return Unfolded(np.asfortranarray(centre + radii * U), np.zeros(0), inward, least_area)


def _tangents(U: Floats) -> tuple[Floats, Floats]:
    """Two (n, 3) orthonormal tangents of the sphere at each direction."""
    axis = np.where(np.abs(U[:, :1]) < 0.6, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    first = measures.normalised(np.cross(U, axis))
    return first, np.cross(U, first)


def evened_out(V: Floats, centre: Floats, k_in: int, k_out: int) -> Floats | None:
    """Apply T_(k_in, k_out, C) along the radii: directions stay, so that no face can be turned.

    The normal curvature of the edge from p to q, with the direction of p for the normal, is that of the sphere about c
    through p where |q - c| = |p - c|. What it exceeds that by, times |p - q|², is a length as K(e) = l·θ of the paper
    is, and, with the mean radius of the edge in the place of that of p, K(e) = 2 (|p - c| - |q - c|). K(p) is half its
    average over the edges from p to *all* other vertices, but for n/(n - 1): |p - c| less the mean radius. Over those
    of the mesh alone, a wide bulge would take as many steps as there are vertices across it, squared. It is 0 on a
    round sphere whatever its triangles, which curvature from angles and areas is not. The window is ±g with g the
    greatest |K|, and C = EVENING·g: an inward and an outward step leave about 1 - EVENING of every K. No radius falls
    below LEAST_RADIUS of what it was: none passes the centre.

    Args:
        V: (n, 3) positions.
        centre: (3,) c.
        k_in: elementary steps inward.
        k_out: elementary steps outward, after them.

    Returns:
        (n, 3) new positions; None if all radii are equal.

    """
    spokes = V - centre
    before = measures.norm(spokes)
    radii = before
    for i in range(k_in + k_out):
        K = radii - radii.mean()
        greatest = float(np.abs(K).max())
        if greatest <= EQUAL_RADII * float(radii.min()):
            if i == 0:
                return None
            break
        t = (K + greatest) / (2 * greatest)
        radii = radii + EVENING * greatest * (-t if i < k_in else 1 - t)
    radii = np.maximum(radii, LEAST_RADIUS * before)
    return np.asfortranarray(centre + (radii / before)[:, None] * spokes)


def ahead_along_radii(V: Floats, previous: Floats, centre: Floats, momentum: float) -> Floats:
    """Return (n, 3) where the momentum of the radii leads, r + b (r - before) for a radius r; directions stay.

    Args:
        V: (n, 3) positions.
        previous: (n, 3) positions an iteration before.
        centre: (3,) c.
        momentum: b.

    """
    spokes = V - centre
    radii, before = measures.norm(spokes), measures.norm(previous - centre)
    ahead: Floats = centre + spokes * (1 + momentum * (1 - before / radii))[:, None]
    return ahead


def folds(U: Floats, F: Ints) -> tuple[int, float]:
    """Count the triangles of directions U (n, 3) that look inward; and their least area over their mean."""
    vectors = measures.area_vectors(U, F)
    areas = measures.norm(vectors)
    inward = int((measures.dot(vectors, measures.gather(U, F[:, 0])) <= 0).sum())
    return inward, float(areas.min() / areas.mean())
