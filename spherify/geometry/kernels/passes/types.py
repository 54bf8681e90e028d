"""What the passes are given, and the codes they speak in."""

from __future__ import annotations

from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.uint32]
Index: TypeAlias = np.uint32

MEASURES: Final = {"length": 0, "vtk": 1, "dual-area": 2}
LENGTH: Final = MEASURES["length"]
VTK: Final = MEASURES["vtk"]
DUAL_AREA: Final = MEASURES["dual-area"]

MOVED: Final = 0
CONSTANT: Final = 1  # the curvature is the same everywhere
NOT_FINITE: Final = 2  # a curvature is not a number, or infinite

NONE: Final = 0xFFFFFFFF  # no such index
RING: Final = 1  # the neighbours of a run are in order, all around; 0: they are in any


class Connectivity(NamedTuple):
    """Who touches whom, numbered as `spherify.geometry.kernels.numbering` does; all indices are uint32.

    Half-edge ``3·f + k`` runs from corner k of face f to the next corner of that face.

    Attributes:
        corners: (3, m) vertices of the faces.
        twins: (3m,) the half-edge against each half-edge, or NONE.
        first: (n + 1,) where the half-edges that start at each vertex begin in ``halfedges``.
        halfedges: (3m,) by the vertex they start at.
        runs: (r, 5) runs of neighbouring vertices that have as many neighbours each: first vertex, one behind the
            last, RING or not, number of neighbours, and where the neighbours of the run begin in ``ring``: first
            that of each vertex, then the second of each, and so on.
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
        moved: (3, n) positions after the movement, before the relaxation.
        normal: (3, n) vertex normals.
        curvature: (n,) K.
        area: (n,) sum of the areas of the faces at each vertex; then its weight as a neighbour.
        altitude: (n,) least altitude of the faces at each vertex.
        held_position: (3, h) where the held vertices are.
        bins: (n,) the bin of each K in the histogram.
        chosen: (2, n) values the selection still chooses from.
        counts: (BINS,) of the selection.
        sample: (SAMPLE,) of the selection.

    """

    position: Floats
    moved: Floats
    normal: Floats
    curvature: Floats
    area: Floats
    altitude: Floats
    held_position: Floats
    bins: NDArray[np.uint16]
    chosen: Floats
    counts: NDArray[np.int64]
    sample: Floats


class Scratch(NamedTuple):
    """What one thread writes for one block.

    Attributes:
        rows: (ROWS, STRIDE), see `spherify.geometry.kernels.passes.rings`.
        flat: (STRIDE,) not 0 for a vertex one of whose faces is flat.

    """

    rows: Floats
    flat: NDArray[np.int64]


class Mode(NamedTuple):
    """The parameters of a run the passes depend on; see `spherify.geometry.config.FlowConfig`."""

    measure: int
    window: tuple[float, float]
    step_bound: float
    relaxation_exponent: float
