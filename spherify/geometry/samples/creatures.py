"""Bodies with limbs, as smooth unions of capsules and ellipsoids.

x points forward, y to the left, z up. The smooth minimum is that of Quilez, "smooth minimum", polynomial form.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from spherify.geometry.measures import norm
from spherify.geometry.mesh import Floats
from spherify.geometry.samples.implicit import Implicit

Point = tuple[float, float, float]


def _capsule(P: Floats, a: Point, b: Point, r_a: float, r_b: float) -> Floats:
    """Distance to a rod from a to b whose radius goes from r_a to r_b."""
    start, along = np.array(a), np.array(b) - np.array(a)
    fraction = np.clip((P - start) @ along / float(along @ along), 0, 1)
    return np.asarray(norm(P - start - fraction[:, None] * along) - (r_a + (r_b - r_a) * fraction))


def _ellipsoid(P: Floats, centre: Point, radii: Point) -> Floats:
    """About the distance to an ellipsoid along the axes."""
    scaled = (P - np.array(centre)) / np.array(radii)
    inner = norm(scaled)
    outer = norm(scaled / np.array(radii))
    return np.asarray(inner * (inner - 1) / np.maximum(outer, 1e-9))


def _union(parts: Sequence[Floats], blend: float) -> Floats:
    """Smooth minimum of distances: parts flow together over the length ``blend``."""
    joined = parts[0]
    for part in parts[1:]:
        overlap = np.maximum(blend - np.abs(joined - part), 0) / blend
        joined = np.minimum(joined, part) - overlap**2 * blend / 4
    return joined


def _carved(body: Floats, hollow: Floats, blend: float) -> Floats:
    """Smooth difference: ``body`` without ``hollow``."""
    return -_union([-body, hollow], blend)


def _mirrored(P: Floats) -> Floats:
    """Fold the right side onto the left: a body of the result is symmetric."""
    return np.stack([P[:, 0], np.abs(P[:, 1]), P[:, 2]], axis=1)


def _quadruped(P: Floats) -> Floats:
    Q = _mirrored(P)
    trunk = _union(
        [
            _capsule(P, (-0.85, 0, 1.02), (0.75, 0, 1.05), 0.32, 0.36),
            _capsule(P, (0.8, 0, 1.15), (1.25, 0, 1.5), 0.26, 0.19),
        ],
        0.25,
    )
    head = _union(
        [
            _ellipsoid(P, (1.42, 0, 1.62), (0.3, 0.25, 0.25)),
            _capsule(P, (1.5, 0, 1.55), (1.74, 0, 1.5), 0.16, 0.11),
        ],
        0.1,
    )
    ear = _capsule(Q, (1.38, 0.15, 1.76), (1.33, 0.19, 1.93), 0.11, 0.075)
    foreleg = _union(
        [
            _capsule(Q, (0.72, 0.2, 0.9), (0.78, 0.25, 0.45), 0.2, 0.135),
            _capsule(Q, (0.78, 0.25, 0.45), (0.74, 0.25, 0.1), 0.135, 0.115),
            _capsule(Q, (0.74, 0.25, 0.09), (0.9, 0.25, 0.09), 0.115, 0.1),
        ],
        0.08,
    )
    hindleg = _union(
        [
            _capsule(Q, (-0.8, 0.2, 0.92), (-0.68, 0.26, 0.52), 0.25, 0.15),
            _capsule(Q, (-0.68, 0.26, 0.52), (-0.95, 0.26, 0.3), 0.14, 0.115),
            _capsule(Q, (-0.95, 0.26, 0.3), (-0.9, 0.26, 0.1), 0.115, 0.11),
            _capsule(Q, (-0.9, 0.26, 0.1), (-0.72, 0.26, 0.09), 0.115, 0.1),
        ],
        0.08,
    )
    tail = _union(
        [
            _capsule(P, (-1.05, 0, 1.15), (-1.5, 0, 1.05), 0.13, 0.115),
            _capsule(P, (-1.5, 0, 1.05), (-1.85, 0, 1.25), 0.115, 0.11),
            _capsule(P, (-1.85, 0, 1.25), (-2.0, 0, 1.6), 0.11, 0.1),
        ],
        0.08,
    )
    return _union([_union([trunk, head, foreleg, hindleg, tail], 0.12), ear], 0.06)


def _head(P: Floats) -> Floats:
    Q = _mirrored(P)
    skull = _union(
        [
            _ellipsoid(P, (-0.08, 0, 0.25), (0.98, 0.78, 0.85)),
            _ellipsoid(P, (0.3, 0, -0.35), (0.58, 0.52, 0.7)),
            _capsule(P, (0.5, 0, -0.85), (0.58, 0, -0.85), 0.24, 0.2),
        ],
        0.3,
    )
    face = _carved(skull, _ellipsoid(Q, (0.98, 0.3, 0.1), (0.26, 0.2, 0.14)), 0.16)
    features = [
        _capsule(P, (0.86, 0, 0.12), (0.97, 0, -0.22), 0.07, 0.12),
        _ellipsoid(Q, (0.72, 0.3, 0.1), (0.13, 0.13, 0.12)),
        _capsule(Q, (0.76, 0.28, 0.3), (0.86, 0.05, 0.27), 0.07, 0.08),
        _capsule(Q, (0.82, 0.14, -0.52), (0.9, 0, -0.5), 0.05, 0.07),
        _capsule(Q, (0.78, 0.12, -0.63), (0.86, 0, -0.64), 0.05, 0.07),
    ]
    ear = _carved(
        _ellipsoid(Q, (-0.06, 0.82, 0.02), (0.19, 0.1, 0.31)),
        _ellipsoid(Q, (0.03, 0.93, 0.03), (0.1, 0.08, 0.18)),
        0.06,
    )
    neck = _capsule(P, (-0.25, 0, -0.5), (-0.35, 0, -1.45), 0.45, 0.5)
    return _union([_union([face, *features], 0.08), _union([ear, neck], 0.1)], 0.14)


def _sphere_bar(P: Floats) -> Floats:
    folded = np.stack([np.abs(P[:, 0]), P[:, 1], P[:, 2]], axis=1)
    ball = _ellipsoid(folded, (1.2, 0, 0), (0.8, 0.8, 0.8))
    return _union([ball, _capsule(P, (-1.2, 0, 0), (1.2, 0, 0), 0.45, 0.45)], 0.3)


quadruped: Final = Implicit(_quadruped, (-2.15, -0.55, -0.1), (1.9, 0.55, 2.1), 1000)
head: Final = Implicit(_head, (-1.2, -1.1, -2.0), (1.3, 1.1, 1.15), 400)
sphere_bar: Final = Implicit(_sphere_bar, (-2.05, -0.85, -0.85), (2.05, 0.85, 0.85), 300)
