"""The curvature transformation as a method: T once an iteration, with what is ours between iterations.

A run has up to three parts, each a `Phase`: T along the normals; where limbs sank in as folds, unfolding on the sphere,
with equal radii for its end; and T along the radii, which is what the radii of uneven triangles should be, for the
greatest sphericity, and can turn no face.

Vartziotis, "Curvature transformation", arXiv:1608.03898, section 2. Momentum, annealing and unfolding are ours; the
momentum is that of Nesterov, with the restarts of O'Donoghue and Candès, "Adaptive restart for accelerated gradient
schemes", 2015.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Final, NamedTuple

import numpy as np

from spherify.geometry import measures
from spherify.geometry.config import FlowConfig, Stage
from spherify.geometry.kernels import Engine, Kernel
from spherify.geometry.mesh import Floats
from spherify.geometry.methods.interface import Standstill, Step
from spherify.geometry.metrics import Figures
from spherify.geometry.progress import Layout, Memory, Progress
from spherify.geometry.roundness import Shape
from spherify.geometry.schedule import stage_at
from spherify.geometry.topology import Topology
from spherify.geometry.unfolding import Unfolded, folds

STANDSTILL: Final = "the curvature is the same at every vertex, so the transformation does not move any"
PLATEAU_RISE: Final = 1e-4  # a smaller rise of the best sphericity counts as none

LOOKED_EVERY: Final = (
    10  # iterations between two looks for folds; and without a rise, for equal radii to be the end
)
THIN: Final = 1e-5  # a triangle of less than this share of the mean area is as good as a fold
ROUND_ENOUGH: Final = (
    0.2  # radius variation below which the finish begins where nothing gets rounder any more
)
FALL: Final = 0.9  # to this share of the radius variation: something got better
PATIENCES: Final = 4  # of the annealing, that the finish waits for something to get better
VANISHING: Final = 3e-6  # triangles of less than this share of the mean area are drawn apart
WEIGHT_DAMPING: Final = 1.2  # over the exponent: share of the way the weights go; more, and they swing
SETTLED: Final = 5e-3  # radius variation below which T may take over from the evening out of radii
WAITED: Final = 50  # iterations, after which it does in any case
CAREFUL: Final = 0.25  # of the step, that T along the radii begins with: folds leave small triangles
GREATEST_MOMENTUM: Final = 0.98  # of the evening out of radii


class Phase(IntEnum):
    """What an iteration does."""

    NORMALS = 0  # T along the normals
    FOLDED = 1  # the same for the last time: nothing got rounder, and there are folds
    UNFOLDING = 2  # on the sphere
    RADII = 3  # T along the radii


class Control(NamedTuple):
    """What the next iteration depends on besides positions.

    Attributes:
        momentum: b of the next iteration.
        annealing: what step and relaxation are multiplied by.
        plateau: the sphericity that has to be exceeded for the waiting to begin anew.
        waited: iterations since it was.
        phase: a `Phase`; what follows is of UNFOLDING.
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
    phase: float = Phase.NORMALS
    inward: float = 0.0
    least_area: float = 0.0
    fewest: float = np.inf
    variation: float = np.inf
    largest: float = 0.0

    @classmethod
    def of(cls, progress: Progress) -> Control:
        """Read it from where a run is."""
        return cls(*progress.memory["control"].tolist())


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

    def figures(self, V: Floats, centre: Floats) -> Figures:
        """See `Method.figures`."""
        return self._kernel.figures(V, centre)

    def scaled(self, V: Floats, centre: Floats, factor: float) -> Floats:
        """See `Method.scaled`."""
        return self._kernel.scaled(V, centre, factor)

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

    def settled(self, progress: Progress) -> bool:
        """See `Method.settled`: not while unfolding, nor when T along the radii still raises the sphericity."""
        control = Control.of(progress)
        return control.phase == Phase.NORMALS or (
            control.phase == Phase.RADII and control.waited >= LOOKED_EVERY
        )

    def stalled(self, progress: Progress) -> str | None:
        """See `Method.stalled`: annealed down to the least step, or unfolding to no end."""
        annealing, control = self._config.annealing, Control.of(progress)
        if annealing is None:
            return None
        if control.phase == Phase.UNFOLDING and control.waited >= PATIENCES * annealing.patience:
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
        stage, step = stage_at(self._config.schedule, progress.iteration), self.step(progress)
        self._folds = None
        if control.phase == Phase.UNFOLDING:
            return self._unfolded(progress, control, stage)
        if control.phase == Phase.RADII:
            ahead = _ahead_along_radii(progress, control.momentum)
            moved = self._kernel.transform_radially(ahead, stage, step, progress.memory["centre"])
        else:
            ahead = here
            if control.momentum > 0:
                ahead = here - previous
                ahead *= control.momentum
                ahead += here
            moved = self._kernel.transform(ahead, stage, step, self._config.relaxation * control.annealing)
        return Standstill(STANDSTILL) if moved is None else moved

    def remember(self, progress: Progress, shape: Shape, factor: float) -> Memory:
        """See `Method.remember`: momentum, annealing and the finish on the sphere brought up to date."""
        control, memory = self._control(progress), progress.memory
        weights, centre = memory["log_weights"], shape.centroid
        if control.phase in (Phase.UNFOLDING, Phase.RADII):  # a centre that drifts makes folds
            centre = shape.centroid + factor * (memory["centre"] - shape.centroid)
        if self._folds is None:
            after = self._annealed(control, progress, shape)
        else:
            after = _evened(control, progress, shape, self._folds)
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
            if (
                self._stuck(shape, over=over)
                and control.phase == Phase.NORMALS
                and _folded(self._begun(progress))
            ):
                return Control(0.0, 1.0, 0.0, 0, Phase.FOLDED)
        return Control(momentum, annealing, plateau, waited, control.phase)

    def _stuck(self, shape: Shape, *, over: bool) -> bool:
        """Whether a run that gets no rounder, ``over`` or not, is as round as T along the normals makes it."""
        unfolding = self._unfolding
        if unfolding is None:
            return False
        return over or (shape.sphericity < unfolding.sphericity and shape.radius_variation < ROUND_ENOUGH)

    def _control(self, progress: Progress) -> Control:
        """Return what the next iteration depends on; with the unfolding begun if it begins with that one."""
        control, unfolding = Control.of(progress), self._unfolding
        if control.phase == Phase.FOLDED:
            return self._begun(progress)
        if (
            unfolding is None
            or control.phase != Phase.NORMALS
            or progress.shape.sphericity < unfolding.sphericity
            or progress.iteration % LOOKED_EVERY
        ):
            return control
        begun = self._begun(progress)
        return begun if _folded(begun) else control

    def _begun(self, progress: Progress) -> Control:
        """Return the control with which the unfolding begins."""
        V, centre = progress.position, progress.shape.centroid
        inward, least_area = folds(measures.normalised(V - centre), self._topology.faces)
        return Control(0.0, 1.0, 0.0, 0, Phase.UNFOLDING, inward, least_area)

    def _unfolded(self, progress: Progress, control: Control, stage: Stage) -> Step:
        """Even the radii out, with a momentum of theirs; then rounds of unfolding, or of spreading, if need be."""
        here, centre = _ahead_along_radii(progress, control.momentum), progress.memory["centre"]
        moved = self._kernel.even_out(here, stage, centre)
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


def _ahead_along_radii(progress: Progress, momentum: float) -> Floats:
    """Return (n, 3) where the momentum of the radii leads, r + b Δr for a radius r; directions stay."""
    here, centre = progress.position, progress.memory["centre"]
    if momentum <= 0:
        return here
    spokes = here - centre
    radii, before = measures.norm(spokes), measures.norm(progress.memory["previous"] - centre)
    ahead: Floats = centre + spokes * (1 + momentum * (1 - before / radii))[:, None]
    return ahead


def _folded(begun: Control) -> bool:
    """Whether there is something to unfold: a face looks inward, or has nearly vanished."""
    return begun.inward > 0 or begun.least_area < THIN


def _spreads(control: Control) -> bool:
    """Whether triangles are to be drawn apart: some have all but vanished."""
    return control.phase == Phase.UNFOLDING and not control.inward and control.least_area < VANISHING


def _evened(control: Control, progress: Progress, shape: Shape, folds: Unfolded) -> Control:
    """Return the control after an iteration of unfolding; of the next phase if it is done."""
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
    unfolded = not folds.inward and folds.least_area >= VANISHING
    if unfolded and (shape.radius_variation < SETTLED or waited > WAITED):
        return Control(0.0, CAREFUL, shape.sphericity, 0, Phase.RADII)
    return Control(
        momentum,
        1.0,
        plateau,
        waited,
        control.phase,
        folds.inward,
        folds.least_area,
        fewest,
        variation,
        largest,
    )


def _grown(momentum: float) -> float:
    """Return (k + 1)/(k + 4) for k/(k + 3)."""
    return (1 + 2 * momentum) / (4 - momentum)
