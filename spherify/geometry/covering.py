"""How often a surface covers the sphere of directions from a point, and from where it does so once.

The degree of the map to directions is the winding number of the surface about the point, which nothing that is done to
directions can change: 1 is what a sphere has. T can wind a long limb around the body, so that the centroid is inside
twice, or outside; but on the way outward from it, the winding number ends at 0 and changes by 1 at each crossing, so
that there are places where it is 1.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spherify.geometry import measures
from spherify.geometry.mesh import Floats, Ints

RAYS: Final = 48  # along which such a place is looked for
TRIED: Final = 24  # of the widest ways between two crossings


class Covering(NamedTuple):
    """What the directions of a surface are like.

    Attributes:
        degree: how often they cover the sphere.
        turned: share of the sphere that inward triangles cover.

    """

    degree: int
    turned: float


def covering(U: Floats, F: Ints) -> Covering:
    """Return how often the triangles of directions U (n, 3) cover the sphere, and the share of it that inward ones do.

    The signed solid angles over 4π, whose sum is whole. By A. van Oosterom and J. Strackee, "The solid angle of a plane
    triangle", 1983.
    """
    a, b, c = (measures.gather(U, F[:, k]) for k in range(3))
    volumes = measures.dot(a, measures.cross(b, c))
    angles = 2 * np.arctan2(volumes, 1 + measures.dot(a, b) + measures.dot(b, c) + measures.dot(c, a))
    whole = 4 * np.pi
    return Covering(round(float(angles.sum()) / whole), float(-angles[angles < 0].sum()) / whole)


def centre_inside(V: Floats, F: Ints, near: Floats) -> Floats | None:
    """Return a point that the surface goes around once, or None if none is found.

    Looked for halfway between two crossings of rays from ``near`` (3,) with the surface, in the widest ways first; of
    those tried it is the one from which inward triangles cover the least.

    Args:
        V: (n, 3) positions.
        F: (m, 3) faces, closed.
        near: where the rays begin; it is no such point itself.

    """
    a, b, c = (measures.gather(V, F[:, k]) - near for k in range(3))
    across = measures.cross(b - a, c - a)
    heights = measures.dot(across, a)
    ways: list[tuple[float, Floats]] = []  # how wide, and the middle
    for ray in _rays():
        slopes = across @ ray
        crossed = np.flatnonzero((slopes != 0) & _within(a, b, c, across, ray))
        at = heights[crossed] / slopes[crossed]
        ways += [(float(y - x), near + (x + y) / 2 * ray) for x, y in pairwise(np.sort(at[at > 0]))]
    ways.sort(key=lambda way: -way[0])
    found = [(covering(measures.normalised(V - middle), F), middle) for _, middle in ways[:TRIED]]
    once = [(turned, middle) for (degree, turned), middle in found if degree == 1]
    return min(once, key=lambda candidate: candidate[0])[1] if once else None


def _rays() -> Floats:
    """(RAYS, 3) directions, evenly spread along a spiral by the golden angle."""
    i = np.arange(RAYS) + 0.5
    z, longitude = 1 - 2 * i / RAYS, np.pi * (1 + np.sqrt(5)) * i
    ring = np.sqrt(1 - z * z)
    return np.stack([ring * np.cos(longitude), ring * np.sin(longitude), z], axis=1)


def _within(a: Floats, b: Floats, c: Floats, across: Floats, ray: Floats) -> NDArray[np.bool_]:
    """(m,) whether the line along ``ray`` through the origin crosses the triangles: the same side of all edges."""
    along = np.broadcast_to(ray, a.shape)
    sides = [measures.dot(measures.cross(p, q), along) for p, q in ((a, b), (b, c), (c, a))]
    slopes = across @ ray
    within: NDArray[np.bool_] = np.all([side * slopes >= 0 for side in sides], axis=0)
    return within
