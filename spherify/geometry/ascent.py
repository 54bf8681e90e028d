"""The end of a run: directions climb to the greatest sphericity, and triangles keep apart.

On a round sphere only the tangential part of the gradient of Ψ is left, and it says where the vertices should be: a fan
of long triangles cuts off more of the ball than as many even ones. With the directions u = (p - c) / |p - c| from the
centre c, radii kept, each iteration goes a share ω of a step of Newton's method, by the diagonal, towards the least

    E = log A - ⅔ log V - BARRIER · 4π/m² · Σ log det(u_a, u_b, u_c)

in the tangent plane of the sphere. The first two terms are -log Ψ and a constant. The last, over all m triangles, is
a barrier that none passes on its way to the inside, det being six times the volume between a triangle of directions and
the centre: without it triangles that bring nothing would vanish. On an even triangle of about the mean area it pulls as
much as Ψ does, and more on smaller ones; so areas stay alike, and Ψ ends a little below the greatest there is. The
gradients of the area A and of the volume V at a corner p of the triangle p, q, r, of unit normal n, are

    ∇A = ½ n x (r - q),  ∇V = ⅙ (q - p) x (r - p) (but for what cancels around p),

and the diagonal of the Hessian is taken as a third of the areas around, as it is for the volume that is cut off (Chen
and Xu, "Optimal Delaunay triangulations", 2004), and Σ |∇det|²/det² for the barrier. Vertices make room for each other
one after the other, wave by wave: hence a momentum. All of it is ours.

No face is turned, seen from the centre: whichever triangle would keep less than KEPT of its volume has the moves of its
corners halved, again and again, and after HALVINGS given up; should that not do, nothing moves.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from spherify.geometry import measures
from spherify.geometry.mesh import Floats, Ints

BARRIER: Final = 0.3
SHARE: Final = 0.1  # ω
MOMENTUM: Final = 0.9  # of directions, at most: with more, triangles of large meshes crowd
KEPT: Final = 0.3  # least share of its volume that a triangle keeps in an iteration
HALVINGS: Final = 8  # of a move; after as many, it is given up
GIVEN_UP: Final = 8  # rounds of giving up moves; after as many, all are
LEAST_VOLUME: Final = 1e-30  # of a triangle of directions and the centre, to divide by


def ascended(V: Floats, F: Ints, previous: Floats, centre: Floats, momentum: float) -> Floats:
    """Move directions towards the greatest sphericity; radii stay, and so does what looks outward.

    Args:
        V: (n, 3) positions, all faces of which look outward from the centre.
        F: (m, 3) faces, closed.
        previous: (n, 3) positions an iteration before, whose directions those of V go on from.
        centre: (3,) c.
        momentum: b, share of the last move of the directions that is repeated.

    Returns:
        (n, 3) new positions.

    """
    spokes = V - centre
    radii = measures.norm(spokes)[:, None]
    U = spokes / radii
    move = momentum * (U - measures.normalised(previous - centre)) + SHARE * _step(spokes, radii, U, F)
    move -= measures.dot(move, U)[:, None] * U
    before = KEPT * _volumes(U, F)
    allowed = np.ones((len(U), 1))
    for i in range(HALVINGS + GIVEN_UP):
        moved = measures.normalised(U + allowed * move)
        turned = _volumes(moved, F) < before
        if not turned.any():
            return np.asfortranarray(centre + radii * moved)
        corners = np.unique(F[turned])
        allowed[corners] *= 0.5 if i < HALVINGS else 0.0
    return np.asfortranarray(V)


def _step(spokes: Floats, radii: Floats, U: Floats, F: Ints) -> Floats:
    """(n, 3) a whole step of the directions, see the module; what of it is not tangential means nothing."""
    n, m = len(U), len(F)
    vectors = measures.area_vectors(spokes, F)
    areas, normals = measures.norm(vectors), measures.normalised(vectors)
    area = float(areas.sum())
    volume = float(measures.dot(vectors, measures.gather(spokes, F[:, 0])).sum()) / 3
    barrier = BARRIER * 4 * np.pi / m * area / m
    volumes = np.maximum(_volumes(U, F), LEAST_VOLUME)
    gradient, diagonal = np.zeros((n, 3)), np.zeros(n)  # times the area
    for k in range(3):
        p, q, r = (F[:, (k + j) % 3] for j in range(3))
        across = measures.cross(U[q], U[r] - U[q])
        along = measures.cross(normals, spokes[r] - spokes[q]) / 2 - 2 / 9 * area / volume * vectors
        gradient += measures.scatter(p, radii[p] * along - (barrier / volumes)[:, None] * across, n)
        within = across - measures.dot(across, U[p])[:, None] * U[p]
        flat = areas * radii[p, 0] ** 2 * (4 * np.pi / 3) / area
        diagonal += measures.scatter(p, flat + barrier * measures.dot(within, within) / volumes**2, n)
    step: Floats = -gradient / diagonal[:, None]
    return step


def _volumes(U: Floats, F: Ints) -> Floats:
    """(m,) det(u_a, u_b, u_c), six times the volume between each triangle of directions and the centre."""
    a, b, c = (measures.gather(U, F[:, k]) for k in range(3))
    volumes: Floats = measures.dot(a, measures.cross(b - a, c - a))
    return volumes
