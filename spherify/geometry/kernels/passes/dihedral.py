"""Faces around a vertex, the edges between them, and their dihedral angles; see `rings`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import reduce
from operator import add
from typing import Final, NamedTuple, cast

from spherify.geometry.kernels.passes.angles import (
    ARCSINE,
    ARCSINE_OF_SMALL,
    SLIGHT,
    SMALL,
    arctangent,
    inverse_root,
    inverse_root_by_division,
)
from spherify.geometry.kernels.passes.tracing import either
from spherify.geometry.kernels.passes.wide import Mask, Wide, greater, polynomial, where
from spherify.geometry.kernels.passes.wide_vectors import Vector, cross, difference, dot
from spherify.geometry.measures import ROUNDED

# Two unit normals in a row that look against each other, but for a slight angle, shorten the sum of all by this.
FOLDED: Final = 2 - 2 * math.sin(math.asin(math.sqrt(SLIGHT)) / 2)
FLAT: Final = (
    2e-6  # |N| over the square of the longest edge below which a corner's normal may be lost to rounding
)


class Face(NamedTuple):
    """The face between two edge vectors e and d: N = e × d, |N|², 1/|N| and, twice its area, |N|."""

    normal: Vector
    squared: Wide
    inverse: Wide
    size: Wide


class Edge(NamedTuple):
    """An edge d between two faces: d², -|d|·sin θ and sin² θ."""

    squared: Wide
    sine: Wide
    sine_squared: Wide


def face(e: Vector, d: Vector, *, by_division: bool = False) -> Face:
    """Return the face between two edge vectors."""
    normal = cross(e, d)
    squared = dot(normal, normal)
    inverse = inverse_root_by_division(squared) if by_division else inverse_root(squared)
    return Face(normal, squared, inverse, squared * inverse)


def edge(e: Vector, dd: Wide, a: Face, b: Face) -> Edge:
    """Return the edge d from the face a, between e and d, into the face b: e · N_b is -|d|·|N_a|·|N_b|·sin θ / d²."""
    per_length = dot(e, b.normal) * (a.inverse * b.inverse)
    sine = dd * per_length
    return Edge(dd, sine, sine * per_length)


def bend_slightly(
    edges: Sequence[Edge], faces: Sequence[Face], arcsine: Sequence[float], *, by_area: bool
) -> Wide:
    """Σ l·θ of edges whose angles are slight, each over the |N| of its faces if ``by_area``."""
    total: Wide | float = 0.0
    for j, one in enumerate(edges):
        value = one.sine / (faces[j].size + faces[j + 1].size) if by_area else one.sine
        total = (-value).fma(polynomial(arcsine, one.sine_squared), total)
    return cast(Wide, total)


def bend(one: Edge, a: Face, b: Face, *, by_area: bool) -> Wide:
    """Return the same of one edge, whatever its angle: tan θ = -(e · N_b) |d| / (N_a · N_b)."""
    length = one.squared.root()
    cosine = length * dot(a.normal, b.normal)
    folded = (cosine < 0.0) & (one.sine_squared <= ROUNDED**2)
    angle = arctangent(where(folded, 0.0, -one.sine * (a.size * b.size)), cosine)
    return length * angle / (a.size + b.size) if by_area else length * angle


def altitude_of(e: Vector, ee: Wide, d: Vector, dd: Wide, of: Face) -> tuple[Wide, Wide]:
    """Return |N|² and the square of the longest edge of a face; over each other, the square of its altitude.

    `lower` multiplies one by the other: for lengths from 1e-50 to 1e50, in whose middle those of a frame lie.
    """
    g = difference(d, e)
    return of.squared, greater(greater(ee, dot(g, g)), dd)


def lower(one: tuple[Wide, Wide], other: tuple[Wide, Wide]) -> tuple[Wide, Wide]:
    """Return the lesser of two fractions."""
    less = one[0] * other[1] < other[0] * one[1]
    return where(less, one[0], other[0]), where(less, one[1], other[1])


def bent(edges: Sequence[Edge], faces: Sequence[Face], folded: Mask, there: Mask, *, by_area: bool) -> Wide:
    """Σ l·θ of the edges of a group, in the way that is the quickest for its angles."""
    greatest = reduce(greater, (one.sine_squared for one in edges))

    def any_angle() -> Wide:
        return reduce(
            add, (bend(one, faces[j], faces[j + 1], by_area=by_area) for j, one in enumerate(edges))
        )

    def slight() -> Wide:
        return bend_slightly(edges, faces, ARCSINE, by_area=by_area)

    def small() -> Wide:
        return bend_slightly(edges, faces, ARCSINE_OF_SMALL, by_area=by_area)

    not_slight = (there & (folded | ~(greatest <= SLIGHT))).any()
    not_small = (there & (folded | ~(greatest <= SMALL))).any()
    return either(not_small, lambda: either(not_slight, any_angle, slight), small)


def is_flat(smallest: Wide, longest: Wide) -> Mask:
    """Whether a face of that |N|² may have lost its normal to rounding beside an edge of that square."""
    return ~(smallest > FLAT**2 * longest * longest)
