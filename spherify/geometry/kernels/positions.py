"""Positions on their way between the order of the mesh and that of the passes, no more often than need be."""

from __future__ import annotations

from weakref import ReferenceType, ref

import numpy as np

from spherify.geometry.kernels.numbering import Numbering, Part
from spherify.geometry.kernels.passes.jit import code_for
from spherify.geometry.kernels.passes.movement import unload
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
        self._unload = code_for(unload, buffer, numbering.place, buffer, *parts[0][:2])

    def load(self, V: Floats, *, to_move: bool = True) -> bool:
        """Take V (n, 3) into the order of the passes, unless it is there: what was seen last, if nobody can write it.

        Args:
            V: positions.
            to_move: whether the buffer will not hold them for long.

        Returns:
            whether it was there.

        """
        there = self._loaded is not None and self._loaded() is V and not V.flags.writeable
        self.hold(None)  # until it is there: what interrupts this may come at any moment
        if not there:
            self.take(V, self._buffer)
        if not to_move:
            self.hold(V)
        return there

    def take(self, V: Floats, into: Floats) -> None:
        """Write V (n, 3) to ``into`` (3, n), in the order of the passes."""

        def take(part: Part) -> None:
            span = slice(part.first, part.last)
            for k in range(3):
                np.take(V[:, k], self._numbering.order[span], out=into[k, span], mode="clip")

        self._team.each(take, self._parts)

    def unloaded(self) -> Floats:
        """Return what is loaded in the order of the mesh, (n, 3), read-only, so that it is known again."""
        moved = np.empty((len(self._numbering.place), 3), order="F")

        def take(part: Part) -> None:
            self._unload(self._buffer, self._numbering.place, moved.T, part.first, part.last)

        self._team.each(take, self._parts)
        moved.setflags(write=False)
        self.hold(moved)
        return moved

    def hold(self, V: Floats | None) -> None:
        """Note that the buffer holds V (n, 3), which is known again if nobody can write it; or nothing known."""
        unchanging = V is not None and V.flags.owndata and not V.flags.writeable
        self._loaded = ref(V) if V is not None and unchanging else None
