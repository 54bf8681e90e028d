"""The surface as its faces give it, in parts: shape, for whatever its rings do not, and the figures of a row."""

from __future__ import annotations

from functools import partial
from typing import Final

from spherify.geometry.kernels.buffers import Space
from spherify.geometry.kernels.numbering import Part
from spherify.geometry.kernels.passes import shape
from spherify.geometry.kernels.passes.quality import AREA, INWARD, QUALITY, judge
from spherify.geometry.kernels.passes.types import CENTRE, INTEGRATE, RADII, VARIATION, Floats, Found, Indices
from spherify.geometry.kernels.team import Team
from spherify.geometry.metrics import Figures

PASSES: Final = (INTEGRATE, CENTRE, RADII, shape.MOMENTS, VARIATION)
ALONE: Final = {CENTRE, VARIATION}  # by one thread


class Faces:
    """Who measures positions in places, face by face."""

    def __init__(self, corners: Indices, parts: list[Part], team: Team, *, closed: bool) -> None:
        """Measure the faces ``corners`` (3, m) of a surface, which may be ``closed``."""
        self._corners = corners
        self._parts = list(enumerate(parts))
        self._team = team
        self._closed = closed
        self.space = Space.of(corners.shape[1], team.threads)

    def measure(self, position: Floats, radius: Floats) -> Floats:
        """Measure positions (3, n), with ``radius`` (n,) to write to; the result of `passes.shape.measure`."""
        if len(self._parts) == 1:
            self._measure(self._parts[0], sum(PASSES), position, radius)
        for passes in () if len(self._parts) == 1 else PASSES:
            work = partial(self._measure, passes=passes, position=position, radius=radius)
            self._team.each(work, self._parts[: 1 if passes in ALONE else None])
        return self.space.result

    def figures(self, position: Floats, centre: Floats, curved: Found) -> Figures:
        """Return the figures of positions (3, n) about ``centre`` (3,), of which the curvature is known."""
        judged = self._team.each(partial(self._judge, position=position, centre=centre), self._parts)
        worst, smallest, nearest, farthest = zip(*judged, strict=True)
        faces = self._corners.shape[1]
        # By themselves: nothing is written to the other columns, and what lies there need be no numbers.
        area, quality, inward = (float(self.space.sums[:, k].sum()) for k in (AREA, QUALITY, INWARD))
        mean_area = area / faces
        return Figures(
            radius_ratio=min(nearest) / max(farthest) if max(farthest) > 0 else 0.0,
            curvature_min=curved.K_min,
            curvature_max=curved.K_max,
            mean_quality=quality / faces,
            least_quality=min(worst),
            inward_faces=int(inward),
            least_area=min(smallest) / mean_area if mean_area > 0 else 0.0,
        )

    def _measure(self, numbered: tuple[int, Part], passes: int, position: Floats, radius: Floats) -> None:
        thread, part = numbered
        space = self.space
        shape.measure(
            position,
            self._corners,
            space.area,
            radius,
            space.lanes[thread],
            space.sums,
            space.result,
            self._closed,
            passes,
            *self._segments(thread),
            part.first,
            part.last,
        )

    def _judge(
        self, numbered: tuple[int, Part], position: Floats, centre: Floats
    ) -> tuple[float, float, float, float]:
        thread, part = numbered
        space = self.space
        judged: tuple[float, float, float, float] = judge(
            position,
            self._corners,
            centre,
            space.lanes[thread],
            space.sums,
            *self._segments(thread),
            part.first,
            part.last,
        )
        return judged

    def _segments(self, thread: int) -> tuple[int, int]:
        """Return the first segment of a thread's part, and one behind its last."""
        count = len(self.space.sums)
        return count * thread // len(self._parts), count * (thread + 1) // len(self._parts)
