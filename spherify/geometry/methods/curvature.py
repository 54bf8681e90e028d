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
from collections.abc import Iterable
from functools import cached_property
from typing import Final

import numpy as np

from spherify.geometry.ascent import MOMENTUM
from spherify.geometry.config import LATE, FlowConfig, Stage, Unfolding
from spherify.geometry.covering import on_a_sphere
from spherify.geometry.finish import finished, steps_of
from spherify.geometry.kernels import Engine, Kernel
from spherify.geometry.mesh import Floats
from spherify.geometry.methods.anew import nearer, set_anew
from spherify.geometry.methods.control import (
    FINISHED,
    GIVEN_UP,
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
    round_enough,
)
from spherify.geometry.methods.interface import Breakdown, Standstill, Step
from spherify.geometry.metrics import Figures
from spherify.geometry.progress import Layout, Memory, Progress
from spherify.geometry.reinsertion import MOST
from spherify.geometry.roundness import ALL, Shape, Wanted
from spherify.geometry.schedule import stage_at
from spherify.geometry.topology import Topology
from spherify.geometry.unfolding import Unfolded

ROUND: Final = 0.999  # sphericity from which on equal radii soon end a run; a lower one may still rise
TURNED: Final = 0.1  # share of the sphere that inward faces may cover; more are no folds but a cavity
FALLEN: Final = 0.01  # of the sphericity; by less it goes to and fro while it rises
LONG_FOLDED: Final = 2000  # iterations, after as many of which folds are no longer waited for
OFTEN: Final = 4  # times that the part on the sphere has begun, after which directions are no more set anew
LEAST_ROUNDS: Final = 2  # of unfolding after an iteration, however often it began anew
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
    def _prepared(self) -> tuple[Kernel, Unfolding | None]:
        """What computes, and how what folds is unfolded, None if at all; when first needed: of a sphere neither is."""
        ball = self._weighed and self._topology.n_components == 1
        kernel = self._engine.prepare(self._topology, self._config)
        del self._topology  # which takes as much memory as what was made of it
        return kernel, self._config.unfolding if ball else None

    @property
    def _kernel(self) -> Kernel:
        return self._prepared[0]

    @property
    def _unfolding(self) -> Unfolding | None:
        return self._prepared[1]

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
        lasting = control.inward > 0 and not self._anew_yet(control)
        if lasting and control.no_better(self._config) and not self._once_more(control):
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
        if control.phase == Phase.SPHERE:
            found = self._on_the_sphere(here, centre, control, stage, progress.memory["log_weights"])
            if control.inward and not self._kernel.shape(found.positions).volume > 0:
                self._decided = progress, self._anew(progress, control)
                return self.advance(progress)
            if control.spreads and (found.inward or not found.least_area > 0):
                anew = self._reinserted([here], centre, control)  # rounding cannot tell triangles apart
                if anew is not None:
                    self._decided = progress, anew
                    return self.advance(progress)
            self._folds = found
            return found.positions
        if control.phase == Phase.FINISH:
            return finished(here, self._faces, centre, by=self._kernel.energies)
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
        if self._unfolding is None or control.given_up or control.phase == Phase.FINISH:
            return None
        if control.phase == Phase.STAR:
            found: Next | None = Next(control.as_finish(progress.shape), here, centre)
        else:
            found = self._reinserted([progress.best_position], progress.best_shape.centroid, control)
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
        if control.phase in {Phase.SPHERE, Phase.STAR, Phase.FINISH}:  # a centre that drifts makes folds
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
            "previous": here if control.phase in {Phase.STAR, Phase.FINISH} else self._refuge(progress),
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
        control, looked = self._control(progress), progress.iteration % LOOKED_EVERY == 0
        here, centre, reached = progress.position, progress.memory["centre"], progress.shape.sphericity
        if self._unfolding is None:
            return Next(control, here, centre)
        if control.phase == Phase.SMOOTHING:
            annealing = self._config.annealing
            over = control.waited >= (WAITED if annealing is None else annealing.patience)
            if looked or over:
                control, centre = self._smoothed(progress, control, over=over), progress.shape.centroid
        elif control.phase == Phase.FOLDED:
            # Of what gets no rounder the last state may be worse, and all directions be turned.
            return self._onto_the_sphere(progress, control, progress.best_position)
        elif (
            control.phase == Phase.NORMALS
            and looked
            and not control.given_up
            and reached >= round_enough(progress.iteration, self._unfolding.sphericity)
        ):
            seen = self._kernel.covering(here, centre)
            if seen.turned < TURNED and seen.degree == 1:
                control = self._begun(here, centre, control)
            elif progress.iteration >= LATE and reached >= progress.best_shape.sphericity - FALLEN:
                # T may unwind it, but takes long. What was rounder before waits for FOLDED, which goes back to that.
                return self._about_another_point(here, centre, control) or Next(control, here, centre)
        elif control.phase == Phase.SPHERE and control.inward:
            return self._while_folded(progress, control, looked=looked)
        else:
            return self._while_outward(progress, control, looked=looked)
        return Next(control, here, centre)

    def _while_outward(self, progress: Progress, control: Control, *, looked: bool) -> Next:
        """Return what the next iteration begins with once no face looks inward from the centre."""
        here, centre = progress.position, progress.memory["centre"]
        if control.phase == Phase.FINISH or (control.phase == Phase.STAR and looked):
            centre = nearer(self._kernel, here, centre, progress.shape.centroid)
        if control.phase == Phase.SPHERE and control.no_better(self._config):  # some triangles make no room
            control = control.as_star(progress.shape)
        elif control.short(progress.shape, self._n) and control.annealed_down(self._config):
            control = control.as_finish(progress.shape)
        return Next(control, here, centre)

    def _while_folded(self, progress: Progress, control: Control, *, looked: bool) -> Next:
        """Return what the next iteration on the sphere begins with while faces look inward."""
        here, centre = progress.position, progress.memory["centre"]
        # What moves far may pass the centre.
        lost = looked and self._kernel.covering(here, centre).degree != 1
        if lost or control.no_better(self._config):
            return self._anew(progress, control)
        if progress.iteration % LONG_FOLDED == 0:
            return self._reinserted([here], centre, control) or Next(control, here, centre)
        return Next(control, here, centre)

    def _onto_the_sphere(self, progress: Progress, control: Control, here: Floats) -> Next:
        """Go on to the sphere from ``here`` (n, 3), about a point that it goes around once."""
        centre = self._kernel.shape(here).centroid
        if self._kernel.covering(here, centre).degree == 1:
            return Next(self._begun(here, centre, control), here, centre)
        return self._about_another_point(here, centre, control) or self._given_up(progress, control)

    def _about_another_point(self, V: Floats, centre: Floats, control: Control) -> Next | None:
        """Go on to the sphere from V (n, 3) about a point near the centre that it goes around once, if one is found."""
        inside = self._kernel.centre_inside(V, centre)
        if inside is None:
            return None
        here = on_a_sphere(V, inside)  # uneven radii about it may enclose less than nothing
        return Next(self._begun(here, inside, control), here, inside)

    def _anew(self, progress: Progress, control: Control) -> Next:
        """Begin the part on the sphere anew from the refuge, or give it up if that was done often enough."""
        if not self._once_more(control):
            return self._given_up(progress, control)
        return self._onto_the_sphere(progress, control.more_carefully(), self._refuge(progress))

    def _once_more(self, control: Control) -> bool:
        """Whether folds may be tried to undo once more, with half as many rounds."""
        return control.inward > 0 and self._rounds * control.rounds / 2 >= LEAST_ROUNDS

    def _anew_yet(self, control: Control) -> bool:
        """Whether directions may be set anew: that is not too much, and was not done often already."""
        return control.times <= OFTEN and self._n <= MOST

    def _reinserted(self, starts: Iterable[Floats], centre: Floats, control: Control) -> Next | None:
        """Go on from one of these, (n, 3) each, with directions set anew, if they can be."""
        here = set_anew(self._kernel, self._faces, starts, centre) if self._anew_yet(control) else None
        return None if here is None else Next(self._begun(here, centre, control), here, centre)

    def _given_up(self, progress: Progress, control: Control) -> Next:
        """Set directions anew; or go back to the refuge, and on along the normals: nothing else leads further."""
        centre = progress.memory["centre"]
        starts = (progress.position, self._refuge(progress), progress.best_position)
        anew = self._reinserted(starts, centre, control)
        if anew is not None:
            return anew
        annealing = self._config.annealing
        least = control.annealing if annealing is None else annealing.min_step / self._config.step
        again = Control(0.0, min(control.annealing, least), GIVEN_UP, 0, times=max(control.times, 1.0))
        return Next(again, self._refuge(progress), centre)

    def _refuge(self, progress: Progress) -> Floats:
        """(n, 3) what to go back to: on the sphere what it began with, and of what gets no rounder the roundest."""
        return {
            Phase.SPHERE: progress.memory["previous"],
            Phase.FOLDED: progress.best_position,
        }.get(Phase(int(self._control(progress).phase)), progress.position)

    def _smoothed(self, progress: Progress, control: Control, *, over: bool) -> Control:
        """Return the control if something may have folded while T went on along the normals, ``over`` or not."""
        begun = self._begun(progress.position, progress.shape.centroid, control)
        if begun.folded:
            return begun
        return control.as_star(progress.shape) if over else control

    def _begun(self, V: Floats, centre: Floats, control: Control) -> Control:
        """Return the control with which a part on the sphere begins, from V (n, 3) and about the centre."""
        return control.on_the_sphere(*self._kernel.folds(V, centre))

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
