"""The curvature transformation as a method: T once an iteration, with what is ours between iterations.

T moves along the normals until the surface is nearly round; then the radii are evened out and folds undone, on the
sphere; then T goes on along the normals, while nothing folds and it gets rounder; and in the end along the radii, while
directions climb to the greatest sphericity, neither of which turns a face. What is not round enough after that is
finished by both together, and directions that do not unfold are set anew (`spherify.geometry.reinsertion`). The phases
and the rules between them are `spherify.geometry.methods.control`.

Vartziotis, "Curvature transformation", arXiv:1608.03898, section 2. Momentum, annealing and unfolding are ours; the
momentum is that of Nesterov, with the restarts of O'Donoghue and Candès, "Adaptive restart for accelerated gradient
schemes", 2015.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Final

import numpy as np

from spherify.geometry.ascent import MOMENTUM
from spherify.geometry.config import FlowConfig, Stage, Unfolding
from spherify.geometry.finish import Finish, steps_of
from spherify.geometry.kernels import Engine, Kernel
from spherify.geometry.mesh import Floats
from spherify.geometry.methods.control import (
    FINISHED,
    LOOKED_EVERY,
    OF_UNIT,
    PLATEAU_RISE,
    STANDSTILL,
    STILL_WOUND,
    WAITED,
    Control,
    Next,
    Phase,
    no_rounder,
)
from spherify.geometry.methods.decisions import Decisions, refuge
from spherify.geometry.methods.interface import Breakdown, Standstill, Step
from spherify.geometry.metrics import Figures
from spherify.geometry.progress import Layout, Memory, Progress
from spherify.geometry.roundness import ALL, Shape, Wanted
from spherify.geometry.schedule import stage_at
from spherify.geometry.topology import Topology
from spherify.geometry.unfolding import Unfolded

ROUND: Final = 0.999  # sphericity from which on equal radii soon end a run; a lower one may still rise
WEIGHT_DAMPING: Final = 1.2  # over the exponent: share of the way the weights go; more, and they swing


class CurvatureTransformation:
    """T on one mesh, see `spherify.geometry.methods.interface.Method`."""

    def __init__(
        self, topology: Topology, config: FlowConfig, engine: Engine, *, unit: float, later: bool
    ) -> None:
        """Prepare it, or ``later``; ``unit`` is the length of the mesh's own unit in the frame."""
        self._n = topology.n_vertices
        self._config = config
        self._closed = topology.closed
        self._weighed = config.unfolding is not None and topology.closed and topology.euler == 2
        self._rounds = 0 if config.unfolding is None else config.unfolding.rounds
        self._exponent = 0.0 if config.unfolding is None else config.unfolding.exponent
        self._folds: Unfolded | None = None  # of the last iteration, for `remember`
        self._read: tuple[Memory, Control] | None = None  # of the last state that was asked about
        self._decided: tuple[Progress, Next] | None = None  # what follows a state
        self._engine, self._topology = engine, topology
        self._faces = topology.faces  # those of the mesh
        self._unit = unit
        self._initial_mean_edge = 0.0
        self._wanted = ALL  # at the start, whatever the unit of the step
        self.computed_by = engine.name
        if not later:
            _ = self._prepared

    @cached_property
    def _prepared(self) -> tuple[Kernel, Decisions | None]:
        """What computes, and what decides about folds, if anything does; when first needed: for a sphere neither is."""
        unfolding = self._config.unfolding if self._weighed and self._topology.n_components == 1 else None
        kernel = self._engine.prepare(self._topology, self._config)
        del self._topology  # which takes as much memory as what was made of it
        return kernel, None if unfolding is None else Decisions(
            kernel, self._config, unfolding, self._faces, self._n
        )

    @property
    def _kernel(self) -> Kernel:
        return self._prepared[0]

    @property
    def _decisions(self) -> Decisions | None:
        return self._prepared[1]

    @cached_property
    def _finish(self) -> Finish:
        return Finish(self._n, self._faces, by=self._kernel.energies)

    @property
    def _unfolding(self) -> Unfolding | None:
        return None if self._decisions is None else self._decisions.unfolding

    @property
    def layout(self) -> Layout:
        """See `Method.layout`."""
        n = self._n
        return {
            "previous": ((n, 3), np.float64),
            "control": ((len(Control._fields),), np.float64),
            "centre": ((3,), np.float64),
            "log_weights": ((n if self._weighed else 0,), np.float64),
        }

    def shape(self, V: Floats, *, whole: bool = False) -> Shape:
        """See `Method.shape`."""
        return self._kernel.shape(V, self._wanted._replace(variation=math.inf) if whole else self._wanted)

    def figures(self, V: Floats, centre: Floats) -> Figures:
        """See `Method.figures`."""
        return self._kernel.figures(V, centre)

    def scaled(self, V: Floats, centre: Floats, factor: float) -> Floats:
        """See `Method.scaled`."""
        return self._kernel.scaled(V, centre, factor)

    def begin(self, V: Floats, shape: Shape) -> Memory:
        """See `Method.begin`."""
        self._initial_mean_edge = shape.mean_edge
        # On the sphere everything goes by the radii; else they only end a run.
        least = self._config.stop_radius_variation if self._config.unfolding is None else math.inf
        area = shape.area if self._closed and self._config.rescale == "area" else 0.0
        self._wanted = Wanted(self._config.step_unit == "mean-edge", least, area)
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
        return self._config.step * self._next(progress).control.annealing * unit

    def settled(self, progress: Progress) -> bool:
        """See `Method.settled`: not on the sphere, nor while what follows that still raises the sphericity."""
        control = self._control(progress)
        soon, nothing_else_ends_it = control.plateau >= ROUND, self._config.annealing is None
        if control.phase in {Phase.SMOOTHING, Phase.STAR} and (soon or nothing_else_ends_it):
            return control.waited >= (LOOKED_EVERY if soon else WAITED)
        return control.phase == Phase.NORMALS or self.stalled(progress) is not None

    def stalled(self, progress: Progress) -> str | None:
        """See `Method.stalled`: annealed down to the least step, or unfolding to no end."""
        annealing, control = self._config.annealing, self._control(progress)
        if annealing is None or control.phase == Phase.FOLDED:
            return None
        if control.given_up:
            return STILL_WOUND if control.waited >= LOOKED_EVERY else None
        if (
            control.no_better(self._config)
            and self._decisions is not None
            and self._decisions.at_an_end(control)
        ):
            return (
                f"neither the radius variation, now {progress.shape.radius_variation:.2e}, nor the number of faces "
                f"that look inward, at best {control.fewest:.0f}, fell in {control.waited:.0f} iterations on the sphere"
            )
        if control.phase == Phase.FINISH:
            return no_rounder(self._n) if control.waited >= FINISHED else None
        if not control.annealed_down(self._config) or control.short(progress.shape, self._n):
            return None
        return (
            f"the best sphericity {progress.best_shape.sphericity:.6f} did not rise by {PLATEAU_RISE:g} while the "
            f"step was reduced to {annealing.min_step:g}{OF_UNIT[self._config.step_unit]}"
        )

    def advance(self, progress: Progress) -> Step:
        """See `Method.advance`."""
        control, here, centre = self._next(progress)
        previous = progress.memory["previous"]
        stage, step = stage_at(self._config.schedule, progress.iteration), self.step(progress)
        self._folds = None
        if control.phase == Phase.SPHERE and (decisions := self._decisions) is not None:
            found = self._on_the_sphere(here, centre, control, stage, progress.memory["log_weights"])
            if control.inward and not self._kernel.shape(found.positions).volume > 0:
                self._decided = progress, decisions.anew(progress, control)
                return self.advance(progress)
            if control.spreads and (found.inward or not found.least_area > 0):
                anew = decisions.set_anew(here, centre, control)  # rounding cannot tell triangles apart
                if anew is not None:
                    self._decided = progress, anew
                    return self.advance(progress)
            self._folds = found
            return found.positions
        if control.phase == Phase.FINISH:
            return self._finish.advanced(here, centre)
        if control.phase == Phase.STAR:
            ahead = here
            if control.momentum > 0:
                ahead = self._kernel.ahead_along_radii(here, previous, centre, control.momentum)
            moved = self._kernel.transform_radially(ahead, stage, step, centre)
            along = ahead if moved is None else moved  # None: the same curvature everywhere
            moved = self._kernel.ascend(along, previous, centre, min(control.momentum, MOMENTUM))
        else:
            relaxation = self._config.relaxation * control.annealing
            moved = self._kernel.transform(
                here, stage, step, relaxation, previous=previous, momentum=control.momentum,
                measured=self._wanted,
            )  # fmt: skip
        return Standstill(STANDSTILL) if moved is None else moved

    def rescued(self, progress: Progress) -> Floats | None:
        """See `Method.rescued`: what looks outward is finished, else directions are set anew from the best state on."""
        control, here, centre = self._next(progress)
        if self._decisions is None or control.given_up or control.phase == Phase.FINISH:
            return None
        if control.phase == Phase.STAR:
            found: Next | None = Next(control.as_finish(progress.shape), here, centre)
        else:
            found = self._decisions.set_anew(progress.best_position, progress.best_shape.centroid, control)
        if found is None:
            return None
        self._decided = progress, found
        moved = self.advance(progress)
        return None if isinstance(moved, Standstill | Breakdown) else moved

    def remember(self, progress: Progress, shape: Shape, factor: float) -> Memory:
        """See `Method.remember`: momentum, annealing and the part on the sphere brought up to date.

        On the sphere, which has no momentum, ``previous`` stays what to go back to.
        """
        control, here, before = self._next(progress)
        weights, centre = progress.memory["log_weights"], shape.centroid
        rises = control.phase in {Phase.STAR, Phase.FINISH}
        if rises or control.phase == Phase.SPHERE:  # a centre that drifts makes folds
            centre = shape.centroid + factor * (before - shape.centroid)
        if control.phase == Phase.FINISH:
            after = control.climbed(shape, steps_of(self._n))
        elif self._folds is None:
            after = control.annealed(progress.shape, shape, self._config, self._unfolding)
        else:
            after = control.evened(shape, self._folds)
            if control.inward:
                weights = self._folds.log_weights
        return {
            "previous": here if rises else refuge(progress, self._control(progress)),
            "control": np.array(after),
            "centre": centre,
            "log_weights": weights,
        }

    def _control(self, progress: Progress) -> Control:
        """Return the control of a state, read once."""
        if self._read is None or self._read[0] is not progress.memory:
            self._read = progress.memory, Control.of(progress)
        return self._read[1]

    def _next(self, progress: Progress) -> Next:
        """Return what the next iteration begins with; on the sphere if that begins with it. Decided once a state."""
        if self._decided is None or self._decided[0] is not progress:
            self._decided = progress, self._decision(progress)
        return self._decided[1]

    def _decision(self, progress: Progress) -> Next:
        control = self._control(progress)
        if self._decisions is None:
            return Next(control, progress.position, progress.memory["centre"])
        return self._decisions.after(progress, control)

    def _on_the_sphere(
        self, V: Floats, centre: Floats, control: Control, stage: Stage, log_weights: Floats
    ) -> Unfolded:
        """Even the radii out; then rounds of unfolding, or of spreading, if need be."""
        moved = self._kernel.even_out(V, centre, stage)
        if moved is None:  # the radii are equal
            moved = V.copy()
        if control.inward:
            begins = not log_weights.any() or (control.rounds < 1 and control.fewest == np.inf)
            exponent = self._exponent * math.sqrt(control.rounds)
            return self._kernel.unfold(
                moved,
                centre,
                log_weights,
                exponent=exponent,
                damping=1.0 if begins else min(WEIGHT_DAMPING / exponent, 1.0),
                rounds=max(round(self._rounds * control.rounds), 1),
            )
        if control.spreads:
            return self._kernel.spread(moved, centre, self._rounds)
        return Unfolded(moved, log_weights, int(control.inward), control.least_area)
