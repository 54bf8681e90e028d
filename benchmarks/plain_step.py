"""One elementary step of `paper` as one first writes it down in numpy: rows of three, `np.cross`, `np.bincount`.

The reference engine computes the same on columns, each coordinate by itself.
"""

from __future__ import annotations

import numpy as np

from spherify.geometry.mesh import Floats, TriangleMesh
from spherify.geometry.topology import Topology


class PlainStep:
    """I_C and O_C of a closed mesh, with the curvature of vtkCurvatures."""

    def __init__(self, mesh: TriangleMesh) -> None:
        topology = Topology.of(len(mesh.vertices), mesh.faces)
        self._F = np.ascontiguousarray(mesh.faces)
        self._E = np.ascontiguousarray(topology.interior_edges)
        self._beside = np.ascontiguousarray(topology.interior_edge_faces)
        self._degrees = topology.interior_degrees

    def __call__(self, V: Floats, step: float, *, outward: bool) -> Floats:
        """Return positions (n, 3) after one elementary step of length ``step``."""
        F, E, n = self._F, self._E, len(V)
        a, b, c = V[F[:, 0]], V[F[:, 1]], V[F[:, 2]]
        vectors = np.cross(b - a, c - a)
        doubled = np.linalg.norm(vectors, axis=1)
        units = vectors / doubled[:, None]
        normals = np.stack(
            [np.bincount(F.ravel(), np.repeat(units[:, k], 3), minlength=n) for k in range(3)], axis=1
        )
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        along = V[E[:, 1]] - V[E[:, 0]]
        lengths = np.linalg.norm(along, axis=1)
        left, right = units[self._beside[:, 0]], units[self._beside[:, 1]]
        sines = (np.cross(left, right) * along).sum(axis=1) / lengths
        angles = np.arctan2(sines, (left * right).sum(axis=1))
        values = 3 * lengths * angles / (doubled[self._beside[:, 0]] + doubled[self._beside[:, 1]])
        K = np.bincount(E.ravel(), np.repeat(values, 2), minlength=n) / self._degrees
        t = (K - K.min()) / (K.max() - K.min())
        return V + step * ((1 - t) if outward else -t)[:, None] * normals
