"""Positions on their way between the order of the mesh and that of the passes, no more often than need be."""

from __future__ import annotations

from weakref import ReferenceType, ref

import numpy as np

from spherify.geometry.kernels.numbering import Numbering, Part
from spherify.geometry.kernels.team import Team
from spherify.geometry.mesh import Floats


class Positions:
    """What is loaded in a kernel's buffer, and which positions of the mesh that is."""

    def __init__(self, buffer: Floats, numbering: Numbering, parts: list[Part], team: Team) -> None:
        """Lead to and from ``buffer`` (3, n)."""
        self._buffer = buffer
        self._numbering = numbering
        self._parts = parts
        self._team = team
        self._loaded: ReferenceType[Floats] | None = None

    def load(self, V: Floats, *, to_move: bool = True) -> None:
        """Take V (n, 3) into the order of the passes, unless it is there: what was seen last, if nobody can write it.

        Args:
            V: positions.
            to_move: whether the buffer will not hold them for long.

        """
        unchanging = V.flags.owndata and not V.flags.writeable
        there = unchanging and self._loaded is not None and self._loaded() is V
        self._loaded = ref(V) if unchanging and not to_move else None
        if there:
            return

        def take(part: Part) -> None:
            span = slice(part.first, part.last)
            for k in range(3):
                np.take(V[:, k], self._numbering.order[span], out=self._buffer[k, span], mode="clip")

        self._team.each(take, self._parts)

    def unloaded(self) -> Floats:
        """Return what is loaded in the order of the mesh, (n, 3), read-only, so that it is known again."""
        moved = np.empty((len(self._numbering.place), 3), order="F")

        def take(part: Part) -> None:
            span = slice(part.first, part.last)
            for k in range(3):
                np.take(self._buffer[k], self._numbering.place[span], out=moved[span, k], mode="clip")

        self._team.each(take, self._parts)
        return self._known(moved)

    def scaled(self, V: Floats, centre: Floats, factor: float) -> Floats:
        """Return V scaled about ``centre``, (n, 3), read-only; it is loaded then, without going back and forth."""
        self.load(V, to_move=False)
        moved = np.empty_like(V, order="F")
        for before, after in ((V.T, moved.T), (self._buffer, self._buffer)):
            np.subtract(before, centre[:, None], out=after)
            np.multiply(after, factor, out=after)
            np.add(after, centre[:, None], out=after)
        return self._known(moved)

    def _known(self, V: Floats) -> Floats:
        V.setflags(write=False)
        self._loaded = ref(V)
        return V
