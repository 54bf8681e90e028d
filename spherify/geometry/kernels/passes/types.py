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


class Connectivity(NamedTuple):
    """Who touches whom, numbered as `spherify.geometry.kernels.numbering` does; all indices are uint32.

    Attributes:
        corners: (3, m) vertices of the faces.
        ends: (2, i) vertices of the interior edges, in the direction in which their first face runs.
        sides: (2, i) the two faces of the interior edges.
        runs: (r, 8) runs of neighbouring vertices that have as many edges and faces each: first vertex, one
            behind the last; then the number of interior edges, of faces and of all edges at each of them, each followed
            by where the lists of the run begin in the three arrays below. Lists of a run lie neighbour by neighbour:
            first that of each vertex, then the second of each, and so on.
        edges_at: interior edges at the vertices.
        faces_at: faces at the vertices.
        ring: neighbouring vertices, along all edges.
        held: vertices that stay where they are.

    """

    corners: Indices
    ends: Indices
    sides: Indices
    runs: Indices
    edges_at: Indices
    faces_at: Indices
    ring: Indices
    held: Indices


class Buffers(NamedTuple):
    """What the passes write; allocated once a kernel.

    Attributes:
        position: (3, n), in and out.
        normal: (3, n) vertex normals; area-weighted positions in between.
        curvature: (n,) K.
        area: (n,) sum of the areas of the faces at each vertex; then its weight as a neighbour.
        altitude: (n,) least altitude of the faces at each vertex.
        weighted: (3, n) positions times weights.
        face_normal: (3, m) n_f.
        face_area: (m,)
        face_altitude: (m,)
        edge_value: (i,)
        scratch: (4, BLOCK) what one block hands from loop to loop.
        lanes: (3, WINDOW) running extremes and finiteness of K.
        held_position: (3, h) where the held vertices are.
        counts: (BINS,) of the selection.
        chosen: (2, n) values the selection still chooses from.

    """

    position: Floats
    normal: Floats
    curvature: Floats
    area: Floats
    altitude: Floats
    weighted: Floats
    face_normal: Floats
    face_area: Floats
    face_altitude: Floats
    edge_value: Floats
    scratch: Floats
    lanes: Floats
    held_position: Floats
    counts: NDArray[np.int64]
    chosen: Floats


class Mode(NamedTuple):
    """The parameters of a run the passes depend on; see `spherify.geometry.config.FlowConfig`."""

    measure: int
    window: tuple[float, float]
    step_bound: float
    relaxation_exponent: float
