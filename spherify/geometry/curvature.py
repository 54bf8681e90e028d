"""The vertex curvature K in its three measures.

K(p) is the average, over the edges at p, of the value of the edge. The paper defines the edge value l·θ and
computed its pictures with vtkCurvatures, whose value is another; the textbook's pointwise mean curvature is here
for comparison. Edges without two faces are skipped and not counted.
"""

from __future__ import annotations

import numpy as np

from spherify.geometry import measures
from spherify.geometry.config import Measure
from spherify.geometry.mesh import Floats
from spherify.geometry.topology import Topology


def vertex_curvature(V: Floats, topology: Topology, measure: Measure) -> Floats:
    """(n,) curvature K of each vertex, from positions alone; see `curvature_from`."""
    vectors = measures.area_vectors(V, topology.faces)
    return curvature_from(V, topology, measure, measures.normalised(vectors), measures.norm(vectors))


def curvature_from(
    V: Floats, topology: Topology, measure: Measure, face_normals: Floats, face_areas: Floats
) -> Floats:
    """(n,) curvature K of each vertex, positive where the surface is convex; 0 at a vertex without counted edges.

    - ``length``: mean over the edges of l·θ, a length. *Integrated.* Vartziotis, section 1.
    - ``vtk``: mean over the edges of (3/2)·l·θ / (A_f + A_g), 1/length. *Pointwise*; 1/r on a sphere of regular
      triangles. The code of vtkCurvatures, vtk 9.
    - ``dual-area``: ¼ Σ l·θ ÷ (⅓ Σ areas at p), 1/length. *Pointwise* mean curvature, 1/r on a sphere.

    Args:
        V: (n, 3) positions.
        topology: of the mesh.
        measure: which of the three.
        face_normals: (m, 3) unit normals of the faces at these positions.
        face_areas: (m,) their areas.

    """
    n = topology.n_vertices
    edges, edge_faces = topology.interior_edges, topology.interior_edge_faces
    value = measures.edge_lengths(V, edges) * measures.dihedral_angles(V, edges, edge_faces, face_normals)
    if measure == "vtk":
        area = np.take(face_areas, edge_faces[:, 0]) + np.take(face_areas, edge_faces[:, 1])
        value = np.divide(1.5 * value, area, out=np.zeros_like(value), where=area != 0)
    total = measures.scatter(edges[:, 0], value, n) + measures.scatter(edges[:, 1], value, n)
    if measure == "dual-area":
        dual = measures.sum_at_vertices(face_areas, topology.faces, n) / 3
        return np.divide(total / 4, dual, out=np.zeros(n), where=dual != 0)
    return total / np.maximum(topology.interior_degrees, 1)
