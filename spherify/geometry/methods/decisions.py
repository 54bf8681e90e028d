"""What the next iteration of a run of the curvature transformation begins with, from what has been reached.

The phases are `spherify.geometry.methods.control`; here is what has to look at the surface to go from one to another.
"""

from __future__ import annotations

from functools import cached_property
from typing import Final

import numpy as np

from spherify.geometry.config import LATE, FlowConfig, Unfolding
from spherify.geometry.covering import on_a_sphere
from spherify.geometry.kernels import Kernel
from spherify.geometry.mesh import Floats, Ints
from spherify.geometry.methods.control import (
    GIVEN_UP,
    GONE_ON,
    LOOKED_EVERY,
    WAITED,
    Control,
    Next,
    Phase,
    round_enough,
)
from spherify.geometry.progress import Progress
from spherify.geometry.reinsertion import reinserted
from spherify.geometry.topology import Topology

TURNED: Final = 0.1  # share of the sphere that inward faces may cover; more are no folds but a cavity
FALLEN: Final = 0.01  # of the sphericity; by less it goes to and fro while it rises
LONG_FOLDED: Final = 100  # iterations on the sphere, after as many of which folds are no longer waited for
MOST_SQUARES: Final = 300_000_000  # six seconds; a hub of 17,000 neighbours
LEAST_ROUNDS: Final = 2  # of unfolding after an iteration, however often it began anew
NEARER: Final = (1.0, 0.5, 0.25, 0.1, 0.03, 0.01)  # shares of the way to the centroid that are tried


class Decisions:
    """About one surface."""

    def __init__(self, kernel: Kernel, config: FlowConfig, unfolding: Unfolding, F: Ints, n: int) -> None:
        self._kernel, self._config, self.unfolding, self._faces = kernel, config, unfolding, F
        self._n = n
        self._squares = int((np.bincount(F.reshape(-1)) ** 2).sum())  # of how many neighbours vertices have

    def after(self, progress: Progress, control: Control) -> Next:
        """Return what the next iteration begins with."""
        looked = progress.iteration % LOOKED_EVERY == 0
        here, centre, reached = progress.position, progress.memory["centre"], progress.shape.sphericity
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
            and reached >= round_enough(progress.iteration, self.unfolding.sphericity)
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

    def anew(self, progress: Progress, control: Control) -> Next:
        """Begin the part on the sphere anew from the refuge, or give it up if that was done often enough."""
        if not self._once_more(control):
            return self._given_up(progress, control)
        return self._onto_the_sphere(progress, control.more_carefully(), refuge(progress, control))

    def at_an_end(self, control: Control) -> bool:
        """Whether folds can be neither tried to undo once more nor set anew."""
        return control.inward > 0 and not self.may_set_anew(control) and not self._once_more(control)

    def may_set_anew(self, control: Control) -> bool:
        """Whether directions may be set anew: once, for they would be the same again, and unless that is too much.

        It takes as long as there are vertices, and around a hub as the square of its neighbours.
        """
        little = self._n <= self._kernel.thinning.most and self._squares <= MOST_SQUARES
        return little and not control.anew and self._is_ball

    @cached_property
    def _is_ball(self) -> bool:
        """Whether the triangulation is that of a sphere: Euler's number is 2 of two that touch in two vertices, too."""
        topology = Topology.of(self._n, self._faces)
        return not len(topology.nonmanifold_vertices) and not len(topology.unreferenced_vertices)

    def set_anew(self, V: Floats, centre: Floats, control: Control) -> Next | None:
        """Go on from V (n, 3) with directions set anew; None if they may not or cannot be."""
        if not self.may_set_anew(control):
            return None
        here = reinserted(V, self._faces, centre, self._kernel.thinning)
        if here is None:
            return None
        return Next(control.set_anew(self._kernel.shape(here), self._n), here, centre)

    def _while_outward(self, progress: Progress, control: Control, *, looked: bool) -> Next:
        """Return what the next iteration begins with once no face looks inward from the centre."""
        here, centre = progress.position, progress.memory["centre"]
        if control.phase == Phase.FINISH or (control.phase == Phase.STAR and looked):
            centre = nearer(self._kernel, here, centre, progress.shape.centroid)
        if control.spreads and looked and self.may_set_anew(control):
            return self._set_anew_if_it_can_be(progress, control)
        if control.phase == Phase.SPHERE and control.no_better(self._config):  # some triangles make no room
            control = control.as_star(progress.shape)
        elif control.short(progress.shape, self._n) and control.annealed_down(self._config):
            control = control.as_finish(progress.shape)
        elif control.goes_on(progress.shape):
            control = control.as_star(progress.shape)._replace(anew=GONE_ON)
        return Next(control, here, centre)

    def _while_folded(self, progress: Progress, control: Control, *, looked: bool) -> Next:
        """Return what the next iteration on the sphere begins with while faces look inward."""
        here, centre = progress.position, progress.memory["centre"]
        # What moves far may pass the centre.
        lost = looked and self._kernel.covering(here, centre).degree != 1
        if lost or control.no_better(self._config):
            return self.anew(progress, control)
        if control.lasted >= LONG_FOLDED and self.may_set_anew(control):
            return self._set_anew_if_it_can_be(progress, control)
        return Next(control, here, centre)

    def _set_anew_if_it_can_be(self, progress: Progress, control: Control) -> Next:
        """Go on with directions set anew; or as before, and not try it again."""
        here, centre = progress.position, progress.memory["centre"]
        return self.set_anew(here, centre, control) or Next(control._replace(anew=GONE_ON), here, centre)

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

    def _once_more(self, control: Control) -> bool:
        """Whether folds may be tried to undo once more, with half as many rounds."""
        return control.inward > 0 and self.unfolding.rounds * control.rounds / 2 >= LEAST_ROUNDS

    def _given_up(self, progress: Progress, control: Control) -> Next:
        """Set directions anew; or go back to the refuge, and on along the normals: nothing else leads further."""
        centre = progress.memory["centre"]
        anew = self.set_anew(progress.position, centre, control)
        if anew is not None:
            return anew
        annealing = self._config.annealing
        least = control.annealing if annealing is None else annealing.min_step / self._config.step
        again = Control(
            0.0, min(control.annealing, least), GIVEN_UP, 0, times=max(control.times, 1.0), anew=control.anew
        )
        return Next(again, refuge(progress, control), centre)

    def _smoothed(self, progress: Progress, control: Control, *, over: bool) -> Control:
        """Return the control if something may have folded while T went on along the normals, ``over`` or not."""
        begun = self._begun(progress.position, progress.shape.centroid, control)
        if begun.folded:
            return begun
        return control.as_star(progress.shape) if over else control

    def _begun(self, V: Floats, centre: Floats, control: Control) -> Control:
        """Return the control with which a part on the sphere begins, from V (n, 3) and about the centre."""
        return control.on_the_sphere(*self._kernel.folds(V, centre))


def refuge(progress: Progress, control: Control) -> Floats:
    """(n, 3) what to go back to: on the sphere what it began with, and of what gets no rounder the roundest."""
    return {
        Phase.SPHERE: progress.memory["previous"],
        Phase.FOLDED: progress.best_position,
    }.get(Phase(int(control.phase)), progress.position)


def nearer(kernel: Kernel, V: Floats, centre: Floats, centroid: Floats) -> Floats:
    """Return the centroid (3,), a point on the way there or the centre, the first without faces of V (n, 3) inward."""
    points = (centre + share * (centroid - centre) for share in NEARER)
    return next((point for point in points if not kernel.figures(V, point).inward_faces), centre)
