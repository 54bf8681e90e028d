"""What a run is told: the frozen parameters of a flow, checked when they are built.

Symbols and meanings follow Vartziotis, "Curvature transformation", arXiv:1608.03898, sections 1 and 2; what is
ours (window, step bound, relaxation, momentum, rescale, annealing, unfolding) says so.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

from spherify.geometry.errors import InvalidConfigError

Method = Literal["curvature", "conformal", "mean-curvature"]
Measure = Literal["vtk", "length", "dual-area"]
StepUnit = Literal["absolute", "initial-mean-edge", "mean-edge"]
Rescale = Literal["none", "area", "volume"]
Boundary = Literal["fixed", "free"]


@dataclass(frozen=True, slots=True)
class Stage:
    """``repeat`` iterations of T with ``k_in`` inward and then ``k_out`` outward elementary steps each."""

    repeat: int
    k_in: int
    k_out: int

    def __post_init__(self) -> None:
        if self.repeat < 1:
            raise InvalidConfigError(f"a stage must repeat at least once, not {self.repeat} times")
        if self.k_in < 0 or self.k_out < 0 or self.k_in + self.k_out == 0:
            raise InvalidConfigError(
                f"k_in and k_out must be 0 or more and not both 0, not ({self.k_in}, {self.k_out})"
            )


@dataclass(frozen=True, slots=True)
class Annealing:
    """Shrink step and relaxation when nothing gets better. Ours.

    Attributes:
        patience: iterations without a rise of the best sphericity by 1e-4 before a reduction; after the part on the
            sphere, first before the climb, see `Unfolding`.
        factor: what step and relaxation are multiplied by, in (0, 1).
        min_step: the run ends as ``stalled`` once the step, in units of ``step_unit``, is below this.

    """

    patience: int
    factor: float
    min_step: float

    def __post_init__(self) -> None:
        if self.patience < 1:
            raise InvalidConfigError(f"annealing.patience must be at least 1, not {self.patience}")
        if not 0 < self.factor < 1:
            raise InvalidConfigError(f"annealing.factor must lie between 0 and 1, not {self.factor}")
        if not 0 < self.min_step < math.inf:
            raise InvalidConfigError(f"annealing.min_step must be finite and positive, not {self.min_step}")


LATE: Final = 40  # iterations; what is wide and not round yet takes T long


@dataclass(frozen=True, slots=True)
class Unfolding:
    """Go on upon the sphere: see `spherify.geometry.unfolding`. Ours; of closed surfaces of genus 0 in one piece.

    It begins once the surface is that round; or, less round, late in a run or where nothing gets rounder. The radii are
    evened out, and rounds of unfolding follow each iteration while a face looks inward, and of drawing apart while one
    has nearly vanished. After that T goes on along the normals; and, when nothing gets rounder by that or faces turn
    inward again, unless the run has converged, along the radii, while directions climb (`spherify.geometry.ascent`).
    What ends short of a sphere by that is finished: radii and directions climb together (`spherify.geometry.finish`).
    Directions that do not unfold are set anew from the connectivity (`spherify.geometry.reinsertion`).

    Attributes:
        sphericity: from which on.
        exponent: neighbours weigh (area of the triangles at them) to this power.
        rounds: after each iteration of it.

    """

    sphericity: float
    exponent: float
    rounds: int

    def __post_init__(self) -> None:
        if not 0 < self.sphericity < 1:
            raise InvalidConfigError(f"unfolding.sphericity must lie between 0 and 1, not {self.sphericity}")
        if not 0 < self.exponent < math.inf:
            raise InvalidConfigError(f"unfolding.exponent must be finite and positive, not {self.exponent}")
        if self.rounds < 1:
            raise InvalidConfigError(f"unfolding.rounds must be at least 1, not {self.rounds}")


@dataclass(frozen=True, slots=True)
class FlowConfig:
    """Every parameter of one run of the curvature transformation.

    Attributes:
        iterations: applications of T at most.
        measure: how an edge is valued in the vertex curvature K.
        schedule: stages, cycled until ``iterations`` are done (paper, Algorithm 2).
        step: C, in units of ``step_unit``.
        step_unit: a length that multiplies ``step``: 1, the mean edge at the start, or the mean edge now.
        window: percentiles of K taken as K_min and K_max; (0, 100) is the paper's. Ours.
        step_bound: 0 is off; else no vertex moves further in an elementary step than this times the least
            altitude of the triangles at it. Ours.
        relaxation: fraction of the tangential umbrella vector added after each elementary step; 0 is off. Ours.
        relaxation_exponent: neighbours weigh (area of the triangles at them) to this power. Ours.
        momentum: most b of p ← p + b·(p - p_before) before each iteration; b = k/(k + 3) after k iterations
            without a fall of the sphericity; 0 is off. Ours.
        rescale: what is restored about the centroid after each iteration. An open mesh has its area restored where
            the volume is asked for, and nothing where its boundary is fixed. Ours.
        annealing: see `Annealing`; None is off.
        unfolding: see `Unfolding`; None is off.
        stop_radius_variation: the run ends as ``converged`` below this radius variation, unless a face
            looks inward or has vanished, or ``unfolding`` has not done its part; 0 is off.
        boundary: whether vertices on an open boundary move. Closed meshes have none.
        method: its name.

    """

    iterations: int
    measure: Measure = "vtk"
    schedule: tuple[Stage, ...] = (Stage(1, 2, 2),)
    step: float = 0.05
    step_unit: StepUnit = "mean-edge"
    window: tuple[float, float] = (0.0, 100.0)
    step_bound: float = 0.0
    relaxation: float = 0.0
    relaxation_exponent: float = 0.0
    momentum: float = 0.0
    rescale: Rescale = "none"
    annealing: Annealing | None = None
    unfolding: Unfolding | None = None
    stop_radius_variation: float = 0.0
    boundary: Boundary = "fixed"
    method: Literal["curvature"] = "curvature"

    def __post_init__(self) -> None:
        low, high = self.window
        checks = (
            (self.iterations >= 0, f"iterations must be 0 or more, not {self.iterations}"),
            (len(self.schedule) > 0, "schedule must have at least one stage"),
            (0 < self.step < math.inf, f"step must be finite and positive, not {self.step}"),
            (0 <= low < high <= 100, f"window must satisfy 0 ≤ lo < hi ≤ 100, not [{low}, {high}]"),
            (
                0 <= self.step_bound < math.inf,
                f"step_bound must be finite and 0 or more, not {self.step_bound}",
            ),
            (0 <= self.relaxation <= 1, f"relaxation must lie in 0 … 1, not {self.relaxation}"),
            (
                0 <= self.relaxation_exponent < math.inf,
                f"relaxation_exponent must be finite and ≥ 0, not {self.relaxation_exponent}",
            ),
            (0 <= self.momentum < 1, f"momentum must lie in 0 … <1, not {self.momentum}"),
            (
                0 <= self.stop_radius_variation < math.inf,
                f"stop_radius_variation must be finite and ≥ 0, not {self.stop_radius_variation}",
            ),
        )
        for holds, sentence in checks:
            if not holds:
                raise InvalidConfigError(sentence)


@dataclass(frozen=True, slots=True)
class ImplicitFlowConfig:
    """Every parameter of one run of a mean curvature flow, in implicit steps of time.

    Attributes:
        iterations: steps at most.
        method: ``mean-curvature``, or ``conformal``, which has no singularities (Kazhdan, Solomon, Ben-Chen 2012).
        time_step: δ, in units of the surface's area at the start.
        rescale: what is restored about the centroid after each iteration; of open meshes as for `FlowConfig`.
        patience: the run ends as ``stalled`` after so many iterations without a rise of the best sphericity by
            1e-4; 0 is off.
        stop_radius_variation: the run ends as ``converged`` below this radius variation, unless a face
            looks inward or has vanished; 0 is off.
        measure: of the vertex curvature in the figures; the flow does not depend on it.
        boundary: whether vertices on an open boundary move. Closed meshes have none.

    """

    iterations: int
    method: Literal["conformal", "mean-curvature"]
    time_step: float
    rescale: Rescale = "area"
    patience: int = 0
    stop_radius_variation: float = 0.0
    measure: Measure = "vtk"
    boundary: Boundary = "fixed"

    def __post_init__(self) -> None:
        checks = (
            (self.iterations >= 0, f"iterations must be 0 or more, not {self.iterations}"),
            (0 < self.time_step < math.inf, f"time_step must be finite and positive, not {self.time_step}"),
            (self.patience >= 0, f"patience must be 0 or more, not {self.patience}"),
            (
                0 <= self.stop_radius_variation < math.inf,
                f"stop_radius_variation must be finite and ≥ 0, not {self.stop_radius_variation}",
            ),
        )
        for holds, sentence in checks:
            if not holds:
                raise InvalidConfigError(sentence)


Config: TypeAlias = FlowConfig | ImplicitFlowConfig
