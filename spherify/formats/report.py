"""What is found out about a mesh: figures, what was mended, what is wrong."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Final, Literal

from spherify.formats.codes import ProblemCode, problem_code

Switch = Literal["genus", "boundary", "components", "nonmanifold-vertex"]
ALLOW: Final[tuple[Switch, ...]] = ("genus", "boundary", "components", "nonmanifold-vertex")

Point = tuple[float, float, float]


def check_allow(allow: Collection[str]) -> None:
    """Raise ValueError, with those there are, unless all are switches of `ALLOW`."""
    if unknown := set(allow) - set(ALLOW):
        raise ValueError(f"there is no switch {sorted(unknown)[0]!r}; choose from {', '.join(ALLOW)}")


def counted(count: int, one: str, many: str) -> str:
    """Return a number with the words that belong to it."""
    return f"{count} {one if count == 1 else many}"


@dataclass(frozen=True, slots=True)
class Location:
    """One place of a defect.

    Attributes:
        kind: what lies there.
        indices: vertices (of an edge, its two ends) by their 0-based place in the file; of a component, its
            first vertex.
        positions: where these vertices lie, in the unit of the file.

    """

    kind: Literal["vertex", "edge", "component"]
    indices: tuple[int, ...]
    positions: tuple[Point, ...]


@dataclass(frozen=True, slots=True)
class Defect:
    """Something that keeps a mesh from being morphed.

    Attributes:
        code: the problem it is.
        detail: one sentence: how many, where the first is, and the cure.
        pointer: JSON pointer to the parameter to blame, None for the file itself.
        locations: the first places, some hundreds at most.

    """

    code: ProblemCode
    detail: str
    pointer: str | None = None
    locations: tuple[Location, ...] = ()


@dataclass(frozen=True, slots=True)
class Repair:
    """Something that was mended on the way in: a code, how often, and a sentence."""

    code: str
    count: int
    detail: str


@dataclass(frozen=True, slots=True)
class MeshReport:
    """The figures of one mesh after repairs.

    Attributes:
        format: obj, ply, stl, off, glb or 3mf.
        vertices: number of vertices.
        faces: number of triangles.
        components: parts that share no vertex.
        genus: handles, summed over the surface's sheets; None where edges with more than two faces leave it
            undefined.
        euler: vertices - edges + faces.
        boundary_loops: holes.
        boundary_edges: edges with one face.
        degenerate_faces: triangles without area.
        bbox: the least and the greatest corner.
        area: total, in the file's unit squared.
        volume: enclosed and signed, positive if the faces look outward; of an open mesh about its centroid.
        sphericity: (36π V²)^⅓ / A, 1 for a sphere.
        mean_edge: mean length of the edges.
        least_quality: smallest 4√3·area/(a²+b²+c²), 1 for an equilateral triangle.
        eligible: whether it can be morphed under ``allowed``.
        allowed: the switches that were on.
        repairs: what was mended.
        defects: what is wrong, allowed or not.

    """

    format: str
    vertices: int
    faces: int
    components: int
    genus: int | None
    euler: int
    boundary_loops: int
    boundary_edges: int
    degenerate_faces: int
    bbox: tuple[Point, Point]
    area: float
    volume: float
    sphericity: float
    mean_edge: float
    least_quality: float
    eligible: bool
    allowed: tuple[str, ...]
    repairs: tuple[Repair, ...] = ()
    defects: tuple[Defect, ...] = ()

    def as_dict(self, *, most_locations: int | None = None) -> dict[str, Any]:
        """Return the report as JSON-ready objects, with so many places of each defect at most."""
        defects = tuple(
            replace(defect, locations=defect.locations[:most_locations]) for defect in self.defects
        )
        return asdict(replace(self, defects=defects))

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> MeshReport:
        """Rebuild a report from `as_dict`, also after a passage through JSON.

        Raises:
            KeyError, TypeError, ValueError: it is no report.

        """
        low, high = data["bbox"]
        return cls(
            **{
                **data,
                "bbox": (_point(low), _point(high)),
                "allowed": tuple(data["allowed"]),
                "repairs": tuple(Repair(**repair) for repair in data["repairs"]),
                "defects": tuple(defect_from_dict(defect) for defect in data["defects"]),
            }
        )


def defect_from_dict(data: Mapping[str, Any]) -> Defect:
    """Rebuild a defect from its JSON form; raises KeyError, TypeError, ValueError."""
    places = tuple(
        Location(place["kind"], tuple(map(int, place["indices"])), tuple(map(_point, place["positions"])))
        for place in data["locations"]
    )
    return Defect(problem_code(data["code"]), str(data["detail"]), data["pointer"], places)


def _point(values: Iterable[float]) -> Point:
    x, y, z = map(float, values)
    return x, y, z
