"""The curvature transformation as a method: T once an iteration, with what is ours between iterations.

Vartziotis, "Curvature transformation", arXiv:1608.03898, section 2. Momentum, annealing and unfolding are ours; the
momentum is that of Nesterov, with the restarts of O'Donoghue and Candès, "Adaptive restart for accelerated gradient
schemes", 2015.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from spherify.geometry import measures
from spherify.geometry.config import FlowConfig, Stage
from spherify.geometry.kernels import Engine, Kernel
from spherify.geometry.mesh import Floats
from spherify.geometry.methods.interface import Standstill, Step
from spherify.geometry.progress import Layout, Memory, Progress
from spherify.geometry.roundness import Shape
from spherify.geometry.schedule import stage_at
from spherify.geometry.topology import Topology
from spherify.geometry.unfolding import Unfolded, folds

STANDSTILL: Final = "the curvature is the same at every vertex, so the transformation does not move any"
PLATEAU_RISE: Final = 1e-4  # a smaller rise of the best sphericity counts as none

LOOKED_EVERY: Final = 10  # iterations between two looks whether to unfold
THIN: Final = 1e-5  # a triangle of less than this share of the mean area is a reason to unfold
VANISHING: Final = 3e-6  # and below this share the exponent grows
EXPONENT_GROWTH: Final = 0.02  # an iteration
GREATEST_EXPONENT: Final = 8.0
GREATEST_DAMPING: Final = 0.3  # of the weights; with 1.2 / exponent, what keeps them from swinging


class Control(NamedTuple):
    """What the next iteration depends on besides positions.

    Attributes:
        momentum: b of the next iteration.
        annealing: what step and relaxation are multiplied by.
        plateau: the sphericity that has to be exceeded for the waiting to begin anew.
        waited: iterations since it was.
        exponent: of the unfolding; 0 before it begins.
        inward: faces that look inward, once it has begun.
        fewest: the least number of them so far.

    """

    momentum: float
    annealing: float
    plateau: float
    waited: float
    exponent: float = 0.0
    inward: float = 0.0
    fewest: float = np.inf

    @classmethod
    def of(cls, progress: Progress) -> Control:
        """Read it from where a run is."""
        return cls(*map(float, progress.memory["control"]))


class CurvatureTransformation:
    """T on one mesh, see `spherify.geometry.methods.interface.Method`."""

    def __init__(self, topology: Topology, config: FlowConfig, engine: Engine, *, unit: float) -> None:
        """Prepare it; ``unit`` is the length of the mesh's own unit in the frame."""
        self._topology = topology
        self._config = config
        self._unfolding = config.unfolding if topology.closed else None
        self._rounds = 0 if self._unfolding is None else self._unfolding.rounds
        self._folds: Unfolded | None = None  # of the last iteration, for `remember`
        self._kernel: Kernel = engine.prepare(topology, config)
        self._unit = unit
        self._initial_mean_edge = 0.0
        self.computed_by = engine.name

    @property
    def layout(self) -> Layout:
        """See `Method.layout`."""
        n = self._topology.n_vertices
        return {
            "previous": ((n, 3), np.float64),
            "control": ((len(Control._fields),), np.float64),
            "log_weights": ((0 if self._unfolding is None else n,), np.float64),
        }

    def shape(self, V: Floats) -> Shape:
        """See `Method.shape`."""
        return self._kernel.shape(V)

    def begin(self, V: Floats, shape: Shape) -> Memory:
        """See `Method.begin`."""
        self._initial_mean_edge = shape.mean_edge
        control = np.array(Control(0.0, 1.0, shape.sphericity, 0))
        return {"previous": V, "control": control, "log_weights": np.zeros(self.layout["log_weights"][0])}

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
        control, here, previous = self._control(progress), progress.position, progress.memory["previous"]
        stage, step, self._folds = (
            stage_at(self._config.schedule, progress.iteration),
            self.step(progress),
            None,
        )
        if control.exponent > 0:
            return self._advanced_radially(progress, control, stage, step)
        ahead = here + control.momentum * (here - previous) if control.momentum > 0 else here
        moved = self._kernel.transform(ahead, stage, step, self._config.relaxation * control.annealing)
        return Standstill(STANDSTILL) if moved is None else moved

    def remember(self, progress: Progress, shape: Shape) -> Memory:
        """See `Method.remember`: momentum, annealing and unfolding brought up to date."""
        config, control, reached = self._config, self._control(progress), shape.sphericity
        momentum = min(_grown(control.momentum), config.momentum)
        exponent, inward, fewest, log_weights = *control[4:], progress.memory["log_weights"]
        annealing, plateau, waited = control.annealing, control.plateau, control.waited + 1
        if self._folds is not None:
            log_weights, inward = self._folds.log_weights, self._folds.inward
            if inward < fewest:
                fewest, waited = inward, 0
            if inward == 0 and self._folds.least_area < VANISHING and exponent < GREATEST_EXPONENT:
                exponent, waited = exponent + EXPONENT_GROWTH, 0
        if reached < progress.shape.sphericity or inward > 0:
            momentum = 0.0
        if reached > plateau + PLATEAU_RISE:
            plateau, waited = reached, 0
        elif config.annealing is not None and waited >= config.annealing.patience:
            annealing, waited = annealing * config.annealing.factor, 0
        after = Control(momentum, annealing, plateau, waited, exponent, inward, fewest)
        return {"previous": progress.position, "control": np.array(after), "log_weights": log_weights}

    def _control(self, progress: Progress) -> Control:
        """Return what the next iteration depends on; with the unfolding begun if it begins with that one."""
        control, unfolding = Control.of(progress), self._unfolding
        if (
            unfolding is None
            or control.exponent > 0
            or progress.shape.sphericity < unfolding.sphericity
            or progress.iteration % LOOKED_EVERY
        ):
            return control
        spokes = progress.position - progress.shape.centroid
        inward, least_area = folds(measures.normalised(spokes), self._topology.faces)
        if not inward and least_area >= THIN:
            return control
        return Control(0.0, 1.0, 0.0, 0, unfolding.exponent, inward, inward)

    def _advanced_radially(self, progress: Progress, control: Control, stage: Stage, step: float) -> Step:
        """T along the radii, with the momentum of the radii; then rounds of unfolding."""
        here, centre = progress.position, progress.shape.centroid
        if control.momentum > 0:
            spokes = here - centre
            radii, before = measures.norm(spokes), measures.norm(progress.memory["previous"] - centre)
            here = centre + spokes * (1 + control.momentum * (1 - before / radii))[:, None]
        moved = self._kernel.transform_radially(here, stage, step, centre)
        if moved is None:
            return Standstill(STANDSTILL)
        log_weights = progress.memory["log_weights"]
        damping = min(GREATEST_DAMPING, 1.2 / control.exponent) if log_weights.any() else 1.0
        self._folds = self._kernel.unfold(
            moved, centre, log_weights, exponent=control.exponent, damping=damping, rounds=self._rounds
        )
        return self._folds.positions


def _grown(momentum: float) -> float:
    """Return (k + 1)/(k + 4) for k/(k + 3)."""
    return (1 + 2 * momentum) / (4 - momentum)
