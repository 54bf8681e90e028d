"""The judgement: which defects a mesh has, where the first of each lies, and what to do about it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from typing import Final

import numpy as np

from spherify.formats.codes import ProblemCode
from spherify.formats.repair import Draft
from spherify.formats.report import Defect, Location, Point, Switch, counted
from spherify.geometry.mesh import Ints
from spherify.geometry.topology import connected_labels

MAX_LOCATIONS: Final = 500  # of one defect that are listed: enough to draw the rim of a hole
_SWITCHES: Final[dict[ProblemCode, Switch]] = {
    "mesh-genus": "genus",
    "mesh-not-closed": "boundary",
    "mesh-not-connected": "components",
}


def switch_for(defect: Defect) -> Switch | None:
    """Return the switch that lets a defect through, None if there is none."""
    if defect.code == "mesh-not-manifold" and defect.locations and defect.locations[0].kind == "vertex":
        return "nonmanifold-vertex"
    if defect.code == "mesh-not-closed" and not defect.locations:
        return None  # too few faces, or no volume: that is no boundary
    return _SWITCHES.get(defect.code)


def defects(mesh: Draft) -> tuple[Defect, ...]:
    """Return what is wrong, the worst first: what can never be let through, then what a switch can."""
    return tuple(defect for check in _CHECKS for defect in check(mesh))


def _too_few_faces(mesh: Draft) -> Iterator[Defect]:
    if len(mesh.faces) < 4:
        yield Defect(
            "mesh-not-closed",
            f"The mesh has {counted(len(mesh.faces), 'face', 'faces')}, and a closed one has at least 4. "
            "Export the whole surface.",
        )


def _nonmanifold_edges(mesh: Draft) -> Iterator[Defect]:
    edges = mesh.topology.nonmanifold_edges
    if len(edges):
        places = _edges(mesh, edges)
        yield Defect(
            "mesh-not-manifold",
            f"{counted(len(edges), 'edge has', 'edges have')} more than two faces, the first "
            f"{_at(places[0])} has {mesh.topology.face_count[edges[0]]}. Remove inner walls and doubled faces "
            "(in MeshLab: Repair Non Manifold Edges).",
            locations=places,
        )


def _misoriented(mesh: Draft) -> Iterator[Defect]:
    edges = mesh.topology.misoriented_edges
    if not len(edges):
        return
    places = _edges(mesh, edges)
    across = counted(len(edges), "edge", "edges")
    problem = f"The winding of the faces changes across {across}, the first {_at(places[0])}"
    if is_orientable(mesh):
        cure = "Turn the faces that look the wrong way (in MeshLab: Re-Orient All Faces Coherently)."
    else:
        cure = "The surface has one side only, as a Möbius band has, so no turning mends it: cut it open or rebuild it."
    yield Defect("mesh-not-oriented", f"{problem}. {cure}", locations=places)


def is_orientable(mesh: Draft) -> bool:
    """Whether turning some faces would make all agree; edges with more than two faces are not asked.

    Each face stands for two nodes, as it is and turned round; neighbours that agree join like with like, others
    like with turned. The surface has two sides unless a face hangs together with its own turned self.
    """
    topology, m = mesh.topology, len(mesh.faces)
    paired = topology.face_count == 2
    faces = (topology.halfedges[np.repeat(paired, topology.face_count)] // 3).reshape(-1, 2)
    agree = topology.interior[paired]
    one, other = faces[:, 0], faces[:, 1]
    same = np.where(agree, other, other + m)
    turned = np.where(agree, other + m, other)
    labels = connected_labels(
        2 * m, np.concatenate([np.stack([one, same], 1), np.stack([one + m, turned], 1)])
    )
    return not bool((labels[:m] == labels[m:]).any())


def _open(mesh: Draft) -> Iterator[Defect]:
    edges = mesh.topology.boundary_edges
    if not len(edges):
        return
    places = _edges(mesh, edges)
    holes = mesh.topology.boundary_loops
    yield Defect(
        "mesh-not-closed",
        f"The mesh is not closed: {counted(len(edges), 'edge has', 'edges have')} one face only, around "
        f"{counted(holes, 'hole', 'holes')}, the first {_at(places[0])}. Fill the holes (in MeshLab: Close Holes), "
        "or allow boundary.",
        locations=places,
    )


def _several_components(mesh: Draft) -> Iterator[Defect]:
    count = mesh.topology.n_components
    if count < 2:
        return
    _, first_faces, sizes = np.unique(mesh.topology.face_components, return_index=True, return_counts=True)
    corners = mesh.faces[first_faces[:MAX_LOCATIONS], 0]
    places = tuple(Location("component", (int(mesh.origin[v]),), (_point(mesh, v),)) for v in corners)
    yield Defect(
        "mesh-not-connected",
        f"The mesh has {count} components, of {_listed(sizes)} faces, the second one {_at(places[1])}. Join them into "
        "one body or upload them one by one, or allow components to take the largest.",
        locations=places,
    )


def _nonmanifold_vertices(mesh: Draft) -> Iterator[Defect]:
    if len(mesh.topology.nonmanifold_edges):
        return  # they make their ends count twice, and have been named
    vertices = mesh.topology.nonmanifold_vertices
    if len(vertices):
        places = tuple(
            Location("vertex", (int(mesh.origin[v]),), (_point(mesh, v),)) for v in vertices[:MAX_LOCATIONS]
        )
        yield Defect(
            "mesh-not-manifold",
            f"{counted(len(vertices), 'vertex joins', 'vertices join')} parts that touch in nothing else, the first "
            f"{_at(places[0])}. Split such vertices (in MeshLab: Repair Non Manifold Vertices by Splitting), or allow "
            "nonmanifold-vertex.",
            locations=places,
        )


def _genus(mesh: Draft) -> Iterator[Defect]:
    genus = genus_of(mesh)
    if genus:
        yield Defect(
            "mesh-genus",
            f"The mesh has genus {genus}: {counted(genus, 'handle', 'handles')}, as a torus has one, so it cannot "
            "become a sphere. Fill its tunnels, or allow genus.",
        )


def genus_of(mesh: Draft) -> int | None:
    """Return the genus, None where edges with more than two faces or a lack of two sides leave it undefined."""
    if len(mesh.topology.nonmanifold_edges) or (
        len(mesh.topology.misoriented_edges) and not is_orientable(mesh)
    ):
        return None
    return mesh.topology.genus


_CHECKS: Final[tuple[Callable[[Draft], Iterator[Defect]], ...]] = (
    _too_few_faces,
    _nonmanifold_edges,
    _misoriented,
    _open,
    _several_components,
    _nonmanifold_vertices,
    _genus,
)


def unforgiven(found: Collection[Defect], allow: Collection[str]) -> tuple[Defect, ...]:
    """Return the defects that no switch in ``allow`` lets through."""
    return tuple(defect for defect in found if switch_for(defect) not in allow)


def _edges(mesh: Draft, edges: Ints) -> tuple[Location, ...]:
    ends = mesh.topology.edges[edges[:MAX_LOCATIONS]]
    return tuple(
        Location("edge", (int(mesh.origin[a]), int(mesh.origin[b])), (_point(mesh, a), _point(mesh, b)))
        for a, b in ends
    )


def _point(mesh: Draft, vertex: int) -> Point:
    x, y, z = map(float, mesh.vertices[vertex])
    return x, y, z


def _at(place: Location) -> str:
    """Say where a place is, vertices by their 0-based number in the file."""
    x, y, z = place.positions[0]
    where = f"({x:.6g}, {y:.6g}, {z:.6g})"
    if place.kind == "edge":
        return f"between vertices {place.indices[0]} and {place.indices[1]} (from 0) at {where}"
    return f"at vertex {place.indices[0]} (from 0) at {where}"


def _listed(sizes: Ints) -> str:
    shown = ", ".join(str(size) for size in sorted(sizes.tolist(), reverse=True)[:4])
    return shown + (", …" if len(sizes) > 4 else "")
