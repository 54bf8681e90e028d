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

LOOKED_EVERY: Final = 10  # iterations between two looks for folds
THIN: Final = 1e-5  # a triangle of less than this share of the mean area is as good as a fold
ROUND_ENOUGH: Final = (
    0.2  # radius variation below which the finish begins where nothing gets rounder any more
)
FALL: Final = 0.9  # to this share of the radius variation: something got better
PATIENCES: Final = 4  # of the annealing, that the finish waits for something to get better
VANISHING: Final = 3e-6  # triangles of less than this share of the mean area are drawn apart
WEIGHT_DAMPING: Final = 1.2  # over the exponent: share of the way the weights go; more, and they swing
ASKED: Final = -1.0
GREATEST_MOMENTUM: Final = 0.98  # of the radii


class Control(NamedTuple):
    """What the next iteration depends on besides positions.

    Attributes:
        momentum: b of the next iteration.
        annealing: what step and relaxation are multiplied by.
        plateau: the sphericity that has to be exceeded for the waiting to begin anew.
        waited: iterations since it was.
        on_sphere: 1 once the run is finished on the sphere, ASKED if that is to begin, else 0; what follows is of that.
        inward: faces that look inward.
        least_area: of a triangle of directions, over their mean.
        fewest: the least number of faces that looked inward so far.
        variation: the radius variation that has to be fallen short of for the waiting to begin anew.
        largest: the least area that has to be exceeded for it, once no face looks inward.

    """

    momentum: float
    annealing: float
    plateau: float
    waited: float
    on_sphere: float = 0.0
    inward: float = 0.0
    least_area: float = 0.0
    fewest: float = np.inf
    variation: float = np.inf
    largest: float = 0.0

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
        self._exponent = 0.0 if self._unfolding is None else self._unfolding.exponent
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
            "centre": ((3,), np.float64),
            "log_weights": ((0 if self._unfolding is None else n,), np.float64),
        }

    def shape(self, V: Floats) -> Shape:
        """See `Method.shape`."""
        return self._kernel.shape(V)

    def begin(self, V: Floats, shape: Shape) -> Memory:
        """See `Method.begin`."""
        self._initial_mean_edge = shape.mean_edge
        control = np.array(Control(0.0, 1.0, shape.sphericity, 0))
        weights = np.zeros(self.layout["log_weights"][0])
        return {"previous": V, "control": control, "centre": shape.centroid, "log_weights": weights}

    def step(self, progress: Progress) -> float:
        """Return C of the next iteration, in the frame."""
        unit = {
            "absolute": self._unit,
            "initial-mean-edge": self._initial_mean_edge,
            "mean-edge": progress.shape.mean_edge,
        }[self._config.step_unit]
        return self._config.step * Control.of(progress).annealing * unit

    def stalled(self, progress: Progress) -> str | None:
        """See `Method.stalled`: annealed down to the least step, or unfolding to no end."""
        annealing, control = self._config.annealing, Control.of(progress)
        if annealing is None:
            return None
        if control.on_sphere and control.waited >= PATIENCES * annealing.patience:
            return (
                f"neither the radius variation, now {progress.shape.radius_variation:.2e}, nor the number of faces "
                f"that look inward, at best {control.fewest:.0f}, fell in {control.waited:.0f} iterations on the sphere"
            )
        if self._config.step * control.annealing >= annealing.min_step:
            return None
        return (
            f"the best sphericity {progress.best_shape.sphericity:.6f} did not rise by {PLATEAU_RISE:g} while the "
            f"step was reduced to {annealing.min_step:g} {self._config.step_unit}"
        )

    def advance(self, progress: Progress) -> Step:
        """See `Method.advance`."""
        control, here, previous = self._control(progress), progress.position, progress.memory["previous"]
        stage, self._folds = stage_at(self._config.schedule, progress.iteration), None
        if control.on_sphere:
            return self._advanced_on_sphere(progress, control, stage)
        ahead = here + control.momentum * (here - previous) if control.momentum > 0 else here
        relaxation = self._config.relaxation * control.annealing
        moved = self._kernel.transform(ahead, stage, self.step(progress), relaxation)
        return Standstill(STANDSTILL) if moved is None else moved

    def remember(self, progress: Progress, shape: Shape, factor: float) -> Memory:
        """See `Method.remember`: momentum, annealing and the finish on the sphere brought up to date."""
        control, memory = self._control(progress), progress.memory
        weights, centre = memory["log_weights"], shape.centroid
        if self._folds is None:
            after = self._annealed(control, progress, shape)
        else:
            after = _finished(control, progress, shape, self._folds)
            centre = shape.centroid + factor * (memory["centre"] - shape.centroid)
            if control.inward:
                weights = self._folds.log_weights
        return {
            "previous": progress.position,
            "control": np.array(after),
            "centre": centre,
            "log_weights": weights,
        }

    def _annealed(self, control: Control, progress: Progress, shape: Shape) -> Control:
        """Return the control after an iteration without unfolding."""
        config, reached = self._config, shape.sphericity
        momentum = min(_grown(control.momentum), config.momentum)
        annealing, plateau, waited = control.annealing, control.plateau, control.waited + 1
        if reached < progress.shape.sphericity:
            momentum = 0.0
        if reached > plateau + PLATEAU_RISE:
            plateau, waited = reached, 0
        elif config.annealing is not None and waited >= config.annealing.patience:
            annealing, waited = annealing * config.annealing.factor, 0
            over = config.step * annealing < config.annealing.min_step
            stuck = self._unfolding is not None and reached < self._unfolding.sphericity
            if self._unfolding is not None and (over or (stuck and shape.radius_variation < ROUND_ENOUGH)):
                return Control(0.0, 1.0, 0.0, 0, ASKED)
        return Control(momentum, annealing, plateau, waited)

    def _control(self, progress: Progress) -> Control:
        """Return what the next iteration depends on; with the finish begun if it begins with that one."""
        control, unfolding = Control.of(progress), self._unfolding
        if control.on_sphere == ASKED:
            return self._begun(progress.position, progress.shape)
        if (
            unfolding is None
            or control.on_sphere
            or progress.shape.sphericity < unfolding.sphericity
            or progress.iteration % LOOKED_EVERY
        ):
            return control
        begun = self._begun(progress.position, progress.shape)
        return begun if begun.inward or begun.least_area < THIN else control

    def _begun(self, V: Floats, shape: Shape) -> Control:
        """Return the control with which the finish begins."""
        inward, least_area = folds(measures.normalised(V - shape.centroid), self._topology.faces)
        return Control(0.0, 1.0, 0.0, 0, 1.0, inward, least_area)

    def _advanced_on_sphere(self, progress: Progress, control: Control, stage: Stage) -> Step:
        """T along the radii, with the momentum of the radii; then rounds of unfolding, or of spreading, if need be."""
        here, centre = progress.position, progress.memory["centre"]
        if control.momentum > 0:
            spokes = here - centre
            radii, before = measures.norm(spokes), measures.norm(progress.memory["previous"] - centre)
            here = centre + spokes * (1 + control.momentum * (1 - before / radii))[:, None]
        moved = self._kernel.transform_radially(here, stage, centre)
        if moved is None:  # the radii are equal
            moved = here.copy()
        log_weights = progress.memory["log_weights"]
        if control.inward:
            damping = WEIGHT_DAMPING / self._exponent if log_weights.any() else 1.0
            self._folds = self._kernel.unfold(
                moved, centre, log_weights, exponent=self._exponent, damping=damping, rounds=self._rounds
            )
        elif _spreads(control):
            self._folds = self._kernel.spread(moved, centre, self._rounds)
        else:
            self._folds = Unfolded(moved, log_weights, int(control.inward), control.least_area)
        return self._folds.positions


def _spreads(control: Control) -> bool:
    """Whether triangles are to be drawn apart: some have all but vanished."""
    return bool(control.on_sphere) and not control.inward and control.least_area < VANISHING


def _finished(control: Control, progress: Progress, shape: Shape, folds: Unfolded) -> Control:
    """Return the control after an iteration on the sphere."""
    momentum, waited = min(_grown(control.momentum), GREATEST_MOMENTUM), control.waited + 1
    variation, fewest, largest = control.variation, control.fewest, control.largest
    moving = control.inward > 0 or _spreads(control)  # directions, and what of the radii is seen with them
    if shape.radius_variation > progress.shape.radius_variation and not moving:
        momentum = 0.0
    if shape.radius_variation < FALL * variation:
        variation, waited = shape.radius_variation, 0
    plateau = control.plateau
    if shape.sphericity > plateau + PLATEAU_RISE:
        plateau, waited = shape.sphericity, 0
    if folds.inward < fewest:
        fewest, variation, waited = folds.inward, shape.radius_variation, 0
    if folds.inward == 0 and folds.least_area > largest / FALL:
        largest, variation, waited = folds.least_area, shape.radius_variation, 0
    return Control(
        momentum, 1.0, plateau, waited, 1.0, folds.inward, folds.least_area, fewest, variation, largest
    )


def _grown(momentum: float) -> float:
    """Return (k + 1)/(k + 4) for k/(k + 3)."""
    return (1 + 2 * momentum) / (4 - momentum)
