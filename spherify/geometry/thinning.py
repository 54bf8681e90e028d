"""A closed triangulation made smaller vertex by vertex, until it looks outward, and grown again.

A vertex p is merged into a neighbour q, p's other neighbours becoming q's, and put back in reverse order. Progressive
meshes are of Hoppe, 1996. Which vertex is merged is ours: vertices should have six neighbours, and no three, four or
five edges should part the surface otherwise than around a vertex: what is behind such a narrow place has no room on the
sphere.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import ClassVar, Final

import numpy as np

from spherify.geometry import measures
from spherify.geometry.mesh import Floats, Ints

LEAST: Final = 1e-5  # of the mean volume between a triangle of directions and the centre, for it to stay
SHARE: Final = 0.3  # of the vertices, that are taken out in a level at most
EASY: Final = 12  # neighbours, of a vertex that is taken out before those with more
REGULAR: Final = 6  # neighbours
BY_DEGREE: Final = 0.1  # cost of the squares of how many neighbours more or fewer there are
BY_SIDES: Final = 6.0  # cost of each neighbour above three, as far as one more than MOST_SIDES
MOST_SIDES: Final = 5  # of a polygon that certainly has a point from which all sides are seen
BY_THREE: Final = 6.0  # cost of a ring of three edges
BY_FOUR: Final = 3.0  # cost of a ring of four
COUNTED: Final = 3  # rings, at most
BY_INWARD: Final = 2.0  # cost of a triangle that does not look outward
BEYOND: Final = 1.7  # times as long a step as Newton's, where that is short; below 2
TETRAHEDRON: Final = np.array([[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]) / np.sqrt(3)
SHORTENED: Final = 10.0 ** -np.linspace(0, 10, 31)  # of the way from q, where a place is looked for


class Thinning(ABC):
    """Takes vertices out, level by level, until all that is left looks outward; puts them back level by level."""

    most: ClassVar[int]  # vertices: a run hears nothing meanwhile

    @abstractmethod
    def __init__(self, U: Floats, F: Ints) -> None:
        """Begin with all of directions U (n, 3), C-contiguous, and triangles F (2n - 4, 3), closed and of genus 0."""

    def until_outward(self) -> bool:
        """Go on while anything looks inward; whether nothing does in the end, or a tetrahedron is left."""
        while (counts := self._counts())[1] and counts[0] > len(TETRAHEDRON):
            if not self._level(inward=True):
                self._level(inward=False)
        return not self._counts()[1]

    def until_four(self) -> None:
        """Go on until a tetrahedron is left; each triangulation that is larger has an edge to merge along."""
        self._none_outward()
        while self._counts()[0] > len(TETRAHEDRON):
            self._level(inward=False)

    @property
    @abstractmethod
    def left(self) -> Ints:
        """(k,) the vertices that are not taken out, ascending."""

    @property
    @abstractmethod
    def out(self) -> bool:
        """Whether some are."""

    @abstractmethod
    def faces(self) -> Ints:
        """(2k - 4, 3) the triangles of those that are left, numbered as in `left`."""

    @abstractmethod
    def put_back(self, U: Floats) -> bool:
        """Give the rest of the last level directions in U (n, 3); False as soon as one finds no place.

        Its place is within the ring of its neighbours, near the one it was merged into if nowhere else, where all its
        triangles look outward. Asked again, when others have made room, it goes on from there.
        """

    @abstractmethod
    def relax(self, U: Floats, sweeps: int) -> None:
        """Let directions U (n, 3) make room for each other, vertex after vertex, so often.

        Each goes towards the least of

            Σ ½ c |p - q|² over its neighbours - Σ log det(p, q, r) over its triangles,

        by a step of Newton's method in the plane that touches the sphere there, over-relaxed (Young, 1954). The
        logarithms keep it within what sees all of its ring, and alone would lead to the analytic centre of that; the
        step is damped, and so stays within (Nesterov and Nemirovskii, "Interior-point polynomial algorithms in convex
        programming", 1994). For equilateral triangles that share the sphere out among them both sums are in balance:
        `pull_of`.
        """

    @abstractmethod
    def _none_outward(self) -> None:
        """Count each triangle as one that does not look outward."""

    @abstractmethod
    def _counts(self) -> tuple[int, int]:
        """Return how many vertices are left, and of how many of them a triangle does not look outward."""

    @abstractmethod
    def _level(self, *, inward: bool) -> bool:
        """Take out vertices of which no two are neighbours, those that cost least; whether there was one.

        Of those of which a triangle does not look outward, or of all; no second one of the latter.
        """


def pull_of(n: int) -> float:
    """Return c of `Thinning.relax` for n vertices.

    With m = 2n - 4 triangles of area a = 4π/m, whose edges have squares that add up to 4√3·a, each edge in two of
    them: a·d/da of ½ c·½·4√3·a and log 2a is the same for c = m/(4√3·π).
    """
    return (2 * n - 4) / (4 * math.sqrt(3) * math.pi)


def looking_outward(U: Floats, F: Ints) -> tuple[float, Ints]:
    """Return the least volume that triangles of directions U (n, 3) stay with; the vertices of those with less."""
    found = volumes(U, F)
    least = LEAST * float(np.abs(found).mean())
    return least, np.unique(F[~(found > least)])


def volumes(U: Floats, F: Ints) -> Floats:
    """(m,) six times the volumes between triangles and the centre."""
    a, b, c = (measures.gather(U, F[:, k]) for k in range(3))
    return measures.dot(a, measures.cross(b - a, c - a))


def uneven(degree: int) -> int:
    """Return the square of how many neighbours more or fewer there are; of more than EASY it grows linearly.

    Else all around a hub would cost more with each that is taken out, and no two be taken out in a level.
    """
    beyond = degree - EASY
    return (degree - REGULAR) ** 2 if beyond <= 0 else (EASY - REGULAR) * (EASY - REGULAR + 2 * beyond)
