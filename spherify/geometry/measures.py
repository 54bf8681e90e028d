"""Lengths, areas, normals, signed dihedral angles, volume, centroid: plain measures of a triangle mesh.

Vartziotis, "Curvature transformation", arXiv:1608.03898, section 1. Unit normals of degenerate faces are zero
vectors, and the dihedral angle at such a face is 0. What is not a number stays
so: divisions leave out exact zeros only.

Vectors are rows of (k, 3) arrays. Any memory layout gives the right numbers; column by column (Fortran order, what
`gather` makes) is twice as quick, because every operation then runs over contiguous memory.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from spherify.geometry.mesh import Floats, Ints

BLOCK: Final = 5120  # less than 128 KiB a list: from there on memory is asked of the system, and given back
ROUNDED: Final = (
    1e-9  # so much of a sine or a sum of unit normals may be rounding: flat faces' are off by 5e-11
)


def gather(rows: Floats, index: Ints) -> Floats:
    """Pick rows of an (n, 3) array by ``index`` (k,) in 0 … n - 1: (k, 3), column by column in memory."""
    return rows.T.take(index, axis=1).T


def cross(a: Floats, b: Floats) -> Floats:
    """Row-wise vector product of two (k, 3) arrays; several times quicker than numpy's general one."""
    product, spare = np.empty_like(a), np.empty(len(a))
    for x, y, z in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        along = product[:, x]
        np.multiply(a[:, y], b[:, z], out=along)
        np.multiply(a[:, z], b[:, y], out=spare)
        along -= spare
    return product


def dot(a: Floats, b: Floats) -> Floats:
    """Row-wise scalar product of two (k, 3) arrays, (k,)."""
    product: Floats = a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]
    return product


def norm(a: Floats) -> Floats:
    """Row-wise Euclidean norm of a (k, 3) array, (k,)."""
    return np.sqrt(dot(a, a))


def normalised(a: Floats, nothing: float = 0.0) -> Floats:
    """Rows of a (k, 3) array scaled to length 1; those no longer than ``nothing`` become zero."""
    length = norm(a)[:, None]
    return np.divide(a, length, out=np.zeros_like(a), where=~(length <= nothing))


def scatter(index: Ints, values: Floats, n: int) -> Floats:
    """Sum (k,) or (k, 3) ``values`` into n bins named by ``index`` (k,), always in the same order."""
    if values.ndim == 2:
        sums = np.empty((n, 3), order="F")
        for column in range(3):
            sums[:, column] = np.bincount(index, values[:, column], n)
        return sums
    return np.bincount(index, values, n).astype(np.float64, copy=False)


def blocks(count: int) -> list[slice]:
    """Return slices that cover 0 … count - 1, of as many as the cache of a core holds some lists of vectors of."""
    return [slice(begin, begin + BLOCK) for begin in range(0, count, BLOCK)]


def area_vectors(V: Floats, F: Ints) -> Floats:
    """(m, 3) vectors ½ (b - a) × (c - a): along the face normal, as long as the face's area."""
    a = gather(V, F[:, 0])
    return 0.5 * cross(gather(V, F[:, 1]) - a, gather(V, F[:, 2]) - a)


def face_areas(V: Floats, F: Ints) -> Floats:
    """(m,) areas, length²."""
    return norm(area_vectors(V, F))


def face_normals(V: Floats, F: Ints) -> Floats:
    """(m, 3) unit normals n_f, pointing outward when the face is counter-clockwise from outside."""
    return normalised(area_vectors(V, F))


def vertex_normals(face_normals: Floats, F: Ints, n: int) -> Floats:
    """(n, 3) vertex normals n_p: the *unweighted* sum of the unit normals of the faces at p, normalised.

    Vartziotis, section 2. Zero where the normals cancel each other, up to `ROUNDED`.
    """
    return normalised(sum_at_vertices(face_normals, F, n), ROUNDED)


def sum_at_vertices(face_values: Floats, F: Ints, n: int) -> Floats:
    """Sum (m,) or (m, 3) face values over the faces at each vertex: (n,) or (n, 3)."""
    first, second, third = (scatter(F[:, k], face_values, n) for k in range(3))
    return first + second + third


def edge_lengths(V: Floats, edges: Ints) -> Floats:
    """(e,) lengths l(e) of ``edges`` (e, 2)."""
    along = gather(V, edges[:, 1])
    along -= gather(V, edges[:, 0])
    return norm(along)


def dihedral_angles(V: Floats, edges: Ints, edge_faces: Ints, face_normals: Floats) -> Floats:
    """(e,) signed dihedral angles θ(e) in (-π, π]: 0 if flat, positive at a convex edge, π between faces on each other.

    θ = atan2((n_f × n_g)·ê, n_f·n_g), with ê along the edge in the direction in which f runs through it. Beside π a
    sine up to `ROUNDED` is none: its sign would be chance.

    Args:
        V: (n, 3) positions.
        edges: (e, 2) vertices, the first of the two faces running from the first to the second.
        edge_faces: (e, 2) the two faces f, g of each edge.
        face_normals: (m, 3) unit normals.

    """
    along = normalised(gather(V, edges[:, 1]) - gather(V, edges[:, 0]))
    n_f = gather(face_normals, edge_faces[:, 0])
    n_g = gather(face_normals, edge_faces[:, 1])
    # Adding 0 makes 0 of -0, which a zero normal can give: the angle is then 0, and not π.
    sine, cosine = dot(cross(n_f, n_g), along), dot(n_f, n_g) + 0.0
    sharp = np.flatnonzero(cosine < 0)
    sine[sharp[np.abs(sine[sharp]) <= ROUNDED]] = 0.0
    return np.arctan2(sine, cosine)


def area_centroid(V: Floats, F: Ints, areas: Floats) -> Floats:
    """(3,) area-weighted centroid of the surface; the mean vertex where there is no area."""
    total = float(areas.sum())
    if total == 0:
        return np.asarray(V.mean(axis=0))
    corners = gather(V, F[:, 0]) + gather(V, F[:, 1]) + gather(V, F[:, 2])
    return np.asarray((areas[:, None] * corners).sum(axis=0) / (3 * total))


def scaled(V: Floats, centre: Floats, factor: float) -> Floats:
    """(n, 3) points c + factor·(p - c) for the rows p of V, with ``centre`` (3,) for c."""
    moved = V - centre
    moved *= factor
    moved += centre
    return moved


def volume(V: Floats, F: Ints, origin: Floats) -> float:
    """Signed volume Σ (a - o)·((b - o) × (c - o)) / 6, positive when the normals point outward.

    For a closed mesh it does not depend on ``origin`` (3,); for an open one it is that of the cone over it.
    """
    spokes = V - origin
    a, b, c = (gather(spokes, F[:, k]) for k in range(3))
    return float(dot(a, cross(b, c)).sum() / 6)


def least_altitudes(V: Floats, F: Ints, areas: Floats) -> Floats:
    """(m,) least altitude of each triangle: 2·area / longest edge; 0 for a point."""
    a, b, c = (gather(V, F[:, k]) for k in range(3))
    longest = np.sqrt(np.maximum(np.maximum(dot(b - a, b - a), dot(c - b, c - b)), dot(a - c, a - c)))
    return np.divide(2 * areas, longest, out=np.zeros_like(areas), where=longest != 0)
