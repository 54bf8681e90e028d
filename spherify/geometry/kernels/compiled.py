"""The compiled engine: the steps of the reference as machine code, by numba.

The same numbers up to rounding (1e-12 relative after one step), many times as quick. Curvature that is not
finite is left to the reference, so that a mesh that breaks does so in the same way by either.
"""

from __future__ import annotations

import numpy as np

from spherify.geometry.config import FlowConfig, Stage
from spherify.geometry.kernels.numbering import Numbering
from spherify.geometry.kernels.passes import rings, selection, shape
from spherify.geometry.kernels.passes.step import transform
from spherify.geometry.kernels.passes.types import CONSTANT, MEASURES, NOT_FINITE, Buffers, Mode, Scratch
from spherify.geometry.kernels.reference import ReferenceKernel
from spherify.geometry.mesh import Floats
from spherify.geometry.roundness import Shape
from spherify.geometry.topology import Topology


class CompiledKernel:
    """T on one connectivity, on one thread. Not to be shared between threads: its buffers are."""

    def __init__(self, topology: Topology, config: FlowConfig) -> None:
        held = topology.boundary_vertices if config.boundary == "fixed" else np.zeros(0, dtype=np.int64)
        self._reference = ReferenceKernel(topology, config)
        self._numbering = Numbering.of(topology, held)
        self._mesh = self._numbering.connectivity
        self._use = buffers(topology.n_vertices, len(held))
        self._scratch = _scratch()
        self._face_area = np.empty(len(topology.faces))
        self._sums = np.empty((8, shape.BLOCK))
        self._mode = Mode(
            measure=MEASURES[config.measure],
            window=(float(config.window[0]), float(config.window[1])),
            step_bound=float(config.step_bound),
            relaxation_exponent=float(config.relaxation_exponent),
        )
        self._closed = topology.closed
        self._edge_count = len(topology.edges)
        self._single = self._numbering.place[topology.edges[topology.boundary_edges]]

    def transform(self, V: Floats, stage: Stage, step: float, relaxation: float) -> Floats | None:
        """See `spherify.geometry.kernels.interface.Kernel.transform`."""
        self._load(V)
        end = transform(
            self._mesh,
            self._use,
            self._scratch,
            self._mode,
            stage.k_in,
            stage.k_out,
            float(step),
            float(relaxation),
        )
        if end == CONSTANT:
            return None
        if end == NOT_FINITE:
            return self._reference.transform(V, stage, step, relaxation)
        moved = np.empty(V.shape, order="F")
        for k in range(3):
            np.take(self._use.position[k], self._numbering.place, out=moved[:, k], mode="clip")
        return moved

    def shape(self, V: Floats) -> Shape:
        """See `spherify.geometry.kernels.interface.Kernel.shape`."""
        self._load(V)
        use = self._use
        area, volume, x, y, z, edges, variation = shape.measure(
            use.position, self._mesh.corners, self._face_area, use.curvature, self._sums, self._closed
        )
        if len(self._single):  # the sum over the faces has these once, all others twice
            a, b = use.position[:, self._single[:, 0]], use.position[:, self._single[:, 1]]
            edges += float(np.sqrt(((b - a) ** 2).sum(axis=0)).sum())
        return Shape(area, volume, np.array([x, y, z]), edges / 2 / self._edge_count, variation)

    def _load(self, V: Floats) -> None:
        for k in range(3):
            np.take(V[:, k], self._numbering.order, out=self._use.position[k], mode="clip")


class CompiledEngine:
    """Machine code on one thread; made at the first call on a machine, and kept, see `passes.jit`."""

    name = "compiled"

    def prepare(self, topology: Topology, config: FlowConfig) -> CompiledKernel:
        """See `spherify.geometry.kernels.interface.Engine.prepare`."""
        return CompiledKernel(topology, config)


def buffers(n: int, n_held: int) -> Buffers:
    """Allocate what the passes write, for n vertices of which some are held."""
    return Buffers(
        position=np.empty((3, n)),
        moved=np.empty((3, n)),
        normal=np.empty((3, n)),
        curvature=np.empty(n),
        area=np.empty(n),
        altitude=np.empty(n),
        held_position=np.empty((3, n_held)),
        bins=np.empty(n, dtype=np.uint16),
        chosen=np.empty((2, n)),
        counts=np.empty(selection.BINS, dtype=np.int64),
        sample=np.empty(selection.SAMPLE),
    )


def _scratch() -> Scratch:
    size, line = (
        rings.ROWS * rings.STRIDE,
        8,
    )  # numbers in a cache line: rows that begin with one are read in one go
    space = np.empty(size + line)
    start = -(space.ctypes.data // 8) % line
    rows = space[start : start + size].reshape(rings.ROWS, rings.STRIDE)
    return Scratch(rows, np.empty(rings.STRIDE, dtype=np.int64))
