"""What the passes are given, and the codes they speak in."""

from __future__ import annotations

from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
Indices: TypeAlias = NDArray[np.uint32]
Flats: TypeAlias = NDArray[np.uint64]
Index: TypeAlias = np.uint32

MEASURES: Final = {"length": 0, "vtk": 1, "dual-area": 2}
VTK: Final = MEASURES["vtk"]
DUAL_AREA: Final = MEASURES["dual-area"]

MOVED: Final = 0
CONSTANT: Final = 1  # the curvature is the same everywhere
NOT_FINITE: Final = 2  # a curvature is not a number, or infinite

# The passes of an elementary step, in this order; a task names some.
VERTICES: Final = 1
EXTREMES: Final = 2
MOVE: Final = 4
BEYOND: Final = 8  # VERTICES once more behind the last step, which the next T then need not begin with
HOLD: Final = 16
# Those of a measurement of the surface by its rings, behind the last step, in this order.
INTEGRATE: Final = 32  # along with BEYOND, or by itself
CENTRE: Final = 64
RADII: Final = 128
VARIATION: Final = 256
# Those that move all vertices alike.
AHEAD: Final = 512
SCALE: Final = 1024
# Before all of these, unless the rows are as the positions, as MOVE and what follows it leave them.
ROWS: Final = 2048

NONE: Final = 0xFFFFFFFF  # no such index
FOUND: Final = 4  # numbers a part has found
FIRST, LAST, BACK, ON = 0, 1, 5, 6  # columns of `Connectivity.runs`
RING: Final = 1  # the neighbours of a run are in order, all around; 0: they are in any


class Connectivity(NamedTuple):
    """Who touches whom, numbered as `spherify.geometry.kernels.numbering` does; all indices are uint32.

    Half-edge ``3·f + k`` runs from corner k of face f to the next corner of that face.

    Attributes:
        corners: (3, m) vertices of the faces.
        twins: (3m,) the half-edge against each half-edge, or NONE.
        first: (n + 1,) where the half-edges that start at each vertex begin in ``halfedges``.
        halfedges: (3m,) by the vertex they start at.
        runs: (r, 7) runs of neighbouring vertices that have as many neighbours each: first vertex, one behind the
            last, RING or not, number of neighbours, and where the neighbours of the run begin in ``ring``: first
            that of each vertex, then the second of each, and so on; the first run with neighbours of this run or of
            any behind it, and one behind the last with neighbours of this run or of any before it: BACK and ON.
        ring: neighbouring vertices, along all edges; those of a run marked RING counter-clockwise.
        held: vertices that stay where they are.

    """

    corners: Indices
    twins: Indices
    first: Indices
    halfedges: Indices
    runs: Indices
    ring: Indices
    held: Indices


class Buffers(NamedTuple):
    """What the passes write for all vertices; allocated once a kernel.

    Attributes:
        position: (3, n), in and out.
        previous: (3, n) positions of the iteration before; (3, 0) until there is momentum.
        rows: (4n,) x, y, z of each vertex and something, for whoever wants all three at once.
        weighed: (4n,) w·(x, y, z, 1) of each vertex after the movement, with its weight w as a neighbour.
        moved: (3, n) of what is done on the sphere; the memory is that of ``weighed``.
        normal: (3, n) vertex normals.
        curvature: (n,) K.
        area: (n,) sum of the areas of the faces at each vertex; then its weight as a neighbour.
        altitude: (n,) least altitude of the faces at each vertex.
        held_position: (3, h) where the held vertices are.
        bins: (n,) the bin of each K in the histogram.
        chosen: (2, n) values the selection still chooses from.
        counts: (parts, BINS) of the selection.
        samples: (parts, SAMPLE) of the selection.
        sums: (r, SUMS) of the vertices of each run; see `spherify.geometry.kernels.passes.whole`.
        whole: (RESULTS,) of all of them.
        found: (parts + 1, FOUND) what each thread has found of its part, and one of them of all.
        meeting: (SIZE,) see `spherify.geometry.kernels.passes.meeting`.

    """

    position: Floats
    previous: Floats
    rows: Floats
    weighed: Floats
    moved: Floats
    normal: Floats
    curvature: Floats
    area: Floats
    altitude: Floats
    held_position: Floats
    bins: NDArray[np.uint16]
    chosen: Floats
    counts: Ints
    samples: Floats
    sums: Floats
    whole: Floats
    found: Floats
    meeting: Ints


class Scratch(NamedTuple):
    """What one thread writes for one block.

    Attributes:
        rows: (ROWS, STRIDE) of numbers that have their places in the block.
        flats: (BLOCK / LANES,), see `spherify.geometry.kernels.passes.groups.Results`.

    """

    rows: Floats
    flats: Flats


class Mode(NamedTuple):
    """The parameters of a run the passes depend on; see `spherify.geometry.config.FlowConfig`.

    The last one is of the mesh: whether a step's movement goes over its vertices along with the next step's curvature
    (`spherify.geometry.kernels.passes.sweep`).
    """

    measure: int
    window: tuple[float, float]
    step_bound: float
    relaxation_exponent: float
    at_once: bool


class Task(NamedTuple):
    """What `spherify.geometry.kernels.passes.step.work` is to do, in ``k_in`` inward and ``k_out`` outward steps.

    Attributes:
        passes: VERTICES + …
        known: whether the first step begins with curvature and normals as they are, its extremes ``K_min``, ``K_max``.
        first: first vertex of the part.
        last: one behind its last.
        first_run: the run that ``first`` begins.
        last_run: one behind the run that ``last`` ends.
        k_in: inward elementary steps.
        k_out: outward ones.
        step: C.
        relaxation: fraction of the umbrella vector.
        K_min: as EXTREMES takes them and leaves them.
        K_max: as above.
        greatest: area at a vertex, for its weight.
        momentum: of AHEAD.
        centre: of SCALE, three coordinates.
        factor: likewise.
        part: which of them.
        parts: how many threads do the same at once, a part each.
        variation: below which RADII and VARIATION are wanted; nan may come of a greater one.
        area: to which the surface is scaled about its centroid when it has been measured; 0: not.

    """

    passes: int
    first: np.uint32
    last: np.uint32
    first_run: int
    last_run: int
    k_in: int = 0
    k_out: int = 0
    step: float = 0.0
    relaxation: float = 0.0
    K_min: float = np.inf
    K_max: float = -np.inf
    greatest: float = 0.0
    known: bool = False
    momentum: float = 0.0
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    factor: float = 1.0
    part: int = 0
    parts: int = 1
    variation: float = np.inf
    area: float = 0.0


class Found(NamedTuple):
    """What a task has found, of the last elementary step: the same for all parts.

    Attributes:
        end: MOVED; or CONSTANT or NOT_FINITE, if the curvature became so, and the positions mean nothing.
        K_min: least K, or that of the window after EXTREMES; after BEYOND least K behind the last step, or not a
            number if some K is none or infinite.
        K_max: greatest.
        greatest: area at a vertex.

    """

    end: int
    K_min: float
    K_max: float
    greatest: float
