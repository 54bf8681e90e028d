"""STL: float32, three positions and a normal a triangle, no connectivity.

Ours: trimesh gives no normal to triangles with edges of less than some 1e-7 units, so that a cell measured in metres
would be shaded black, and takes four times as long over text, in which it writes digits that float32 does not have.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from spherify.formats.colours import VertexColours
from spherify.formats.readers.stl import TRIANGLE
from spherify.formats.writers.text import rows
from spherify.geometry.measures import face_normals
from spherify.geometry.mesh import TriangleMesh

_HEADER = b"Spherify, binary STL".ljust(80)  # must not begin with "solid"
_FACET = "facet normal %.9g %.9g %.9g\nouter loop\n" + 3 * "vertex %.9g %.9g %.9g\n" + "endloop\nendfacet\n"


def stl_binary(
    mesh: TriangleMesh,
    precision: Literal["double", "float"],  # float32 always
    colours: VertexColours | None = None,  # none in STL
) -> bytes:
    """Return binary STL; the normal of a triangle without area is 0."""
    triangles = np.zeros(len(mesh.faces), TRIANGLE)
    triangles["normal"] = face_normals(mesh.vertices, mesh.faces)
    triangles["corners"] = mesh.vertices[mesh.faces]
    return b"".join([_HEADER, len(mesh.faces).to_bytes(4, "little"), triangles.tobytes()])


def stl_ascii(
    mesh: TriangleMesh,
    precision: Literal["double", "float"],  # float32 always
    colours: VertexColours | None = None,  # none in STL
) -> bytes:
    """Return ASCII STL with the digits of float32."""
    corners = mesh.vertices[mesh.faces].reshape(-1, 9)
    facets = np.concatenate([face_normals(mesh.vertices, mesh.faces), corners], axis=1).astype(np.float32)
    return b"".join([b"solid spherify\n", *rows(facets, _FACET), b"endsolid spherify\n"])
