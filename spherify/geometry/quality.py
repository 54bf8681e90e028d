"""How good the triangles are: shape, and which way they look."""

from __future__ import annotations

import math

import numpy as np

from spherify.geometry import measures
from spherify.geometry.mesh import Floats, Ints


def triangle_quality(V: Floats, F: Ints) -> Floats:
    """(m,) 4√3·A / (a² + b² + c²): 1 for an equilateral triangle, 0 for one without area or a point."""
    a, b, c = (measures.gather(V, F[:, k]) for k in range(3))
    squares = measures.dot(b - a, b - a) + measures.dot(c - b, c - b) + measures.dot(a - c, a - c)
    areas = measures.face_areas(V, F)
    numerator = 4 * math.sqrt(3) * areas
    return np.divide(numerator, squares, out=np.zeros_like(areas), where=squares != 0)


def inward_faces(V: Floats, F: Ints, centre: Floats) -> int:
    """Count the faces with n_f·(centre_f - c) ≤ 0: those that look towards ``centre`` (3,), or have no area.

    0 on every surface that is star-shaped about the centre, so on every true sphere: sphericity alone does not see
    folds of no area.
    """
    outward = (
        measures.gather(V, F[:, 0]) + measures.gather(V, F[:, 1]) + measures.gather(V, F[:, 2]) - 3 * centre
    )
    return int((measures.dot(measures.area_vectors(V, F), outward) <= 0).sum())


def all_outward(V: Floats, F: Ints, centre: Floats, least_area: float) -> bool:
    """Whether no face looks towards ``centre`` (3,), and none has less than ``least_area`` times the mean area."""
    spokes, areas = np.asfortranarray(V - centre), np.empty(len(F))
    for part in measures.blocks(len(F)):
        a, b, c = (measures.gather(spokes, corner) for corner in np.ascontiguousarray(F[part].T))
        b -= a
        c -= a
        vectors = measures.cross(b, c)
        # The same at each corner: edges have no part along the normal.
        if not measures.dot(vectors, a).min() > 0:
            return False
        areas[part] = measures.norm(vectors)
    return bool(areas.min() >= least_area * areas.mean())
