"""The frame a run computes in: the mesh moved to the origin and scaled to a box of about 1.

Curvatures, areas and volumes of a mesh of size 1e-110 or 1e110 under- or overflow when cubed, and a mesh far from
the origin loses digits in every product; in a unit box neither happens, so that the result does not depend on scale
or place. The scale is a power of two: dividing and multiplying by it loses nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spherify.geometry.mesh import Floats


@dataclass(frozen=True, eq=False, slots=True)
class Frame:
    """``V = origin + scale · U`` for positions V in the unit of the mesh and U in the box.

    Attributes:
        origin: (3,) centre of the bounding box of the mesh.
        scale: a power of two, between half and all of the largest half side of that box; 1 if the box is a point.

    """

    origin: Floats
    scale: float

    @classmethod
    def around(cls, V: Floats) -> Frame:
        """Return the frame of positions (n, 3), n ≥ 1."""
        columns = np.ascontiguousarray(V.T)  # many times as quick as down the rows
        low, high = columns.min(axis=1), columns.max(axis=1)
        origin = low / 2 + high / 2  # halved first: the sum may overflow
        half_side = float((high / 2 - low / 2).max())
        return cls(origin, math.ldexp(1.0, math.frexp(half_side)[1] - 1) if half_side > 0 else 1.0)

    def inside(self, V: Floats) -> Floats:
        """Return positions V of the mesh's unit as positions in the box, column by column in memory."""
        columns = np.array(V.T, order="C")
        columns -= self.origin[:, None]
        columns /= self.scale
        return columns.T

    def outside(self, U: Floats) -> Floats:
        """Return positions U in the box in the mesh's unit, row by row in memory, read-only."""
        V = np.ascontiguousarray(self.origin + self.scale * U)
        V.setflags(write=False)
        return V
