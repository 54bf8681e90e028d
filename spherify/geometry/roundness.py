"""How round a surface is: sphericity, radius variation, and the measures of the whole they come from."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from spherify.geometry import measures
from spherify.geometry.mesh import Floats, Ints
from spherify.geometry.topology import Topology

NEARLY: Final = 0.7  # least over greatest radius; ellipsoids of sphericity 0.99 have 0.79
SURELY: Final = 1e-12  # a hundred times the rounding of a·(b × c) where coordinates are below 1


class Wanted(NamedTuple):
    """What is wanted of a shape, of that which takes time.

    Attributes:
        edges: the mean edge.
        variation: the radius variation, if it is less than this.
        area: of a surface that moves: that it is scaled to about its centroid, and measured as it is then; 0: not.

    """

    edges: bool = True
    variation: float = math.inf
    area: float = 0.0


ALL: Final = Wanted()


class Shape(NamedTuple):
    """A surface as a whole.

    Attributes:
        area: length².
        volume: signed, length³, positive when the normals point outward; for an open mesh that of the cone over
            it from its centroid.
        centroid: (3,) area-weighted centroid of the surface.
        mean_edge: mean length of all edges; nan where it was not wanted.
        radius_variation: area-weighted standard deviation of |p - centroid| over its mean; 0 on a round sphere
            whatever its triangles; may be nan where it is greater than was `Wanted`.
        outward: whether every face is known to look away from the centroid: by far more than rounding, seen by the
            way. Where it is False, nothing is known.
        least_area: of a face, over the mean; 0 where it is not known.

    """

    area: float
    volume: float
    centroid: Floats
    mean_edge: float
    radius_variation: float
    outward: bool = False
    least_area: float = 0.0

    @property
    def sphericity(self) -> float:
        """Ψ of this area and volume, see `sphericity`."""
        return sphericity(self.area, self.volume)

    def scaled(self, factor: float) -> Shape:
        """Return the shape after scaling about the centroid."""
        return Shape(
            self.area * factor**2,
            self.volume * factor**3,
            self.centroid,
            self.mean_edge * factor,
            self.radius_variation,
        )

    @property
    def finite(self) -> bool:
        """Whether every number is finite that no coordinate is left out of."""
        return math.isfinite(self.area) and math.isfinite(self.volume)


def sphericity(area: float, volume: float) -> float:
    """Ψ = π^(1/3) (6V)^(2/3) / A: 1 for a sphere, less for every other surface; blind to the sign of V."""
    if area == 0:
        return 0.0
    return math.cbrt(math.pi) * math.cbrt(6 * volume) ** 2 / area


def radii(V: Floats, centre: Floats) -> Floats:
    """(n,) distances |p - c| of the vertices from ``centre`` (3,)."""
    return measures.norm(V - centre)


def nearly_round(V: Floats, centre: Floats) -> bool:
    """Whether all vertices V (n, 3) have nearly the same distance from ``centre`` (3,), be there folds or not."""
    distances = radii(V, centre)
    return bool(distances.min() >= NEARLY * distances.max())


def radius_variation(V: Floats, centre: Floats, weights: Floats) -> float:
    """Weighted standard deviation of |p - c| over its weighted mean; ``weights`` (n,) sum to the area."""
    total, distances = float(weights.sum()), radii(V, centre)
    if total == 0:
        return float("inf")
    mean = float((weights * distances).sum()) / total
    return float(np.sqrt((weights * (distances - mean) ** 2).sum() / total)) / mean


def shape_of(V: Floats, topology: Topology, wanted: Wanted = ALL) -> Shape:
    """Measure positions (n, 3) over a connectivity.

    Sums run over all faces, or edges; what is summed is computed block by block.
    """
    U, F = np.asfortranarray(V), topology.faces
    areas, moments = _areas(U, F)
    area = float(areas.sum())
    centroid = np.asarray(moments.sum(axis=0) / (3 * area) if area else V.mean(axis=0))
    del moments
    spokes = U - centroid
    volumes = _volumes(spokes, F)
    return Shape(
        area=area,
        volume=float(volumes.sum() / 6),
        centroid=centroid,
        mean_edge=float(_lengths(U, topology.edges).mean()) if wanted.edges else math.nan,
        radius_variation=radius_variation(V, centroid, measures.sum_at_vertices(areas, F, len(V)) / 3),
        outward=bool(volumes.min(initial=math.inf) > SURELY * max(-spokes.min(), spokes.max()) ** 3),
        least_area=float(areas.min() / areas.mean()) if area else 0.0,
    )


def _areas(V: Floats, F: Ints) -> tuple[Floats, Floats]:
    """(m,) areas of faces, and (m, 3) each as often as the sum of its corners."""
    areas, moments = np.empty(len(F)), np.empty((len(F), 3), order="F")
    for part in measures.blocks(len(F)):
        a, b, c = (measures.gather(V, F[part, k]) for k in range(3))
        moment = moments[part]
        np.add(a, b, out=moment)
        moment += c
        b -= a
        c -= a
        vectors = measures.cross(b, c)
        vectors *= 0.5
        areas[part] = measures.norm(vectors)
        moment *= areas[part, None]
    return areas, moments


def _volumes(spokes: Floats, F: Ints) -> Floats:
    """(m,) six times the signed volume of the cone over each face from where the ``spokes`` (n, 3) begin."""
    volumes = np.empty(len(F))
    for part in measures.blocks(len(F)):
        a, b, c = (measures.gather(spokes, F[part, k]) for k in range(3))
        volumes[part] = measures.dot(a, measures.cross(b, c))
    return volumes


def _lengths(V: Floats, edges: Ints) -> Floats:
    """(e,) lengths of ``edges`` (e, 2)."""
    lengths = np.empty(len(edges))
    for part in measures.blocks(len(edges)):
        lengths[part] = measures.edge_lengths(V, edges[part])
    return lengths
