"""What is mended without asking, and always reported: unused vertices, unwelded seams, an inside-out surface."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from spherify.formats.raw import RawMesh
from spherify.formats.report import Repair, counted
from spherify.geometry.mesh import Floats, Ints
from spherify.geometry.topology import Topology


@dataclass(frozen=True, eq=False, slots=True)
class Draft:
    """A mesh on its way in.

    Attributes:
        vertices: (n, 3) positions.
        faces: (m, 3) vertex indices, no face naming a vertex twice.
        origin: (n,) the place of each vertex in the file.
        repairs: what was mended so far.
        topology: of ``faces``.

    """

    vertices: Floats
    faces: Ints
    origin: Ints
    repairs: tuple[Repair, ...]
    topology: Topology


def draft(raw: RawMesh) -> Draft:
    """Keep the file's own connectivity if it is closed; else merge vertices of equal position, if that mends any edge.

    Neither is right always: STL and GLB split vertices, and some closed meshes hold coincident vertices that must
    stay apart. Then drop the vertices in no face; the others keep their order.
    """
    own = _compact(raw.vertices, raw.faces, np.arange(len(raw.vertices)), raw.repairs)
    if own.topology.closed:
        return own
    merged = first_of_equals(own.vertices)
    count = int((merged != np.arange(len(merged))).sum())
    if not count:
        return own
    merging = counted(
        count,
        "vertex at the position of an earlier one was",
        "vertices at the position of an earlier one were",
    )
    repair = Repair("welded", count, f"{merging} merged with it")
    welded = _compact(
        own.vertices, merged[own.faces], own.origin, own.repairs, note_unused=False, also=repair
    )
    return welded if _defective_edges(welded) < _defective_edges(own) else own


def first_of_equals(points: Floats) -> Ints:
    """Return for each of (n, 3) points the index of the first point at exactly the same position."""
    points = points + 0.0  # -0 is 0
    order = np.lexsort((points[:, 2], points[:, 1], points[:, 0]))
    ordered = points[order]
    new = np.ones(len(points), dtype=bool)
    new[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    first = np.empty(len(points), dtype=np.int64)
    first[order] = order[np.flatnonzero(new)][np.cumsum(new) - 1]  # lexsort is stable: the least index leads
    return first


def largest_component(mesh: Draft) -> Draft:
    """Keep the component with the most faces, the first of equals."""
    labels = mesh.topology.face_components
    sizes = np.bincount(labels)
    if len(sizes) < 2:
        return mesh
    kept = int(np.argmax(sizes))
    repair = Repair(
        "components-left-out",
        len(sizes) - 1,
        f"{counted(len(sizes) - 1, 'smaller component', 'smaller components')} with "
        f"{counted(int(sizes.sum() - sizes[kept]), 'face', 'faces')} {'was' if len(sizes) == 2 else 'were'} left out",
    )
    faces = mesh.faces[labels == kept]
    return _compact(mesh.vertices, faces, mesh.origin, mesh.repairs, note_unused=False, also=repair)


def turned_outward(mesh: Draft) -> Draft:
    """Turn every face round."""
    repair = Repair("turned-outward", len(mesh.faces), "the faces looked inward, and were all turned round")
    faces = mesh.faces[:, [0, 2, 1]]
    topology = Topology.of(len(mesh.vertices), faces)
    return replace(mesh, faces=faces, topology=topology, repairs=(*mesh.repairs, repair))


def _defective_edges(mesh: Draft) -> int:
    return int((mesh.topology.face_count != 2).sum())


def _compact(
    vertices: Floats,
    faces: Ints,
    origin: Ints,
    repairs: tuple[Repair, ...],
    *,
    note_unused: bool = True,
    also: Repair | None = None,
) -> Draft:
    """Drop faces that name a vertex twice, and vertices in no face."""
    if also is not None:
        repairs = (*repairs, also)
    twice = (faces[:, 0] == faces[:, 1]) | (faces[:, 1] == faces[:, 2]) | (faces[:, 2] == faces[:, 0])
    if collapsed := int(twice.sum()):
        faces = faces[~twice]
        repairs = (
            *repairs,
            Repair(
                "collapsed-faces",
                collapsed,
                f"{counted(collapsed, 'face that named a vertex twice was', 'faces that named a vertex twice were')} "
                "left out",
            ),
        )
    used = np.zeros(len(vertices), dtype=bool)
    used[faces.reshape(-1)] = True
    if unused := int(len(used) - used.sum()):
        if note_unused:
            repairs = (
                *repairs,
                Repair(
                    "unused-vertices",
                    unused,
                    f"{counted(unused, 'vertex in no face was', 'vertices in no face were')} left out; the others keep "
                    "their order",
                ),
            )
        renumbered = np.cumsum(used) - 1
        vertices, faces, origin = vertices[used], renumbered[faces], origin[used]
    return Draft(vertices, faces, origin, repairs, Topology.of(len(vertices), faces))
