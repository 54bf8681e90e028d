"""What a method must offer: a way to lead a surface from one iteration to the next."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, TypeAlias

from spherify.geometry.mesh import Floats
from spherify.geometry.metrics import Figures
from spherify.geometry.progress import Layout, Memory, Progress
from spherify.geometry.roundness import Shape


@dataclass(frozen=True, slots=True)
class Standstill:
    """The method cannot move the surface, and never will: its curvature is constant.

    Attributes:
        detail: a sentence about it.

    """

    detail: str


@dataclass(frozen=True, slots=True)
class Breakdown:
    """The next state does not exist, or the method has no meaning beyond it: a singularity.

    Attributes:
        detail: what broke, and where; the beginning of a sentence.

    """

    detail: str


Step: TypeAlias = Floats | Standstill | Breakdown


class Method(Protocol):
    """One method, prepared for one mesh and one configuration. Same input, same bits.

    The run's loop owns everything else: what is valid, rescaling, the best state, when to stop, checkpoints.
    Positions and lengths are in the run's `Frame`.
    """

    @property
    def computed_by(self) -> str:
        """What computes it, by name: a run can only be resumed by the same."""
        ...

    @property
    def layout(self) -> Layout:
        """Shape and type of each array of `Memory`."""
        ...

    def shape(self, V: Floats, *, whole: bool = False) -> Shape:
        """Measure the surface as a whole; numbers that are not finite are passed on.

        The radius variation may be nan if it is not below that at which a run ends; not if the ``whole`` is wanted.
        """
        ...

    def figures(self, V: Floats, centre: Floats) -> Figures:
        """Return the figures of valid positions about ``centre`` (3,), by the measure of the configuration."""
        ...

    def scaled(self, V: Floats, centre: Floats, factor: float) -> Floats:
        """Return positions V scaled by ``factor`` about ``centre`` (3,), a new array."""
        ...

    def begin(self, V: Floats, shape: Shape) -> Memory:
        """Take the positions (n, 3) of the start and their shape, once and before anything else but `shape`.

        Returns:
            what is remembered before the first iteration.

        """
        ...

    def step(self, progress: Progress) -> float:
        """Return how far the next iteration goes: the figure ``step`` of `Metrics`, a length."""
        ...

    def settled(self, progress: Progress) -> bool:
        """Whether equal radii would make this state the last: it has not just begun to get rounder otherwise."""
        ...

    def stalled(self, progress: Progress) -> str | None:
        """Return why going on is of no use, a sentence; None if it is."""
        ...

    def advance(self, progress: Progress) -> Step:
        """Return positions (n, 3) one iteration later, a new array; not necessarily finite, nor a valid surface."""
        ...

    def rescued(self, progress: Progress) -> Floats | None:
        """Return what is better than what `advance` returned, which was no valid surface; None if nothing is."""
        ...

    def remember(self, progress: Progress, shape: Shape, factor: float) -> Memory:
        """Return what is remembered once ``progress`` was left for a valid state of this shape.

        ``factor`` is what that state was rescaled by, about its centroid.
        """
        ...
