"""How often a surface covers the sphere of directions from a point, and from where it does so once.

The degree of the map to directions is the winding number of the surface about the point, which nothing that is done to
directions can change: 1 is what a sphere has. T can wind a long limb around the body, so that the centroid is inside
twice, or outside. Along a ray the winding number changes by one at each crossing, and ends at 0: from where it is 2 or
more, every ray passes places where it is 1; from outside, those rays do that enter the body.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from spherify.geometry import measures
from spherify.geometry.mesh import Floats, Ints

RAYS: Final = 48  # along which such a place is looked for
TRIED: Final = 24  # of the widest ways between two crossings
LITTLE: Final = 0.1  # of the sphere; what inward triangles cover of it then is soon unfolded
AT_A_TIME: Final = 1 << 15  # triangles

Indices: TypeAlias = NDArray[np.int64] | NDArray[np.uint32]


class Covering(NamedTuple):
    """What the directions of a surface are like.

    Attributes:
        degree: how often they cover the sphere.
        turned: share of the sphere that inward triangles cover.

    """

    degree: int
    turned: float


def covering(V: Floats, F: Ints, centre: Floats) -> Covering:
    """Return how often the directions of V (n, 3) from the centre (3,) cover the sphere, and what inward triangles do.

    The signed solid angles Ω of the triangles over 4π, whose sum is whole: with p, q, r from the centre to the corners,

        tan Ω/2 = det(p, q, r) / (|p||q||r| + (p·q)|r| + (q·r)|p| + (r·p)|q|).

    By A. van Oosterom and J. Strackee, "The solid angle of a plane triangle", 1983.
    """
    total, turned = 0.0, 0.0
    for a, b, c in _corners(V, F):
        p, q, r = a - centre, b - centre, c - centre
        pp, qq, rr = measures.norm(p), measures.norm(q), measures.norm(r)
        inside = pp * qq * rr + measures.dot(p, q) * rr + measures.dot(q, r) * pp + measures.dot(r, p) * qq
        angles = 2 * np.arctan2(measures.dot(p, measures.cross(q, r)), inside)
        total += float(angles.sum())
        turned -= float(angles[angles < 0].sum())
    return Covering(round(total / (4 * np.pi)), turned / (4 * np.pi))


def centre_inside(
    V: Floats, F: Indices, near: Floats, seen_from: Callable[[Floats], Covering]
) -> Floats | None:
    """Return a point that the surface goes around once, or None if none is found.

    Looked for halfway between two crossings of rays from ``near`` (3,) with the surface, in the widest ways first that
    are within it once, as the crossings further out tell; of those tried it is the one from which inward triangles
    cover the least, or the first from which it is little.

    Args:
        V: (n, 3) positions.
        F: (m, 3) faces, closed.
        near: where the rays begin; it is no such point itself.
        seen_from: returns the `Covering` from a point.

    """
    rays = _rays()
    ways: list[tuple[float, Floats]] = []  # how wide, and the middle
    for ray, (at, leaves) in zip(rays, _crossings(V, F, near, rays), strict=True):
        order = np.argsort(at, kind="stable")
        further = np.cumsum(leaves[order][::-1])[::-1]  # winding number before each crossing
        within = zip(pairwise(at[order]), further[1:], strict=True) if len(at) else ()
        ways += [(float(y - x), near + (x + y) / 2 * ray) for (x, y), winding in within if winding == 1]
    ways.sort(key=lambda way: -way[0])
    least, found = np.inf, None
    for _, middle in ways[:TRIED]:
        degree, turned = seen_from(middle)
        if degree == 1 and turned < least:
            least, found = turned, middle
        if least < LITTLE:
            break
    return found


def on_a_sphere(V: Floats, centre: Floats) -> Floats:
    """(n, 3) V in their directions from the centre, all at their mean distance from it."""
    spokes = V - centre
    radii = measures.norm(spokes)
    return np.asfortranarray(centre + (radii.mean() / radii)[:, None] * spokes)


def _crossings(V: Floats, F: Indices, near: Floats, rays: Floats) -> list[tuple[Floats, Floats]]:
    """How far from where they begin each ray (k, 3) crosses triangles: those of whose edges it is on the same side.

    With 1 where it leaves the inside of the surface by that, and -1 where it enters it.
    """
    found: list[list[tuple[Floats, Floats]]] = [[] for _ in rays]
    for corners in _corners(V, F):
        a, b, c = (corner - near for corner in corners)
        edges = [measures.cross(p, q) for p, q in ((a, b), (b, c), (c, a))]
        height = measures.dot(edges[0], c)  # times the slope of a ray that meets the triangle in its length
        for ray, at in zip(rays, found, strict=True):
            along = np.broadcast_to(ray, a.shape)
            sides = [measures.dot(edge, along) for edge in edges]
            slope = sides[0] + sides[1] + sides[2]
            crossed = (slope != 0) & (height * slope > 0)
            for side in sides:
                crossed &= side * slope >= 0
            at.append((height[crossed] / slope[crossed], np.sign(slope[crossed])))
    return [(np.concatenate([x for x, _ in at]), np.concatenate([y for _, y in at])) for at in found]


def _corners(V: Floats, F: Indices) -> Iterator[tuple[Floats, Floats, Floats]]:
    """Yield the corners of the triangles, (k, 3) each, so many at a time that they take little memory."""
    for first in range(0, len(F), AT_A_TIME):
        some = F[first : first + AT_A_TIME].astype(np.int64)
        yield measures.gather(V, some[:, 0]), measures.gather(V, some[:, 1]), measures.gather(V, some[:, 2])


def _rays() -> Floats:
    """(RAYS, 3) directions, evenly spread along a spiral by the golden angle."""
    i = np.arange(RAYS) + 0.5
    z, longitude = 1 - 2 * i / RAYS, np.pi * (1 + np.sqrt(5)) * i
    ring = np.sqrt(1 - z * z)
    return np.stack([ring * np.cos(longitude), ring * np.sin(longitude), z], axis=1)
