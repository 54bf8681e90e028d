"""Eight vertices of a run at a time: what is computed of them, from where, to where; see `rings`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce
from operator import add
from typing import Any, NamedTuple, TypeAlias

from spherify.geometry.kernels.passes.angles import inverse_root
from spherify.geometry.kernels.passes.dihedral import (
    FOLDED,
    Face,
    altitude_of,
    bend,
    bent,
    edge,
    face,
    is_flat,
    lower,
)
from spherify.geometry.kernels.passes.tracing import alternatively, either, repeated
from spherify.geometry.kernels.passes.wide import (
    LANES,
    Array,
    Place,
    Wide,
    columns,
    equal,
    first_lanes,
    greater,
    lesser,
    where,
)
from spherify.geometry.kernels.passes.wide_vectors import (
    Vector,
    added,
    cross,
    difference,
    dot,
    times,
)
from spherify.geometry.measures import ROUNDED

PLAIN, FULL, MEASURED = 0, 1, 2  # besides K and n_p: nothing; areas and least altitudes; areas and volumes


class Surface(NamedTuple):
    """Where a block is read from.

    Attributes:
        x: (n,) positions, and
        y: so on
        z: and so on.
        ring: `Connectivity.ring`.
        rows: (4n,) x, y, z of each vertex and something else; begins with a line, of which each row is half.
        weighed: (4n,) what is written of each vertex when it moves and is relaxed then.

    """

    x: Any
    y: Any
    z: Any
    ring: Any
    rows: Any
    weighed: Any


class Results(NamedTuple):
    """Where what is computed of a block goes.

    Attributes:
        K: (n,) curvatures.
        px: (n,) normals, and
        py: so on
        pz: and so on.
        area: (n,) sums of the areas at each vertex.
        altitude: (n,) least altitudes.
        volume: (BLOCK,) x Σ N_jx of each vertex of the block, see `spherify.geometry.kernels.passes.whole`.
        lengths: (BLOCK,) Σ |d_j|.
        flats: (BLOCK / LANES,) of each group, by a bit for each vertex, whether a face at it is flat to rounding.

    """

    K: Any
    px: Any
    py: Any
    pz: Any
    area: Any
    altitude: Any
    volume: Any
    lengths: Any
    flats: Any


class Block(NamedTuple):
    """Vertices of a run.

    Attributes:
        scale: of Σ l·θ, to K.
        dual: 1 for K of the measure ``dual-area``, where areas are wanted.
        low: the first vertex.
        count: how many, at most BLOCK.
        at: where the neighbours of the first begin in ``ring``.
        step: how far apart they lie.
        degree: how many each has.
        fetch: the first of as many vertices that move next, or 0.

    """

    scale: Any
    dual: Any
    low: Any
    count: Any
    at: Any
    step: Any
    degree: Any
    fetch: Any


Group: TypeAlias = Callable[[Surface, Results, Block, Place], Place]


def ring_group(degree: int, extras: int, *, by_area: bool) -> Group:
    """Make the code for eight vertices of that degree, with one of PLAIN, FULL and MEASURED."""

    def group(surface: Surface, to: Results, block: Block, k: Place) -> Place:
        x, y, z, ring, rows, _ = surface
        low, at, count = block.low + k, block.at + k, block.count - k
        p = (x.load(low), y.load(low), z.load(low))

        def neighbour(j: int) -> Vector:
            return difference(columns(rows.rows(ring, at + block.step * j))[:3], p)

        def next_face(j: int) -> Face:
            # Roots by the divider, as many as it gets done beside all else; areas take it, too.
            return face(d[j], d[j + 1], by_division=j % 2 == 0 or not by_area)

        d = [neighbour(degree - 1), neighbour(0)]  # one place further on than in the formulas
        faces, edges = [next_face(0)], []
        normal, along_x, areas = times(faces[0].normal, faces[0].inverse), faces[0].normal[0], faces[0].size
        for j in range(1, degree):
            d.append(neighbour(j) if j < degree - 1 else d[0])
            faces.append(next_face(j))
            if extras == MEASURED:
                along_x = along_x + faces[j].normal[0]
            if extras != PLAIN:
                areas = areas + faces[j].size
            edges.append(edge(d[j - 1], dot(d[j], d[j]), faces[j - 1], faces[j]))
            normal = added(normal, faces[j].normal, faces[j].inverse)
        edges.append(edge(d[-2], dot(d[-1], d[-1]), faces[-1], faces[0]))
        squared, there = dot(normal, normal), first_lanes(count)
        folded = ~(squared > (degree - FOLDED) ** 2)
        total = bent(edges, [*faces, faces[0]], folded, there, by_area=by_area)
        outputs = _outward(normal, squared, to)
        if extras != PLAIN:
            outputs += [(to.K, _weighed(total, areas, block)), (to.area, 0.5 * areas)]
        else:
            outputs.append((to.K, block.scale * total))
        if extras == FULL:
            over, under = reduce(
                lower,
                (
                    altitude_of(d[j], edges[j - 1].squared, d[j + 1], edges[j].squared, faces[j])
                    for j in range(degree)
                ),
            )
            outputs.append((to.altitude, (over / under).root()))
        if extras == MEASURED:
            to.volume.store(k, p[0] * along_x)
        _write(outputs, low, count)
        flat = is_flat(
            reduce(lesser, (one.squared for one in faces)), reduce(greater, (one.squared for one in edges))
        )
        return (there & flat).bits()

    return group


def _outward(normal: Vector, squared: Wide, to: Results) -> list[tuple[Array, Wide]]:
    """Return n_p, and where it goes."""
    inverse = where(squared <= ROUNDED**2, 0.0, inverse_root(squared))
    return list(zip((to.px, to.py, to.pz), times(normal, inverse), strict=True))


def _write(outputs: Sequence[tuple[Array, Wide]], low: Place, count: Place) -> None:
    """Write what belongs to the vertices from ``low`` on, for as many as are there."""

    def all_of_them() -> None:
        for array, value in outputs:
            array.store(low, value)

    def some() -> None:
        for array, value in outputs:
            array.store(low, value, count)

    alternatively(count < LANES, some, all_of_them)


def _weighed(total: Wide, areas: Wide, block: Block) -> Wide:
    """Return K of Σ l·θ, and of twice the areas for the measure ``dual-area``."""
    return either(block.dual > 0, lambda: 1.5 * total / areas, lambda: block.scale * total)


class Around(NamedTuple):
    """What goes from neighbour to neighbour of a group of any degree.

    Attributes:
        e: the edge vector before the last one.
        d: the last one.
        dd: d².
        face: between them.
        total: Σ l·θ; over the |N| of the faces, if wanted by area.
        normal: Σ N / |N|.
        along_x: Σ N_x.
        areas: Σ |N|.
        smallest: |N|².
        longest: d².
        altitude: the least, as of `altitude_of`.

    """

    e: Vector
    d: Vector
    dd: Wide
    face: Face
    total: Wide
    normal: Vector
    along_x: Wide
    areas: Wide
    smallest: Wide
    longest: Wide
    altitude: tuple[Wide, Wide]


def any_ring_group(*, by_area: bool) -> Group:
    """Make the code for eight vertices of any degree, with all that may be wanted."""

    def group(surface: Surface, to: Results, block: Block, k: Place) -> Place:
        x, y, z, ring, rows, _ = surface
        low, at, count = block.low + k, block.at + k, block.count - k
        p = (x.load(low), y.load(low), z.load(low))

        def turn(j: Place, s: Around) -> Around:
            f = difference(columns(rows.rows(ring, at + (j + 1).wrapped(block.degree) * block.step))[:3], p)
            ff, b = dot(f, f), face(s.d, f)
            return Around(
                e=s.d,
                d=f,
                dd=ff,
                face=b,
                total=s.total + bend(edge(s.e, s.dd, s.face, b), s.face, b, by_area=by_area),
                normal=added(s.normal, b.normal, b.inverse),
                along_x=s.along_x + b.normal[0],
                areas=s.areas + b.size,
                smallest=lesser(b.squared, s.smallest),
                longest=greater(ff, s.longest),
                altitude=lower(altitude_of(s.d, s.dd, f, ff, b), s.altitude),
            )

        e = difference(columns(rows.rows(ring, at + (block.degree - 1) * block.step))[:3], p)
        d = difference(columns(rows.rows(ring, at))[:3], p)
        zero, dd, first = equal(block.scale, 0.0), dot(d, d), face(e, d)
        nothing = (zero, zero, zero)
        begin = Around(
            e, d, dd, first, zero, nothing, zero, zero, first.squared, dd,
            altitude_of(e, dot(e, e), d, dd, first),
        )  # fmt: skip
        s = repeated(block.degree, begin, turn)
        outputs = _outward(s.normal, dot(s.normal, s.normal), to)
        outputs += [
            (to.K, _weighed(s.total, s.areas, block)),
            (to.area, 0.5 * s.areas),
            (to.altitude, (s.altitude[0] / s.altitude[1]).root()),
        ]
        to.volume.store(k, p[0] * s.along_x)
        _write(outputs, low, count)
        return (first_lanes(count) & is_flat(s.smallest, s.longest)).bits()

    return group


def measure_group(degree: int) -> Group:
    """Make the code that measures what is at eight vertices of that degree, and nothing else."""

    def group(surface: Surface, to: Results, block: Block, k: Place) -> Place:
        x, y, z, ring, rows, _ = surface
        low, at = block.low + k, block.at + k
        p = (x.load(low), y.load(low), z.load(low))

        def neighbour(j: int) -> Vector:
            return difference(columns(rows.rows(ring, at + block.step * j))[:3], p)

        d = [neighbour(degree - 1), neighbour(0)]
        normals, sizes, lengths = [cross(*d)], [], []
        for j in range(1, degree):
            d.append(neighbour(j) if j < degree - 1 else d[0])
            normals.append(cross(d[j], d[j + 1]))
        for j in range(degree):
            sizes.append(dot(normals[j], normals[j]).root())
            lengths.append(_length(dot(d[j], d[j]), by_division=j % 2 == 0))
        to.volume.store(k, p[0] * reduce(add, (normal[0] for normal in normals)))
        to.lengths.store(k, reduce(add, lengths))
        _write([(to.area, 0.5 * reduce(add, sizes))], low, block.count - k)
        return k - k

    return group


def any_measure_group() -> Group:
    """Make the same for any degree."""

    def group(surface: Surface, to: Results, block: Block, k: Place) -> Place:
        x, y, z, ring, rows, _ = surface
        low, at = block.low + k, block.at + k
        p = (x.load(low), y.load(low), z.load(low))

        def further(j: Place, s: tuple[Vector, Wide, Wide, Wide]) -> tuple[Vector, Wide, Wide, Wide]:
            d, along_x, areas, lengths = s
            f = difference(columns(rows.rows(ring, at + (j + 1).wrapped(block.degree) * block.step))[:3], p)
            normal = cross(d, f)
            return f, along_x + normal[0], areas + dot(normal, normal).root(), lengths + dot(d, d).root()

        zero = equal(block.scale, 0.0)
        d = difference(columns(rows.rows(ring, at))[:3], p)
        _, along_x, areas, lengths = repeated(block.degree, (d, zero, zero, zero), further)
        to.volume.store(k, p[0] * along_x)
        to.lengths.store(k, lengths)
        _write([(to.area, 0.5 * areas)], low, block.count - k)
        return k - k

    return group


def _length(squared: Wide, *, by_division: bool) -> Wide:
    """√, in one way or the other."""
    return squared.root() if by_division else squared * inverse_root(squared)
