"""The one mesh type of the project: frozen, checked once, handed around by reference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spherify.geometry.errors import InvalidMeshError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False, slots=True)
class TriangleMesh:
    """Vertices and the triangles between them.

    Attributes:
        vertices: (n, 3) float64 positions, in the unit of the file they came from; all finite.
        faces: (m, 3) int64 indices into ``vertices``, counter-clockwise seen from outside.

    Both arrays are read-only. Build one with `TriangleMesh.checked`, unless the arrays are known to be good.

    """

    vertices: Floats
    faces: Ints

    @classmethod
    def checked(cls, vertices: object, faces: object) -> TriangleMesh:
        """Copy, check and freeze two arrays.

        Raises:
            InvalidMeshError: wrong shapes, a coordinate that is not finite, an index out of range, or a
                triangle that names a vertex twice.

        """
        V = np.array(vertices, dtype=np.float64, order="C")
        F = np.array(faces, dtype=np.int64, order="C")
        if V.ndim != 2 or V.shape[1] != 3:
            raise InvalidMeshError(f"vertices must have the shape (n, 3), not {V.shape}")
        if F.ndim != 2 or F.shape[1] != 3:
            raise InvalidMeshError(f"faces must have the shape (m, 3), not {F.shape}")
        if not np.isfinite(V).all():
            row = int(np.flatnonzero(~np.isfinite(V).all(axis=1))[0])
            raise InvalidMeshError(f"vertex {row} has a coordinate that is not a finite number")
        if F.size and (F.min() < 0 or F.max() >= len(V)):
            row = int(np.flatnonzero((F < 0).any(axis=1) | (len(V) <= F).any(axis=1))[0])
            raise InvalidMeshError(f"face {row} names a vertex outside 0 … {len(V) - 1}")
        twice = (F[:, 0] == F[:, 1]) | (F[:, 1] == F[:, 2]) | (F[:, 2] == F[:, 0])
        if twice.any():
            raise InvalidMeshError(f"face {int(np.flatnonzero(twice)[0])} names a vertex twice")
        V.setflags(write=False)
        F.setflags(write=False)
        return cls(V, F)

    def with_vertices(self, vertices: Floats) -> TriangleMesh:
        """Return the same triangles over other positions, shape (n, 3)."""
        if vertices.shape != self.vertices.shape:
            raise InvalidMeshError(
                f"vertices must have the shape {self.vertices.shape}, not {vertices.shape}"
            )
        frozen = np.array(vertices, dtype=np.float64, order="C")
        frozen.setflags(write=False)
        return TriangleMesh(frozen, self.faces)
