"""What an engine must offer."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from spherify.geometry.config import FlowConfig, Stage
from spherify.geometry.covering import Covering
from spherify.geometry.finish import Energy
from spherify.geometry.mesh import Floats, Ints
from spherify.geometry.metrics import Figures
from spherify.geometry.roundness import ALL, Shape, Wanted
from spherify.geometry.thinning import Thinning
from spherify.geometry.topology import Topology
from spherify.geometry.unfolding import Unfolded


class Kernel(Protocol):
    """The transformation, prepared for one connectivity and one configuration. Same input, same bits."""

    def transform(
        self,
        V: Floats,
        stage: Stage,
        step: float,
        relaxation: float,
        *,
        previous: Floats | None = None,
        momentum: float = 0.0,
        measured: Wanted | None = None,
    ) -> Floats | None:
        """Apply T_(k_in, k_out, C) once: k_in inward, then k_out outward elementary steps.

        Args:
            V: (n, 3) positions, left as they are.
            stage: holds k_in and k_out.
            step: C, a length in the unit of V.
            relaxation: fraction of the tangential umbrella vector after each elementary step.
            previous: (n, 3) positions to go on from: T begins at p + ``momentum`` (p - p_previous).
            momentum: see above; 0 without ``previous``.
            measured: what `shape` of what comes of it is asked for next, which may then be had by the way, and what
                comes of it may be scaled to the area wanted; None: not.

        Returns:
            (n, 3) new positions, not necessarily finite; None if the curvature became constant, for then t is
            undefined and the mesh must not move.

        """
        ...

    def transform_radially(self, V: Floats, stage: Stage, step: float, centre: Floats) -> Floats | None:
        """Apply T once with the direction from ``centre`` (3,) for the normal; neither bound nor relaxation.

        Arguments and result otherwise as of `transform`. No face that looks outward from the centre can be turned.
        """
        ...

    def ahead_along_radii(self, V: Floats, previous: Floats, centre: Floats, momentum: float) -> Floats:
        """Return (n, 3) where the momentum of the radii leads: r + b (r - before) for a radius r; directions stay.

        Args:
            V: (n, 3) positions.
            previous: (n, 3) positions an iteration before.
            centre: (3,) c.
            momentum: b.

        """
        ...

    def even_out(self, V: Floats, centre: Floats, stage: Stage) -> Floats | None:
        """Do what `spherify.geometry.unfolding.evened_out` does."""
        ...

    def unfold(
        self, V: Floats, centre: Floats, log_weights: Floats, *, exponent: float, damping: float, rounds: int
    ) -> Unfolded:
        """Do what `spherify.geometry.unfolding.unfolded` does."""
        ...

    def spread(self, V: Floats, centre: Floats, rounds: int) -> Unfolded:
        """Do what `spherify.geometry.unfolding.spread` does."""
        ...

    def ascend(self, V: Floats, previous: Floats, centre: Floats, momentum: float) -> Floats:
        """Do what `spherify.geometry.ascent.ascended` does."""
        ...

    def energies(self, F: Ints, barrier: float) -> Callable[[Floats], Energy | None]:
        """Do what `spherify.geometry.finish.energies` does."""
        ...

    @property
    def thinning(self) -> type[Thinning]:
        """What takes vertices out and puts them back, see `spherify.geometry.thinning`."""
        ...

    def covering(self, V: Floats, centre: Floats) -> Covering:
        """Do what `spherify.geometry.covering.covering` does."""
        ...

    def centre_inside(self, V: Floats, near: Floats) -> Floats | None:
        """Do what `spherify.geometry.covering.centre_inside` does."""
        ...

    def folds(self, V: Floats, centre: Floats) -> tuple[int, float]:
        """Do what `spherify.geometry.unfolding.folds` does, of the directions of V (n, 3) from ``centre`` (3,)."""
        ...

    def shape(self, V: Floats, wanted: Wanted = ALL) -> Shape:
        """Measure the surface as a whole; numbers that are not finite are passed on.

        Args:
            V: (n, 3) positions.
            wanted: what of it; the mean edge may cost half of the rest.

        """
        ...

    def figures(self, V: Floats, centre: Floats) -> Figures:
        """Return the figures of valid positions (n, 3) about ``centre`` (3,), by the measure of the configuration."""
        ...

    def scaled(self, V: Floats, centre: Floats, factor: float) -> Floats:
        """Return c + factor·(p - c) for all p of V (n, 3), a new array, with ``centre`` (3,) for c."""
        ...


class Engine(Protocol):
    """A way to compute T."""

    @property
    def name(self) -> str:
        """The name it is chosen by."""
        ...

    @property
    def ready(self) -> bool:
        """Whether it can begin at once, because whatever it has to make once on a machine is made."""
        ...

    def warm(self) -> None:
        """Get ready, so that the first kernel need not."""
        ...

    def prepare(self, topology: Topology, config: FlowConfig) -> Kernel:
        """Precompute whatever does not depend on positions."""
        ...
