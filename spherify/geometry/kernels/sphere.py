"""What a compiled kernel does on the sphere: radii, directions, and how those cover it.

Everything is in the buffers of the kernel, which T does not need meanwhile, and shared out among its threads.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple, TypeVar

import numpy as np

from spherify.geometry.ascent import GIVEN_UP, HALVINGS
from spherify.geometry.config import Stage
from spherify.geometry.covering import Covering, centre_inside
from spherify.geometry.kernels.buffers import aligned
from spherify.geometry.kernels.numbering import Numbering, Part
from spherify.geometry.kernels.passes import ascent, directions, radii, spreading, unfolding
from spherify.geometry.kernels.passes.spans import BLOCK, SEGMENT, SUMS, Span, Sums
from spherify.geometry.kernels.passes.types import Buffers, Scratch
from spherify.geometry.kernels.positions import Positions
from spherify.geometry.kernels.team import Team
from spherify.geometry.mesh import Floats
from spherify.geometry.unfolding import EQUAL_RADII, EVENING, SMOOTHINGS, Unfolded

Task = TypeVar("Task")
Result = TypeVar("Result")


class OnTheSphere:
    """The part of a `spherify.geometry.kernels.compiled.CompiledKernel` that sees vertices from a centre."""

    def __init__(  # noqa: PLR0917 - all that a kernel has
        self,
        numbering: Numbering,
        positions: Positions,
        load: Callable[..., object],
        use: Buffers,
        scratch: list[Scratch],
        of_faces: Floats,
        parts: list[Part],
        team: Team,
    ) -> None:
        """Work in these buffers, ``of_faces`` (m,) among them, by the team; ``load`` brings positions there."""
        self._numbering = numbering
        self._mesh = numbering.connectivity
        self._positions = positions
        self._load = load
        self._use = use
        self._scratch = scratch
        self._of_faces = of_faces
        self._team = team
        self._spans = _spans(parts, len(of_faces))
        segments = max(self._spans[-1].last_stretch, self._spans[-1].last_segment)
        self._whole = np.empty((segments, SUMS))
        self._sums = [Sums(aligned(SUMS, BLOCK), self._whole) for _ in parts]

    def ahead(self, V: Floats, previous: Floats, centre: Floats, momentum: float) -> Floats:
        """See `spherify.geometry.kernels.interface.Kernel.ahead_along_radii`."""
        self._load(V)
        self._positions.take(previous, self._use.moved)
        self._along(radii.AHEAD, centre, momentum)
        return self._positions.unloaded()

    def step(self, centre: Floats, K_min: float, K_max: float, step: float) -> None:
        """Do an inward elementary step of the positions loaded along the radii; an outward one if it is negative."""
        self._along(radii.STEP, centre, K_min, K_max, step)

    def even_out(self, V: Floats, centre: Floats, stage: Stage) -> Floats | None:
        """See `spherify.geometry.kernels.interface.Kernel.even_out`."""
        self._load(V)
        self._along(radii.MEASURE, centre)
        stretches = self._whole[: self._spans[-1].last_stretch]
        found = evening(
            float(stretches[:, radii.TOTAL].sum()) / len(V),
            float(stretches[:, radii.LEAST].min()),
            float(stretches[:, radii.GREATEST].max()),
            stage,
        )
        if found is None:
            return None
        self._along(radii.EVEN, centre, *found)
        return self._positions.unloaded()

    def unfold(
        self, V: Floats, centre: Floats, log_weights: Floats, *, exponent: float, damping: float, rounds: int
    ) -> Unfolded:
        """See `spherify.geometry.kernels.interface.Kernel.unfold`."""
        self._load(V)
        weights = self._use.chosen[1]
        np.take(log_weights, self._numbering.order, out=weights, mode="clip")
        about = _vector(centre)

        def work(numbered: tuple[int, _Unfolding]) -> float:
            thread, now = numbered
            greatest: float = unfolding.unfold(
                self._mesh, self._use, self._scratch[thread], self._of_faces, self._sums[thread], about,
                exponent, damping, now.greatest, now.smoothings, now.rounds, now.passes, self._spans[thread],
            )  # fmt: skip
            return greatest

        def each(passes: int, now: _Unfolding) -> float:
            return max(self._each(work, now._replace(passes=passes)))

        now = _Unfolding(0, -np.inf, (0, SMOOTHINGS), (0, rounds))
        if len(self._spans) == 1:
            each(unfolding.ALL, now)
        else:
            for passes in (unfolding.DIRECT, unfolding.AREAS, unfolding.LEVEL):
                each(passes, now)
            for i in range(SMOOTHINGS):
                each(unfolding.SMOOTH, now._replace(smoothings=(i, i + 1)))
            now = now._replace(greatest=each(unfolding.APPROACH, now))
            each(unfolding.WEIGH, now)
            for i in range(rounds):
                each(unfolding.DRAW, now._replace(rounds=(i, i + 1)))
            for passes in (unfolding.LOOK, unfolding.BACK):
                each(passes, now)
        inward, least_area = self._folds()
        return Unfolded(self._positions.unloaded(), weights[self._numbering.place], inward, least_area)

    def spread(self, V: Floats, centre: Floats, rounds: int) -> Unfolded:
        """See `spherify.geometry.kernels.interface.Kernel.spread`."""
        self._load(V)
        about = _vector(centre)

        def work(numbered: tuple[int, tuple[int, int]]) -> None:
            thread, (passes, times) = numbered
            spreading.spread(
                self._mesh, self._use, self._sums[thread], about, times, passes, self._spans[thread]
            )

        if len(self._spans) == 1:
            self._each(work, (spreading.ALL, rounds))
        else:
            self._each(work, (spreading.DIRECT, 0))
            for _ in range(rounds):
                for passes in (spreading.LOOK, spreading.MARK, spreading.PRESS, spreading.YIELD):
                    self._each(work, (passes, 1))
            for passes in (spreading.LOOK, spreading.BACK):
                self._each(work, (passes, 0))
        inward, least_area = self._folds()
        return Unfolded(self._positions.unloaded(), np.zeros(0), inward, least_area)

    def ascend(self, V: Floats, previous: Floats, centre: Floats, momentum: float) -> Floats:
        """See `spherify.geometry.kernels.interface.Kernel.ascend`."""
        self._load(V)
        self._positions.take(previous, self._use.moved)
        about, turns = _vector(centre), self._whole[: self._spans[-1].last_segment, ascent.TURNS]

        def work(numbered: tuple[int, tuple[int, float]]) -> None:
            thread, (passes, less) = numbered
            ascent.ascend(
                self._mesh, self._use, self._scratch[thread], self._of_faces, self._sums[thread],
                about, momentum, less, passes, self._spans[thread],
            )  # fmt: skip

        def each(passes: Sequence[int], less: float = 1.0) -> None:
            for some in [sum(passes)] if len(self._spans) == 1 else passes:
                self._each(work, (some, less))

        each((ascent.DIRECT, ascent.MEASURE, ascent.CLIMB, ascent.CHECK))
        for i in range(HALVINGS + GIVEN_UP):
            if not turns.any():
                each((ascent.BACK,))
                return self._positions.unloaded()
            each((ascent.CUT, ascent.CHECK), 0.5 if i < HALVINGS else 0.0)
        return np.asfortranarray(V)

    def covering(self, V: Floats, centre: Floats) -> Covering:
        """See `spherify.geometry.kernels.interface.Kernel.covering`."""
        self._load(V, to_move=False)
        self._see(directions.COVER, centre)
        total, turned, _ = self._whole[: self._spans[-1].last_segment].sum(axis=0).tolist()
        return Covering(round(total / (4 * np.pi)), turned / (4 * np.pi))

    def centre_inside(self, V: Floats, near: Floats) -> Floats | None:
        """See `spherify.geometry.kernels.interface.Kernel.centre_inside`."""
        self._load(V, to_move=False)
        return centre_inside(self._use.position.T, self._mesh.corners.T, near, partial(self.covering, V))

    def folds(self, V: Floats, centre: Floats) -> tuple[int, float]:
        """See `spherify.geometry.kernels.interface.Kernel.folds`."""
        self._load(V)  # what is known of its curvature is written over
        self._see(directions.DIRECT, centre)
        self._see(directions.FOLDS, centre)
        return self._folds()

    def _folds(self) -> tuple[int, float]:
        """Return what was summed up by `spherify.geometry.kernels.passes.directions.outcome`."""
        faces = self._whole[: self._spans[-1].last_segment]
        mean = float(faces[:, directions.AREA].sum()) / len(self._of_faces)
        return int(faces[:, directions.INWARD].sum()), float(faces[:, directions.LEAST].min()) / mean

    def _see(self, passes: int, centre: Floats) -> None:
        about = _vector(centre)

        def work(numbered: tuple[int, int]) -> None:
            thread, one = numbered
            directions.see(self._mesh, self._use, self._sums[thread], about, one, self._spans[thread])

        self._each(work, passes)

    def _along(
        self, passes: int, centre: Floats, one: float = 0.0, two: float = 0.0, step: float = 0.0
    ) -> None:
        about = _vector(centre)

        def work(numbered: tuple[int, int]) -> None:
            thread, which = numbered
            radii.along_radii(
                self._use, self._sums[thread], about, one, two, step, which, self._spans[thread]
            )

        self._each(work, passes)

    def _each(self, work: Callable[[tuple[int, Task]], Result], task: Task) -> list[Result]:
        """Have each thread do its part of something."""
        return self._team.each(work, [(thread, task) for thread in range(len(self._spans))])


class _Unfolding(NamedTuple):
    """What `spherify.geometry.kernels.passes.unfolding.unfold` is to do now."""

    passes: int
    greatest: float
    smoothings: tuple[int, int]
    rounds: tuple[int, int]


def evening(mean: float, least: float, greatest: float, stage: Stage) -> tuple[float, float] | None:
    """Return the factor and the offset by which T evens out radii, see `spherify.geometry.kernels.passes.radii`.

    Args:
        mean: of the radii.
        least: of them.
        greatest: of them.
        stage: holds k_in and k_out.

    Returns:
        None if all radii are equal.

    """
    most = max(greatest - mean, mean - least)  # |K|
    factor, offset = 1.0, 0.0
    for i in range(stage.k_in + stage.k_out):
        if most <= EQUAL_RADII * least:
            return None if i == 0 else (factor, offset)
        by = 1 - EVENING / 2
        shift = EVENING / 2 * (mean + (most if i >= stage.k_in else -most))
        factor, offset = by * factor, by * offset + shift
        mean, least, most = by * mean + shift, by * least + shift, by * most
    return factor, offset


def _spans(parts: list[Part], m: int) -> list[Span]:
    """Share out stretches of vertices and segments of faces as the parts share the vertices."""
    n, count = int(parts[-1].last), len(parts)
    stretches, segments = -(-n // SEGMENT), -(-m // SEGMENT)
    return [
        Span(
            *part,
            first_stretch=stretches * thread // count,
            last_stretch=stretches * (thread + 1) // count,
            first_segment=segments * thread // count,
            last_segment=segments * (thread + 1) // count,
        )
        for thread, part in enumerate(parts)
    ]


def _vector(centre: Floats) -> tuple[float, float, float]:
    return float(centre[0]), float(centre[1]), float(centre[2])
