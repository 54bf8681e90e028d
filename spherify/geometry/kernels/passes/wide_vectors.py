"""Vectors of three wide numbers."""

from __future__ import annotations

from typing import TypeAlias

from spherify.geometry.kernels.passes.wide import Wide

Vector: TypeAlias = tuple[Wide, Wide, Wide]


def dot(a: Vector, b: Vector) -> Wide:
    """Return a · b."""
    return a[0].fma(b[0], a[1].fma(b[1], a[2] * b[2]))


def cross(a: Vector, b: Vector) -> Vector:
    """Return a × b."""
    return (
        a[1].fma(b[2], -(a[2] * b[1])),
        a[2].fma(b[0], -(a[0] * b[2])),
        a[0].fma(b[1], -(a[1] * b[0])),
    )


def difference(a: Vector, b: Vector) -> Vector:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def times(a: Vector, by: Wide) -> Vector:
    """Return by·a."""
    return a[0] * by, a[1] * by, a[2] * by


def added(sum_: Vector, a: Vector, by: Wide) -> Vector:
    """Return the sum and by·a."""
    return a[0].fma(by, sum_[0]), a[1].fma(by, sum_[1]), a[2].fma(by, sum_[2])
