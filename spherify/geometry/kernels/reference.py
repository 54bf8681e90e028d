"""The reference engine: numpy, readable beside the paper, the same bits every time."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from spherify.geometry import measures, transformation
from spherify.geometry.ascent import ascended
from spherify.geometry.config import FlowConfig, Stage
from spherify.geometry.covering import Covering, centre_inside, covering
from spherify.geometry.curvature import curvature_from
from spherify.geometry.finish import Energy, energies
from spherify.geometry.mesh import Floats, Ints
from spherify.geometry.metrics import Figures, figures_of
from spherify.geometry.plain_thinning import PlainThinning
from spherify.geometry.roundness import ALL, Shape, Wanted, shape_of
from spherify.geometry.thinning import Thinning
from spherify.geometry.topology import Topology
from spherify.geometry.unfolding import Unfolded, ahead_along_radii, evened_out, folds, spread, unfolded


class ReferenceKernel:
    """T on one connectivity, in plain numpy."""

    def __init__(self, topology: Topology, config: FlowConfig) -> None:
        self._topology = topology
        self._config = config
        self._held = topology.boundary_vertices if config.boundary == "fixed" else np.zeros(0, dtype=np.int64)

    def transform(
        self,
        V: Floats,
        stage: Stage,
        step: float,
        relaxation: float,
        *,
        previous: Floats | None = None,
        momentum: float = 0.0,
        measured: Wanted | None = None,  # of which nothing is had by the way
    ) -> Floats | None:
        """See `spherify.geometry.kernels.interface.Kernel.transform`."""
        if previous is not None and momentum > 0:
            V = V + momentum * (V - previous)
        return self._applied(V, stage, partial(self._elementary_step, step=step, relaxation=relaxation))

    def transform_radially(self, V: Floats, stage: Stage, step: float, centre: Floats) -> Floats | None:
        """See `spherify.geometry.kernels.interface.Kernel.transform_radially`."""
        return self._applied(V, stage, partial(self._radial_step, step=step, centre=centre))

    def ahead_along_radii(self, V: Floats, previous: Floats, centre: Floats, momentum: float) -> Floats:
        """See `spherify.geometry.kernels.interface.Kernel.ahead_along_radii`."""
        return ahead_along_radii(V, previous, centre, momentum)

    def even_out(self, V: Floats, centre: Floats, stage: Stage) -> Floats | None:
        """See `spherify.geometry.kernels.interface.Kernel.even_out`."""
        return evened_out(V, centre, stage.k_in, stage.k_out)

    def unfold(
        self, V: Floats, centre: Floats, log_weights: Floats, *, exponent: float, damping: float, rounds: int
    ) -> Unfolded:
        """See `spherify.geometry.kernels.interface.Kernel.unfold`."""
        return unfolded(
            V, self._topology, centre, log_weights, exponent=exponent, damping=damping, rounds=rounds
        )

    def spread(self, V: Floats, centre: Floats, rounds: int) -> Unfolded:
        """See `spherify.geometry.kernels.interface.Kernel.spread`."""
        return spread(V, self._topology, centre, rounds)

    def ascend(self, V: Floats, previous: Floats, centre: Floats, momentum: float) -> Floats:
        """See `spherify.geometry.kernels.interface.Kernel.ascend`."""
        return ascended(V, self._topology.faces, previous, centre, momentum)

    def energies(self, F: Ints, barrier: float) -> Callable[[Floats], Energy | None]:
        """See `spherify.geometry.kernels.interface.Kernel.energies`."""
        return energies(F, barrier)

    @property
    def thinning(self) -> type[Thinning]:
        """See `spherify.geometry.kernels.interface.Kernel.thinning`."""
        return PlainThinning

    def covering(self, V: Floats, centre: Floats) -> Covering:
        """See `spherify.geometry.kernels.interface.Kernel.covering`."""
        return covering(V, self._topology.faces, centre)

    def centre_inside(self, V: Floats, near: Floats) -> Floats | None:
        """See `spherify.geometry.kernels.interface.Kernel.centre_inside`."""
        return centre_inside(V, self._topology.faces, near, partial(self.covering, V))

    def folds(self, V: Floats, centre: Floats) -> tuple[int, float]:
        """See `spherify.geometry.kernels.interface.Kernel.folds`."""
        return folds(measures.normalised(V - centre), self._topology.faces)

    def shape(self, V: Floats, wanted: Wanted = ALL) -> Shape:
        """See `spherify.geometry.kernels.interface.Kernel.shape`."""
        return shape_of(V, self._topology, wanted)

    def figures(self, V: Floats, centre: Floats) -> Figures:
        """See `spherify.geometry.kernels.interface.Kernel.figures`."""
        return figures_of(V, self._topology, self._config.measure, centre)

    def scaled(self, V: Floats, centre: Floats, factor: float) -> Floats:
        """See `spherify.geometry.kernels.interface.Kernel.scaled`."""
        return measures.scaled(V, centre, factor)

    def _applied(
        self, V: Floats, stage: Stage, elementary: Callable[[Floats, transformation.Direction], Floats | None]
    ) -> Floats | None:
        moved = np.asfortranarray(V)
        for along in [transformation.inward] * stage.k_in + [transformation.outward] * stage.k_out:
            next_positions = elementary(moved, along)
            if next_positions is None:
                return None
            moved = next_positions
        return moved

    def _radial_step(
        self, V: Floats, along: transformation.Direction, step: float, centre: Floats
    ) -> Floats | None:
        vectors = measures.area_vectors(V, self._topology.faces)
        areas, face_normals = measures.norm(vectors), measures.normalised(vectors)
        K = curvature_from(V, self._topology, self._config.measure, face_normals, areas)
        t = transformation.normalised_curvature(K, self._config.window)
        if t is None:
            return None
        return V + (step * along(t))[:, None] * measures.normalised(V - centre)

    def _elementary_step(
        self, V: Floats, along: transformation.Direction, step: float, relaxation: float
    ) -> Floats | None:
        F, n, config = self._topology.faces, self._topology.n_vertices, self._config
        vectors = measures.area_vectors(V, F)
        areas, face_normals = measures.norm(vectors), measures.normalised(vectors)
        normals = measures.vertex_normals(face_normals, F, n)
        K = curvature_from(V, self._topology, config.measure, face_normals, areas)
        t = transformation.normalised_curvature(K, config.window)
        if t is None:
            return None
        distance = step * along(t)
        if config.step_bound > 0:
            distance = transformation.bounded(distance, config.step_bound, V, F, areas)
        moved = V + distance[:, None] * normals
        if relaxation > 0:
            weights = transformation.neighbour_weights(F, areas, config.relaxation_exponent, n)
            moved = transformation.relaxed(moved, normals, self._topology, weights, relaxation)
        moved[self._held] = V[self._held]
        return moved


class ReferenceEngine:
    """Plain numpy on one thread."""

    name = "reference"
    ready = True

    def warm(self) -> None:
        """See `spherify.geometry.kernels.interface.Engine.warm`: there is nothing to make."""

    def prepare(self, topology: Topology, config: FlowConfig) -> ReferenceKernel:
        """See `spherify.geometry.kernels.interface.Engine.prepare`."""
        return ReferenceKernel(topology, config)
