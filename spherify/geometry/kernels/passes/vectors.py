"""Vectors as three numbers, which stay in registers."""

from __future__ import annotations

from typing import TypeAlias

from spherify.geometry.kernels.passes.arithmetic import fma
from spherify.geometry.kernels.passes.jit import inner

Vector: TypeAlias = tuple[float, float, float]


@inner
def dot(a: Vector, b: Vector) -> float:
    """Return a · b."""
    return fma(a[0], b[0], fma(a[1], b[1], a[2] * b[2]))


@inner
def cross(a: Vector, b: Vector) -> Vector:
    """Return a × b."""
    return (
        fma(a[1], b[2], -(a[2] * b[1])),
        fma(a[2], b[0], -(a[0] * b[2])),
        fma(a[0], b[1], -(a[1] * b[0])),
    )


@inner
def longer(sum_: Vector, a: Vector, scale: float) -> Vector:
    """Return the sum and scale·a."""
    return fma(a[0], scale, sum_[0]), fma(a[1], scale, sum_[1]), fma(a[2], scale, sum_[2])
