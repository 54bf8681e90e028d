"""The figures of a report. Sizes are taken in a box of unit size and scaled back, so that none over- or underflows."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from spherify.formats.judge import genus_of
from spherify.formats.repair import Draft
from spherify.formats.report import Defect, MeshReport, Point
from spherify.geometry.measures import area_vectors, dot, norm

_NO_AREA = 1e-12  # quality below which a triangle is a line for float64


def enclosed_volume(mesh: Draft) -> float:
    """Return the signed volume, positive if the faces look outward; of an open mesh about its centroid."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    size = float((high - low).max())
    return _volume((mesh.vertices - low) / size, mesh) * size**3 if size > 0 else 0.0


def _volume(unit: np.ndarray, mesh: Draft) -> float:
    vectors = area_vectors(unit, mesh.faces)
    a, b, c = (unit[mesh.faces[:, corner]] for corner in range(3))
    middles = (a + b + c) / 3
    areas = norm(vectors)
    total = float(areas.sum())
    centroid = (middles * areas[:, None]).sum(axis=0) / total if total > 0 else middles.mean(axis=0)
    return float(np.einsum("ij,ij->", middles - centroid, vectors)) / 3


def report(
    mesh: Draft, mesh_format: str, found: tuple[Defect, ...], allow: Collection[str], *, eligible: bool
) -> MeshReport:
    """Measure a mesh with at least one face, all coordinates finite and of a bearable size."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    size = float((high - low).max()) or 1.0
    unit = (mesh.vertices - low) / size
    areas = norm(area_vectors(unit, mesh.faces))
    a, b, c = (unit[mesh.faces[:, corner]] for corner in range(3))
    squares = dot(a - b, a - b) + dot(b - c, b - c) + dot(c - a, c - a)
    quality = np.divide(4 * np.sqrt(3) * areas, squares, out=np.zeros_like(areas), where=squares > 0)
    edges = mesh.topology.edges
    area, volume = float(areas.sum()), _volume(unit, mesh)
    return MeshReport(
        format=mesh_format,
        vertices=len(mesh.vertices),
        faces=len(mesh.faces),
        components=mesh.topology.n_components,
        genus=genus_of(mesh),
        euler=mesh.topology.euler,
        boundary_loops=mesh.topology.boundary_loops,
        boundary_edges=len(mesh.topology.boundary_edges),
        degenerate_faces=int((quality < _NO_AREA).sum()),
        bbox=(_point(low), _point(high)),
        area=area * size**2,
        volume=volume * size**3,
        sphericity=float(np.cbrt(36 * np.pi * volume**2)) / area if area > 0 else 0.0,
        mean_edge=float(norm(unit[edges[:, 0]] - unit[edges[:, 1]]).mean()) * size,
        least_quality=float(quality.min()),
        eligible=eligible,
        allowed=tuple(sorted(allow)),
        repairs=mesh.repairs,
        defects=found,
    )


def _point(corner: np.ndarray) -> Point:
    x, y, z = map(float, corner)
    return x, y, z
