"""Bodies put in their places by affine maps, collected into one mesh; GLB and 3MF are scenes of such."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from spherify.formats.errors import TooLargeError, UnreadableError
from spherify.formats.limits import ReadLimits
from spherify.formats.raw import RawMesh, check_counts
from spherify.geometry.mesh import Floats, Ints

IDENTITY: Floats = np.eye(4)


@dataclass
class Scene:
    """The bodies placed so far, counted against the limits before anything is copied."""

    limits: ReadLimits
    vertices: list[Floats] = field(default_factory=list)
    faces: list[Ints] = field(default_factory=list)
    n_vertices: int = 0
    n_faces: int = 0

    def place(self, vertices: Floats, faces: Ints, matrix: Floats) -> None:
        """Add (n, 3) vertices and (m, 3) faces under a 4 × 4 matrix that acts on columns.

        A map that mirrors (determinant < 0) turns the faces inside out, so they are turned back.
        """
        if len(self.vertices) >= self.limits.max_primitives:
            raise TooLargeError(
                f"The scene places more than {self.limits.max_primitives:,} parts. Join them into one body first."
            )
        check_counts(self.n_vertices + len(vertices), self.n_faces + len(faces), self.limits)
        if faces.size and (faces.min() < 0 or faces.max() >= len(vertices)):
            raise UnreadableError(
                f"A face names a vertex outside 0 … {len(vertices) - 1} of its part. The file is damaged: export it "
                "again."
            )
        if not np.array_equal(matrix, IDENTITY):
            vertices = vertices @ matrix[:3, :3].T + matrix[:3, 3]
            if np.linalg.det(matrix[:3, :3]) < 0:
                faces = faces[:, ::-1]
        self.vertices.append(vertices)
        self.faces.append(faces + self.n_vertices)
        self.n_vertices += len(vertices)
        self.n_faces += len(faces)

    def mesh(self) -> RawMesh:
        """Return everything placed, in order."""
        if not self.vertices:
            return RawMesh(np.empty((0, 3)), np.empty((0, 3), np.int64))
        return RawMesh(np.concatenate(self.vertices), np.concatenate(self.faces))
