"""The figures of one state."""

from __future__ import annotations

from dataclasses import dataclass

from spherify.geometry import measures
from spherify.geometry.config import Measure
from spherify.geometry.curvature import vertex_curvature
from spherify.geometry.mesh import Floats
from spherify.geometry.quality import inward_faces, triangle_quality
from spherify.geometry.roundness import Shape, radii, shape_of
from spherify.geometry.topology import Topology


@dataclass(frozen=True, slots=True)
class Figures:
    """What a state is asked for besides its `Shape`, in the unit of its positions.

    Attributes:
        radius_ratio: least over greatest |p - c|.
        curvature_min: least vertex curvature.
        curvature_max: greatest vertex curvature.
        mean_quality: mean of 4√3·A/Σl² over the triangles, 1 if all are equilateral.
        least_quality: least of the same.
        inward_faces: number of faces that look towards c or have no area.
        least_area: least area of a triangle over their mean area.

    """

    radius_ratio: float
    curvature_min: float
    curvature_max: float
    mean_quality: float
    least_quality: float
    inward_faces: int
    least_area: float


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

    @classmethod
    def of(cls, shape: Shape, figures: Figures, *, measure: Measure, step: float, scale: float) -> Metrics:
        """Put together what was found of one state.

        Args:
            shape: in units of ``scale``.
            figures: likewise, about the centroid of ``shape``.
            measure: of the curvature.
            step: C in use, likewise.
            scale: the length all figures are multiplied up by, to its power in each.

        """
        by = scale if measure == "length" else 1 / scale
        return cls(
            sphericity=shape.sphericity,
            area=shape.area * scale * scale,
            volume=shape.volume * scale * scale * scale,
            radius_variation=shape.radius_variation,
            radius_ratio=figures.radius_ratio,
            curvature_min=figures.curvature_min * by,
            curvature_max=figures.curvature_max * by,
            step=step * scale,
            mean_quality=figures.mean_quality,
            least_quality=figures.least_quality,
            inward_faces=figures.inward_faces,
        )

    def as_dict(self) -> dict[str, float | int]:
        """Return the figures by name, in the order above."""
        return {name: getattr(self, name) for name in self.__slots__}


def figures_of(V: Floats, topology: Topology, measure: Measure, centre: Floats) -> Figures:
    """Compute the figures of positions (n, 3) about ``centre`` (3,)."""
    F = topology.faces
    distances, K = radii(V, centre), vertex_curvature(V, topology, measure)
    quality, areas = triangle_quality(V, F), measures.face_areas(V, F)
    farthest, mean_area = float(distances.max()), float(areas.mean())
    return Figures(
        radius_ratio=float(distances.min()) / farthest if farthest > 0 else 0.0,
        curvature_min=float(K.min()),
        curvature_max=float(K.max()),
        mean_quality=float(quality.mean()),
        least_quality=float(quality.min()),
        inward_faces=inward_faces(V, F, centre),
        least_area=float(areas.min()) / mean_area if mean_area > 0 else 0.0,
    )


def metrics_of(
    V: Floats, topology: Topology, *, measure: Measure, step: float, scale: float = 1.0
) -> Metrics:
    """Compute all figures of positions (n, 3) in units of ``scale``, by numpy; see `Metrics.of`."""
    shape = shape_of(V, topology)
    figures = figures_of(V, topology, measure, shape.centroid)
    return Metrics.of(shape, figures, measure=measure, step=step, scale=scale)
