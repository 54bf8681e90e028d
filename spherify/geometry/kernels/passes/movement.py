"""The elementary steps I_C and O_C themselves, and what moves all vertices alike."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from spherify.geometry.kernels.passes.jit import entry, inner
from spherify.geometry.kernels.passes.tracing import alternatively, either, traced
from spherify.geometry.kernels.passes.types import Buffers, Floats, Index, Ints
from spherify.geometry.kernels.passes.wide import (
    LANES,
    Array,
    Columns,
    Lane,
    Place,
    Wide,
    across,
    greater,
    lesser,
    where,
)
from spherify.geometry.kernels.passes.wide_vectors import Vector


class Along(NamedTuple):
    """How far vertices go along their normals.

    Attributes:
        K_min: the least curvature, and
        width: how far the greatest is from it.
        step: C.
        outward: 1 for O_C, 0 for I_C.
        bound: no vertex moves further than this times the least altitude of the faces at it.
        bounded: 0 without a bound.

    """

    K_min: Any
    width: Any
    step: Any
    outward: Any
    bound: Any
    bounded: Any


class Places(NamedTuple):
    """Where vertices are, in two forms.

    Attributes:
        x: (n,)
        y: (n,)
        z: (n,)
        rows: (4n,) x, y, z of each vertex, and something.

    """

    x: Any
    y: Any
    z: Any
    rows: Any


def load(places: Places, low: Place) -> Vector:
    """Read where eight vertices are."""
    return places.x.load(low), places.y.load(low), places.z.load(low)


def store(places: Places, p: Vector, row: Columns, low: Place, count: Place) -> None:
    """Write where vertices are, the first ``count`` of eight, and their rows."""

    def all_of_them() -> None:
        for array, part in zip((places.x, places.y, places.z), p, strict=True):
            array.store(low, part)
        places.rows.store_rows(low, across(row))

    def some() -> None:
        for array, part in zip((places.x, places.y, places.z), p, strict=True):
            array.store(low, part, count)
        places.rows.store_rows(low, across(row), count)

    alternatively(count < LANES, some, all_of_them)


def distance(K: Wide, altitude: Array, along: Along, low: Place) -> Wide:
    """-C·t for I_C(p) = p - C·t·n_p, or C·(1 - t) for O_C(p) = p + C·(1 - t)·n_p, t = (K - K_min) / width in [0, 1]."""
    t = (K - along.K_min) / along.width
    t = where(t < 0.0, 0.0, t)
    t = where(t > 1.0, 1.0, t)
    way = either(along.outward > 0, lambda: along.step * (1.0 - t), lambda: -(along.step * t))

    def bounded() -> Wide:
        most = along.bound * altitude.load(low)
        return lesser(most, greater(-most, way))

    return either(along.bounded > 0, bounded, lambda: way)


@traced
def move_group(
    places: Places, K: Array, normals: tuple[Array, Array, Array], altitude: Array, weights: Array,
    along: Along, weighed: Place, low: Place, count: Place,
) -> None:  # fmt: skip
    """Move a group; its rows are w·(x, y, z, 1), with the weights w, if ``weighed``."""
    way = distance(K.load(low), altitude, along, low)
    x, y, z = (part + way * n.load(low) for part, n in zip(load(places, low), normals, strict=True))

    def store_weighed() -> None:
        w = weights.load(low)
        store(places, (x, y, z), (w * x, w * y, w * z, w), low, count)

    alternatively(weighed > 0, store_weighed, lambda: store(places, (x, y, z), (x, y, z, x), low, count))


@traced
def row_group(places: Places, low: Place, count: Place) -> None:
    """Write the rows of a group as it is."""
    x, y, z = load(places, low)
    rows = across((x, y, z, x))
    alternatively(
        count < LANES,
        lambda: places.rows.store_rows(low, rows, count),
        lambda: places.rows.store_rows(low, rows),
    )


@inner
def move(use: Buffers, along: Along, weighed: bool, low: Index, high: Index) -> None:
    """Move vertices along their normals, in ``use.position`` and ``use.rows``, or, ``weighed``, in ``use.weighed``."""
    rows = use.weighed if weighed else use.rows
    places = Places(use.position[0], use.position[1], use.position[2], rows)
    normals = use.normal[0], use.normal[1], use.normal[2]
    for p in range(Lane(low), Lane(high), Lane(LANES)):
        count = min(Lane(LANES), Lane(high) - p)
        move_group(places, use.curvature, normals, use.altitude, use.area, along, Lane(weighed), p, count)


@inner
def write_rows(use: Buffers, low: Index, high: Index) -> None:
    """Write ``use.rows`` as ``use.position`` is."""
    places = Places(use.position[0], use.position[1], use.position[2], use.rows)
    for p in range(Lane(low), Lane(high), Lane(LANES)):
        row_group(places, p, min(Lane(LANES), Lane(high) - p))


@inner
def go_ahead(position: Floats, previous: Floats, momentum: float, low: Index, high: Index) -> None:
    """Go on from vertices by ``momentum`` times the way from where they were; where they are is previous then."""
    for k in range(3):
        x, before = position[k], previous[k]
        for p in range(low, high):
            here = x[p]
            x[p] = momentum * (here - before[p]) + here
            before[p] = here


@inner
def scale(
    position: Floats, centre: tuple[float, float, float], factor: float, low: Index, high: Index
) -> None:
    """Scale vertices about a centre: c + factor·(p - c)."""
    for k in range(3):
        x, c = position[k], centre[k]
        for p in range(low, high):
            x[p] = (x[p] - c) * factor + c


@entry
def unload(position: Floats, place: Ints, V: Floats, low: Index, high: Index) -> None:
    """Write positions (3, n) in places to V (3, n), some vertices of the mesh."""
    for k in range(3):
        x, to = position[k], V[k]
        for i in range(low, high):
            to[i] = x[np.uint64(place[i])]
