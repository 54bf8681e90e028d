"""The curvature transformation as a method: T once an iteration, with what is ours between iterations.

Vartziotis, "Curvature transformation", arXiv:1608.03898, section 2. Momentum and annealing are ours.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from spherify.geometry.config import FlowConfig
from spherify.geometry.kernels import Engine, Kernel
from spherify.geometry.mesh import Floats
from spherify.geometry.methods.interface import Standstill, Step
from spherify.geometry.progress import Layout, Memory, Progress
from spherify.geometry.roundness import Shape
from spherify.geometry.schedule import stage_at
from spherify.geometry.topology import Topology

MOMENTUM_GROWTH: Final = 0.02  # a momentum of 0.9 is reached after 45 iterations without a fall of sphericity
PLATEAU_RISE: Final = 1e-4  # a smaller rise of the best sphericity counts as none


class Control(NamedTuple):
    """What the next iteration depends on besides positions.

    Attributes:
        momentum: b of the next iteration.
        annealing: what step and relaxation are multiplied by.
        plateau: the sphericity that has to be exceeded for the waiting to begin anew.
        waited: iterations since it was.

    """

    momentum: float
    annealing: float
    plateau: float
    waited: float

    @classmethod
    def of(cls, progress: Progress) -> Control:
        """Read it from where a run is."""
        return cls(*map(float, progress.memory["control"]))


class CurvatureTransformation:
    """T on one mesh, see `spherify.geometry.methods.interface.Method`."""

    def __init__(self, topology: Topology, config: FlowConfig, engine: Engine, *, unit: float) -> None:
        """Prepare it; ``unit`` is the length of the mesh's own unit in the frame."""
        self._n = topology.n_vertices
        self._config = config
        self._kernel: Kernel = engine.prepare(topology, config)
        self._unit = unit
        self._initial_mean_edge = 0.0
        self.computed_by = engine.name

    @property
    def layout(self) -> Layout:
        """See `Method.layout`."""
        return {"previous": ((self._n, 3), np.float64), "control": ((len(Control._fields),), np.float64)}

    def shape(self, V: Floats) -> Shape:
        """See `Method.shape`."""
        return self._kernel.shape(V)

    def begin(self, V: Floats, shape: Shape) -> Memory:
        """See `Method.begin`."""
        self._initial_mean_edge = shape.mean_edge
        return {"previous": V, "control": np.array(Control(0.0, 1.0, shape.sphericity, 0))}

    def step(self, progress: Progress) -> float:
        """Return C of the next iteration, in the frame."""
        unit = {
            "absolute": self._unit,
            "initial-mean-edge": self._initial_mean_edge,
            "mean-edge": progress.shape.mean_edge,
        }[self._config.step_unit]
        return self._config.step * Control.of(progress).annealing * unit

    def stalled(self, progress: Progress) -> str | None:
        """See `Method.stalled`: annealed down to the least step."""
        annealing = self._config.annealing
        if annealing is None or self._config.step * Control.of(progress).annealing >= annealing.min_step:
            return None
        return (
            f"the best sphericity {progress.best_shape.sphericity:.6f} did not rise by {PLATEAU_RISE:g} while the "
            f"step was reduced to {annealing.min_step:g} {self._config.step_unit}"
        )

    def advance(self, progress: Progress) -> Step:
        """See `Method.advance`."""
        control, here = Control.of(progress), progress.position
        ahead = here
        if control.momentum > 0:
            ahead = here + control.momentum * (here - progress.memory["previous"])
        moved = self._kernel.transform(
            ahead,
            stage_at(self._config.schedule, progress.iteration),
            self.step(progress),
            self._config.relaxation * control.annealing,
        )
        if moved is None:
            return Standstill(
                "the curvature is the same at every vertex, so the transformation does not move any"
            )
        return moved

    def remember(self, progress: Progress, shape: Shape) -> Memory:
        """See `Method.remember`: momentum and annealing brought up to date."""
        config, control, reached = self._config, Control.of(progress), shape.sphericity
        momentum = min(control.momentum + MOMENTUM_GROWTH, config.momentum)
        if reached < progress.shape.sphericity:
            momentum = 0.0
        annealing, plateau, waited = control.annealing, control.plateau, control.waited + 1
        if reached > plateau + PLATEAU_RISE:
            plateau, waited = reached, 0
        elif config.annealing is not None and waited >= config.annealing.patience:
            annealing, waited = annealing * config.annealing.factor, 0
        after = Control(momentum, annealing, plateau, waited)
        return {"previous": progress.position, "control": np.array(after)}
