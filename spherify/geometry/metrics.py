"""The figures of one state."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from spherify.geometry.config import Measure
from spherify.geometry.curvature import vertex_curvature
from spherify.geometry.mesh import Floats
from spherify.geometry.quality import inward_faces, triangle_quality
from spherify.geometry.roundness import radii, shape_of
from spherify.geometry.topology import Topology


@dataclass(frozen=True, slots=True)
class Metrics:
    """Figures of one state, in the unit of the mesh.

    Attributes:
        sphericity: Ψ = π^(1/3)(6V)^(2/3)/A, 1 for a sphere.
        area: length².
        volume: signed, length³.
        radius_variation: area-weighted standard deviation of |p - c| over its mean, c the area-weighted centroid.
        radius_ratio: least over greatest |p - c|.
        curvature_min: least vertex curvature, in the unit of the run's measure.
        curvature_max: greatest vertex curvature.
        step: C in use, a length.
        mean_quality: mean of 4√3·A/Σl² over the triangles, 1 if all are equilateral.
        least_quality: least of the same.
        inward_faces: number of faces that look towards the centroid or have no area.

    """

    sphericity: float
    area: float
    volume: float
    radius_variation: float
    radius_ratio: float
    curvature_min: float
    curvature_max: float
    step: float
    mean_quality: float
    least_quality: float
    inward_faces: int

    def as_dict(self) -> dict[str, float | int]:
        """Return the figures by name, in the order above."""
        return asdict(self)


def metrics_of(
    V: Floats, topology: Topology, *, measure: Measure, step: float, scale: float = 1.0
) -> Metrics:
    """Compute all figures of positions (n, 3).

    Args:
        V: positions, in units of ``scale``.
        topology: of the mesh.
        measure: of the curvature.
        step: C in use, in units of ``scale`` like V.
        scale: the length all figures are multiplied up by, to its power in each.

    """
    F = topology.faces
    shape = shape_of(V, topology)
    distances = radii(V, shape.centroid)
    K = vertex_curvature(V, topology, measure) * (scale if measure == "length" else 1 / scale)
    quality = triangle_quality(V, F)
    farthest = float(distances.max())
    return Metrics(
        sphericity=shape.sphericity,
        area=shape.area * scale * scale,
        volume=shape.volume * scale * scale * scale,
        radius_variation=shape.radius_variation,
        radius_ratio=float(distances.min()) / farthest if farthest > 0 else 0.0,
        curvature_min=float(K.min()),
        curvature_max=float(K.max()),
        step=step * scale,
        mean_quality=float(quality.mean()),
        least_quality=float(quality.min()),
        inward_faces=inward_faces(V, F, shape.centroid),
    )
