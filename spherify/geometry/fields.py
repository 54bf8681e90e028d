"""Scalar fields over the vertices of a state, for colouring: curvature, distance, displacement, quality."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from spherify.geometry import measures
from spherify.geometry.curvature import vertex_curvature
from spherify.geometry.frame import Frame
from spherify.geometry.mesh import Floats, Ints, TriangleMesh
from spherify.geometry.quality import triangle_quality
from spherify.geometry.roundness import radii
from spherify.geometry.topology import Topology

FieldName = Literal["curvature", "distance", "displacement", "quality"]


@dataclass(frozen=True, slots=True)
class Field:
    """A scalar field over the vertices.

    Attributes:
        title: what it is.
        unit: of its values, "1" where they have none.
        description: its definition, in a sentence.
        diverging: whether it is coloured from one colour through a neutral one to another.

    """

    title: str
    unit: str
    description: str
    diverging: bool = False


FIELDS: Final[dict[FieldName, Field]] = {
    "curvature": Field(
        "Curvature",
        "1/length",
        "Vertex curvature K by the measure `vtk`: mean over the edges at the vertex of 3·l·θ / 2(A_f + A_g), θ the "
        "signed dihedral angle, positive where convex; 1/r on a sphere of radius r.",
        diverging=True,
    ),
    "distance": Field(
        "Distance to the best-fit sphere",
        "1",
        "(|p − c| − r) / r, with centre c and radius r of the sphere of least squares; positive outside it.",
        diverging=True,
    ),
    "displacement": Field(
        "Displacement",
        "mean edges",
        "|p − p₀| over the mean edge of the mesh at the start, p₀ being the vertex at iteration 0.",
    ),
    "quality": Field(
        "Triangle quality",
        "1",
        "Least quality 4√3·A / (a² + b² + c²) of the triangles at the vertex: 1 if they are equilateral, 0 if one has "
        "no area.",
    ),
}


def vertex_field(name: FieldName, start: TriangleMesh, V: Floats) -> Floats:
    """(n,) values of a field on the positions V (n, 3) over the triangles of ``start``.

    Args:
        name: which; defined in `FIELDS`.
        start: the mesh at iteration 0.
        V: positions now, in the same unit.

    """
    frame = Frame.around(V)
    U = frame.inside(V)
    if name == "curvature":
        topology = Topology.of(len(V), start.faces)
        return vertex_curvature(U, topology, "vtk") / frame.scale
    if name == "distance":
        centre, radius = best_fit_sphere(U, start.faces)
        return (radii(U, centre) - radius) / radius
    if name == "displacement":
        before = Frame.around(start.vertices)
        edges = Topology.of(len(V), start.faces).edges
        mean_edge = float(measures.edge_lengths(before.inside(start.vertices), edges).mean())
        return measures.norm((V - start.vertices) / before.scale) / mean_edge
    return least_quality(U, start.faces)


def least_quality(V: Floats, F: Ints) -> Floats:
    """(n,) least `triangle_quality` of the triangles at each vertex; 1 at a vertex without any."""
    quality = triangle_quality(V, F)
    least = np.ones(len(V))
    for corner in range(3):
        np.minimum.at(least, F[:, corner], quality)
    return least


def best_fit_sphere(V: Floats, F: Ints) -> tuple[Floats, float]:
    """Centre (3,) and radius r of the sphere that minimises Σ a·(|p − c|² − r²)², a the area around the vertex p.

    Linear in c and r² − |c|², hence without a start value or a step (Coope 1993, "Circle fitting by linear and
    nonlinear least squares"). Of a surface without area every vertex weighs the same.
    """
    areas = measures.sum_at_vertices(measures.face_areas(V, F), F, len(V))
    weights = np.sqrt(areas) if areas.sum() > 0 else np.ones(len(V))
    origin = V.mean(axis=0)  # a sphere far from the origin loses its digits in |p|²
    P = V - origin
    rows = np.column_stack([2 * P, np.ones(len(V))]) * weights[:, None]
    solution = np.linalg.lstsq(rows, measures.dot(P, P) * weights)[0]
    centre = solution[:3]
    radius = float(np.sqrt(solution[3] + centre @ centre))
    return origin + centre, radius
