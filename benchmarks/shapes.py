"""Long-limbed bodies for the roundness table, harder than the samples; built with their parts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Final

import numpy as np

from spherify.geometry.mesh import Floats
from spherify.geometry.samples.creatures import Point, _capsule, _ellipsoid, _mirrored, _union
from spherify.geometry.samples.implicit import Implicit

Chain = tuple[tuple[Point, float], ...]


def _limb(P: Floats, chain: Chain) -> list[Floats]:
    """Rods from point to point, each with the radius given there."""
    return [_capsule(P, a, b, r_a, r_b) for (a, r_a), (b, r_b) in pairwise(chain)]


def _star(P: Floats) -> Floats:
    parts = [_ellipsoid(P, (0, 0, 0), (0.35, 0.35, 0.35))]
    arms = 9
    for i in range(arms):
        z, angle = 1 - 2 * (i + 0.5) / arms, 2.399963 * i  # the golden angle: directions spread evenly
        length = 1 + 0.5 * (37 * i % arms) / arms
        across = math.sqrt(1 - z * z)
        tip = (length * across * math.cos(angle), length * across * math.sin(angle), length * z)
        parts.append(_capsule(P, (0, 0, 0), tip, 0.09, 0.05))
    return _union(parts, 0.1)


def _bone(P: Floats) -> Floats:
    Q = np.stack([np.abs(P[:, 0]), np.abs(P[:, 1]), P[:, 2]], axis=1)
    shaft = _capsule(P, (-1.5, 0, 0), (1.5, 0, 0), 0.09, 0.09)
    return _union([shaft, _ellipsoid(Q, (1.6, 0.22, 0), (0.36, 0.3, 0.3))], 0.15)


def _man(P: Floats) -> Floats:
    Q = _mirrored(P)
    arm = (
        ((0, 0.2, 1.52), 0.08),
        ((0, 0.55, 1.3), 0.06),
        ((0.1, 0.85, 1.15), 0.05),
        ((0.15, 0.98, 1.1), 0.03),
    )
    leg = (
        ((0, 0.1, 1.0), 0.13),
        ((0, 0.15, 0.5), 0.085),
        ((0, 0.17, 0.06), 0.055),
        ((0.2, 0.19, 0.04), 0.045),
    )
    trunk = (((0, 0, 1.0), 0.19), ((0, 0, 1.5), 0.23))
    neck = (((0, 0, 1.5), 0.08), ((0, 0, 1.8), 0.08))
    parts = [*_limb(P, trunk), *_limb(P, neck), _ellipsoid(P, (0, 0, 1.87), (0.14, 0.12, 0.16))]
    return _union([*parts, *_limb(Q, arm), *_limb(Q, leg)], 0.05)


def _sauropod(P: Floats) -> Floats:
    Q = _mirrored(P)
    neck = (((0.6, 0, 1.15), 0.2), ((1.5, 0, 1.9), 0.11), ((2.1, 0, 2.6), 0.09), ((2.4, 0, 2.6), 0.07))
    tail = (((-0.6, 0, 1.0), 0.22), ((-1.6, 0, 0.75), 0.1), ((-2.6, 0, 0.6), 0.05), ((-3.3, 0, 0.75), 0.04))
    fore = (((0.45, 0.25, 0.8), 0.16), ((0.45, 0.28, 0.1), 0.12))
    hind = (((-0.45, 0.25, 0.8), 0.17), ((-0.45, 0.28, 0.1), 0.12))
    trunk = _ellipsoid(P, (0, 0, 1.0), (0.8, 0.4, 0.45))
    return _union([trunk, *_limb(P, neck), *_limb(P, tail), *_limb(Q, fore), *_limb(Q, hind)], 0.12)


def _hand(P: Floats) -> Floats:
    parts = [_ellipsoid(P, (0, 0, 0), (0.5, 0.42, 0.16)), _capsule(P, (-0.3, 0, 0), (-1.0, 0, 0), 0.2, 0.18)]
    for y, length, angle in ((0.3, 0.85, 0.2), (0.1, 1.0, 0.05), (-0.1, 0.95, -0.06), (-0.3, 0.75, -0.2)):
        tip = (0.4 + length * math.cos(angle), y + length * math.sin(angle), 0.03)
        parts.append(_capsule(P, (0.35, y, 0), tip, 0.085, 0.06))
    parts.append(_capsule(P, (-0.1, 0.3, 0), (0.35, 0.85, 0.1), 0.1, 0.07))
    return _union(parts, 0.06)


def _horse(P: Floats) -> Floats:
    Q = _mirrored(P)
    fore = (((0.65, 0.17, 1.1), 0.11), ((0.65, 0.18, 0.55), 0.06), ((0.65, 0.18, 0.06), 0.05))
    hind = (((-0.7, 0.17, 1.1), 0.14), ((-0.65, 0.18, 0.6), 0.065), ((-0.75, 0.18, 0.06), 0.05))
    tail = (((-0.95, 0, 1.3), 0.06), ((-1.25, 0, 0.9), 0.06), ((-1.3, 0, 0.4), 0.05))
    trunk = [_capsule(P, (-0.7, 0, 1.2), (0.7, 0, 1.25), 0.27, 0.3)]
    trunk += _limb(P, (((0.75, 0, 1.35), 0.17), ((1.2, 0, 1.9), 0.12)))
    trunk += _limb(P, (((1.15, 0, 1.95), 0.13), ((1.65, 0, 1.8), 0.08)))
    ear = _capsule(Q, (1.15, 0.07, 2.0), (1.1, 0.1, 2.2), 0.05, 0.03)
    return _union([*trunk, ear, *_limb(Q, fore), *_limb(Q, hind), *_limb(P, tail)], 0.06)


SHAPES: Final[Mapping[str, Implicit]] = {
    "star": Implicit(_star, (-1.5, -1.5, -1.5), (1.5, 1.5, 1.5), 1500),
    "bone": Implicit(_bone, (-2, -0.6, -0.4), (2, 0.6, 0.4), 800),
    "man": Implicit(_man, (-0.3, -1.1, -0.1), (0.4, 1.1, 2.1), 1500),
    "sauropod": Implicit(_sauropod, (-3.5, -0.6, -0.1), (2.6, 0.6, 2.8), 1500),
    "hand": Implicit(_hand, (-1.3, -0.8, -0.3), (1.6, 1.1, 0.3), 1200),
    "horse": Implicit(_horse, (-1.5, -0.5, -0.1), (1.9, 0.5, 2.4), 1500),
}
