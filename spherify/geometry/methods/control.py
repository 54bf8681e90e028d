"""What a run of the curvature transformation does next: its phases, and the rules that lead from one to another.

    NORMALS ──── round enough ───> SPHERE ── all outward, radii equal ──> SMOOTHING
       └── no rounder ─> FOLDED ─────┘  │└─────── folds again ───────────────┘│
                                        └──── thin, or again ────> STAR <─────┘ no rounder
                                                                    └── over, and not round enough ──> FINISH

When a surface stops getting rounder, FOLDED goes back to its roundest state. If the directions seen from the centroid
cover the sphere otherwise than once, which nothing done on the sphere can change, it looks for another point to see
them from; NORMALS does the same late in a run. Where the covering is lost on the way, or folds remain, SPHERE begins
anew from what it began with, more carefully each time. Where that does not do, takes too long, or leaves triangles
that have all but vanished, or where no such point is found, directions are set anew, as they are for the best state
where a step breaks the surface: once a run, in FINISH until that is round and then in STAR; and if they cannot be, it
goes back to NORMALS, to the end. A surface that has become round ends in NORMALS, SMOOTHING or STAR. A run ends in
SPHERE only if nothing improves there, and in FINISH only if its triangles are so few or so uneven that the other
phases left it below Ψ 0.995.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Final, NamedTuple

import numpy as np

from spherify.geometry.config import LATE, FlowConfig, Unfolding
from spherify.geometry.finish import MOST, STEPS, steps_of
from spherify.geometry.mesh import Floats
from spherify.geometry.progress import Progress
from spherify.geometry.roundness import Shape
from spherify.geometry.unfolding import Unfolded

LATE_ENOUGH: Final = 0.8  # sphericity from which on a surface is round enough after LATE iterations
LATER_LESS: Final = (
    4e-3  # so much less of that with each iteration more, to 0: what is wound may rise no further
)
ROUND_THOUGH_STUCK: Final = 0.2  # radius variation below which a run that is stuck goes on upon the sphere
PLATEAU_RISE: Final = 1e-4  # a smaller rise of the best sphericity counts as none
LOOKED_EVERY: Final = 10  # iterations between two looks for folds; and without a rise, for the end
THIN: Final = 1e-5  # a triangle of less than this share of the mean area is as good as a fold
FALL: Final = 0.9  # to this share of the radius variation: something got better
VANISHING: Final = 3e-6  # triangles of less than this share of the mean area are drawn apart
SETTLED: Final = 5e-3  # radius variation below which T takes over from the evening out of radii
WAITED: Final = 50  # iterations, after which it does in any case
GIVEN_UP: Final = np.inf  # no sphericity exceeds it: nothing is waited for any more
PATIENCES: Final = 4  # of the annealing, that something may take on the sphere to get better
SHORT: Final = 0.995  # sphericity below which what gets no rounder by T and the climb is finished
RISE: Final = 7.5e-7  # of the sphericity in STEPS, for another iteration of that
FINISHED: Final = 8  # iterations of FINISH without that: Ψ may fall for a while as the barrier is left
CAREFUL: Final = 0.1  # of the step, that T along the radii begins with; longer ones make it rough again

SET: Final = 1.0
GONE_ON: Final = 2.0

OF_UNIT: Final = {  # after a step
    "absolute": "",
    "initial-mean-edge": " of the mean edge at the start",
    "mean-edge": " of the mean edge",
}
STANDSTILL: Final = "the curvature is the same at every vertex, so the transformation does not move any"
STILL_WOUND: Final = (
    "the surface, wound around itself, could not be unwound: the run went back to before that was tried"
)


class Phase(IntEnum):
    """What an iteration does."""

    NORMALS = 0  # T along the normals
    FOLDED = 1  # the same for the last time: nothing got rounder
    SPHERE = 2  # radii are evened out, and directions unfolded
    SMOOTHING = 3  # T along the normals of what looks outward everywhere
    STAR = 4  # T along the radii, and directions climb to the greatest sphericity; nothing folds any more
    FINISH = 5  # T has ended; radii and directions climb together


class Control(NamedTuple):
    """What the next iteration depends on besides positions.

    Attributes:
        momentum: b of the next iteration.
        annealing: what step and relaxation are multiplied by.
        plateau: the sphericity that has to be exceeded for the waiting to begin anew.
        waited: iterations since it was.
        phase: a `Phase`; what follows is of SPHERE.
        times: how often it was begun; 1 also after FOLDED has led back.
        inward: faces that look inward.
        least_area: of a triangle of directions, over their mean.
        fewest: the least number of faces that looked inward so far.
        variation: the radius variation that has to be fallen short of for the waiting to begin anew.
        largest: the least area that has to be exceeded for it, once no face looks inward.
        rounds: share of the rounds of unfolding that are done; halved each time SPHERE begins anew.
        lasted: iterations of SPHERE until now, those before it began anew included.
        anew: SET once directions were set anew; GONE_ON once T goes on from that, or if they could not be.

    """

    momentum: float
    annealing: float
    plateau: float
    waited: float
    phase: float = Phase.NORMALS
    times: float = 0.0
    inward: float = 0.0
    least_area: float = 0.0
    fewest: float = np.inf
    variation: float = np.inf
    largest: float = 0.0
    rounds: float = 1.0
    lasted: float = 0.0
    anew: float = 0.0

    @classmethod
    def of(cls, progress: Progress) -> Control:
        """Read it from where a run is."""
        return cls(*progress.memory["control"].tolist())

    def on_the_sphere(self, inward: int, least_area: float) -> Control:
        """Return it as SPHERE begins, with what the directions are like."""
        begun = Control(0.0, 1.0, 0.0, 0, Phase.SPHERE, self.times + 1, inward, least_area)
        return begun._replace(rounds=self.rounds, lasted=self.lasted, anew=self.anew)

    def more_carefully(self) -> Control:
        """Return it as what precedes SPHERE, for that to begin anew."""
        return self._replace(rounds=self.rounds / 2, times=self.times - 1)

    @property
    def folded(self) -> bool:
        """Whether there is something to unfold: a face looks inward, or has nearly vanished."""
        return self.inward > 0 or self.least_area < THIN

    @property
    def given_up(self) -> bool:
        """Whether nothing on the sphere led further, so that T goes on along the normals to the end."""
        return self.plateau == GIVEN_UP

    def annealed(
        self, before: Shape, shape: Shape, config: FlowConfig, unfolding: Unfolding | None
    ) -> Control:
        """Return it after an iteration of T; FOLDED if nothing gets rounder along the normals.

        Args:
            before: the surface before it.
            shape: and after it.
            config: of the run.
            unfolding: how what is stuck goes on, None if not at all.

        """
        momentum = min(grown(self.momentum), config.momentum)
        annealing, plateau, waited = self.annealing, self.plateau, self.waited + 1
        if shape.sphericity < before.sphericity:
            momentum = 0.0
        if shape.sphericity > plateau + PLATEAU_RISE:
            plateau, waited = shape.sphericity, 0
        elif self.phase == Phase.SMOOTHING:  # ends by what it has waited
            pass
        elif config.annealing is not None and waited >= config.annealing.patience:
            annealing, waited = annealing * config.annealing.factor, 0
            over = config.step * annealing < config.annealing.min_step
            if self.phase == Phase.NORMALS and not self.times and unfolding is not None:
                low = shape.sphericity < unfolding.sphericity and shape.radius_variation < ROUND_THOUGH_STUCK
                if over or low:  # as round as T along the normals makes it
                    return Control(0.0, annealing, plateau, 0, Phase.FOLDED, anew=self.anew)
        return self._replace(momentum=momentum, annealing=annealing, plateau=plateau, waited=waited)

    def annealed_down(self, config: FlowConfig) -> bool:
        """Whether the step has become too small to go on."""
        annealing = config.annealing
        return annealing is not None and config.step * self.annealing < annealing.min_step

    def short(self, shape: Shape, n: int) -> bool:
        """Whether a run of n vertices that goes along the radii is to be finished: it has not become round enough."""
        return self.phase == Phase.STAR and shape.sphericity < SHORT and n <= MOST

    def no_better(self, config: FlowConfig) -> bool:
        """Whether the part on the sphere has waited for anything to get better as long as it may."""
        annealing = config.annealing
        patience = np.inf if annealing is None else max(PATIENCES * annealing.patience, WAITED)
        return self.phase == Phase.SPHERE and self.waited >= patience

    def as_star(self, shape: Shape) -> Control:
        """Return it as STAR begins."""
        return Control(0.0, CAREFUL, shape.sphericity, 0, Phase.STAR, self.times, anew=self.anew)

    def as_finish(self, shape: Shape) -> Control:
        """Return it as FINISH begins."""
        return Control(0.0, self.annealing, shape.sphericity, 0, Phase.FINISH, self.times, anew=self.anew)

    def set_anew(self, shape: Shape, n: int) -> Control:
        """Return it as what follows begins with directions set anew, of n vertices: along the radii, if it is round."""
        if n <= MOST and shape.sphericity < SHORT:
            return self.as_finish(shape)._replace(anew=SET)
        return self.as_star(shape)._replace(anew=GONE_ON)

    def goes_on(self, shape: Shape) -> bool:
        """Whether T goes on along the radii of what was set anew: it has become round enough."""
        return self.phase == Phase.FINISH and self.anew == SET and shape.sphericity >= SHORT

    def climbed(self, shape: Shape, steps: int) -> Control:
        """Return it after an iteration of FINISH, of so many steps."""
        rise = RISE * steps / STEPS
        waited = 0 if shape.sphericity > self.plateau + rise else self.waited + 1
        return self._replace(plateau=max(self.plateau, shape.sphericity), waited=waited)

    @property
    def spreads(self) -> bool:
        """Whether triangles are to be drawn apart: some have all but vanished."""
        return self.phase == Phase.SPHERE and not self.inward and self.least_area < VANISHING

    def evened(self, shape: Shape, found: Unfolded) -> Control:
        """Return it after an iteration of SPHERE; of the next phase if that is done.

        Args:
            shape: the surface after it.
            found: what the directions are like.

        """
        waited, plateau = self.waited + 1, self.plateau
        variation, fewest, largest = self.variation, self.fewest, self.largest
        if shape.radius_variation < FALL * variation:
            variation, waited = shape.radius_variation, 0
        if shape.sphericity > plateau + PLATEAU_RISE:
            plateau, waited = shape.sphericity, 0
        if found.inward < fewest:
            fewest, variation, waited = found.inward, shape.radius_variation, 0
        if found.inward == 0 and found.least_area > largest / FALL:
            largest, variation, waited = found.least_area, shape.radius_variation, 0
        unfolded = not found.inward and found.least_area >= VANISHING
        if unfolded and (shape.radius_variation < SETTLED or waited > WAITED):
            if self.times == 1 and self.rounds == 1 and found.least_area >= THIN:
                return Control(0.0, 1.0, shape.sphericity, 0, Phase.SMOOTHING, self.times, anew=self.anew)
            return self.as_star(shape)
        return self._replace(
            plateau=plateau,
            waited=waited,
            inward=found.inward,
            least_area=found.least_area,
            fewest=fewest,
            variation=variation,
            largest=largest,
            lasted=self.lasted + 1,
        )


class Next(NamedTuple):
    """What the next iteration begins with.

    Attributes:
        control: what it does.
        position: (n, 3) where vertices are.
        centre: (3,) what directions are seen from.

    """

    control: Control
    position: Floats
    centre: Floats


def no_rounder(n: int) -> str:
    """Return why what finishes n vertices ends."""
    return (
        f"radii and directions together did not raise the sphericity by {RISE * steps_of(n) / STEPS:g} "
        f"in {FINISHED * steps_of(n)} steps"
    )


def grown(momentum: float) -> float:
    """Return (k + 1)/(k + 4) for k/(k + 3)."""
    return (1 + 2 * momentum) / (4 - momentum)


def round_enough(iteration: int, enough: float) -> float:
    """Return the sphericity from which on SPHERE may begin; ``enough`` is that before LATE iterations."""
    late = iteration - LATE
    return enough if late < 0 else min(enough, LATE_ENOUGH - LATER_LESS * late)
