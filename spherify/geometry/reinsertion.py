"""Directions set anew, where unfolding leads no further: by taking out what looks inward, or by drawing all of them.

A surface wound around itself, or limbs of which unfolding has left less than rounding tells apart, have directions
that no more moving helps. Their triangulation is that of a sphere, all the same. So vertices of triangles that look
inward, or have vanished, are merged into neighbours until the others look outward and cover the sphere once. Put back
in reverse order, each has its place within the ring of its neighbours, near the one it was merged into if nowhere else,
where all its triangles look outward. Meanwhile all vertices make room for each other; otherwise the last ones would get
triangles too small for floating point. While few are there, the whole drawing spreads out at next to no cost.

What is wound tightly leaves little that way, and that little is distorted. So the same is done once more from a
tetrahedron on, which knows nothing but which vertices are neighbours; and the rounder of both is taken, the drawing
turned to where vertices were. Where what was kept is round already, it is not drawn.

Which vertices these are, and what they make room by, is `spherify.geometry.thinning`. Parametrizing over the sphere by
a progressive mesh in this way is due to Praun and Hoppe, "Spherical parametrization and remeshing", 2003.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from spherify.geometry import measures
from spherify.geometry.covering import covering
from spherify.geometry.mesh import Floats, Ints
from spherify.geometry.plain_thinning import PlainThinning
from spherify.geometry.roundness import sphericity
from spherify.geometry.thinning import TETRAHEDRON, Thinning, volumes

ENOUGH: Final = 1e-5  # of the mean volume between a triangle and the centre, that each should have
AT_ONCE: Final = 0.03  # share of the vertices, that are put back before directions make room
SWEEPS: Final = (10, 30)  # of that, at least and at most
WORK: Final = 100_000  # sweeps times vertices
ROUND: Final = 0.995  # sphericity from which on directions that could be kept are not drawn as well


def reinserted(V: Floats, F: Ints, centre: Floats, by: type[Thinning] = PlainThinning) -> Floats | None:
    """Return positions on a sphere about the centre that all faces look outward from; None if there are none.

    Args:
        V: (n, 3) positions.
        F: (m, 3) faces, of one closed surface of genus 0.
        centre: (3,) that directions are from.
        by: what takes vertices out and puts them back.

    Returns:
        (n, 3) positions, of the mean radius of V.

    """
    spokes = V - centre
    radius = float(measures.norm(spokes).mean())
    if len(V) > by.most or not 0 < radius < np.inf:
        return None
    start = np.ascontiguousarray(measures.normalised(spokes))
    U = mended(start, F, by)
    if U is None or _roundness(U, F) < ROUND:
        found = [one for one in (U, drawn(start, F, by)) if one is not None]
        U = max(found, key=lambda one: (_has_room(one, F), _roundness(one, F)), default=None)
    return None if U is None else np.asfortranarray(centre + radius * U)


def mended(U: Floats, F: Ints, by: type[Thinning] = PlainThinning) -> Floats | None:
    """Return directions (n, 3) as U, but for what does not look outward; None if that leaves a tangle or no room."""
    U, thinning = U.copy(), by(U, F)
    outward = thinning.until_outward()
    left = thinning.left
    if not (
        outward and covering(U[left], thinning.faces(), np.zeros(3)).degree == 1 and _put_back(U, thinning)
    ):
        return None
    return U if _has_room(U, F) else None


def drawn(U: Floats, F: Ints, by: type[Thinning] = PlainThinning) -> Floats | None:
    """Return directions (n, 3) of a drawing that knows only the faces (m, 3), turned to U; None if there is no room."""
    D, thinning = np.zeros(U.shape), by(U, F)
    thinning.until_four()
    a, b, c = thinning.faces()[0].tolist()
    D[thinning.left[[6 - a - b - c, a, b, c]]] = TETRAHEDRON
    return D @ _turn(D, U) if _put_back(D, thinning) and volumes(D, F).min() > 0 else None


def _put_back(U: Floats, thinning: Thinning) -> bool:
    """Give all that was taken out a direction in U (n, 3), in reverse order; whether there was one for each."""
    made_room_for = 0
    while thinning.out:
        if not thinning.put_back(U):
            thinning.relax(U, SWEEPS[0])
            if not thinning.put_back(U):
                return False
        here = len(thinning.left)
        if here - made_room_for > AT_ONCE * here or not thinning.out:
            thinning.relax(U, min(max(WORK // here, SWEEPS[0]), SWEEPS[1]))
            made_room_for = here
    return True


def _has_room(U: Floats, F: Ints) -> bool:
    """Whether no triangle has all but vanished."""
    found = volumes(U, F)
    return bool(found.min() > ENOUGH * found.mean())


def _roundness(U: Floats, F: Ints) -> float:
    """Return the sphericity of a surface on the sphere of radius 1."""
    return sphericity(float(measures.face_areas(U, F).sum()), float(volumes(U, F).sum()) / 6)


def _turn(U: Floats, V: Floats) -> Floats:
    """(3, 3) the rotation R by which the rows of U R are nearest to those of V: Schönemann, 1966; Kabsch, 1976."""
    left, _, right = np.linalg.svd((U[:, :, None] * V[:, None, :]).sum(axis=0))
    left[:, 2] *= np.sign(np.linalg.det(left) * np.linalg.det(right))
    turn: Floats = left @ right
    return turn
