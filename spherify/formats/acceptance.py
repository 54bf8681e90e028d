"""From bytes to a judged mesh, in one process: sniff, read, mend, judge, orient, measure.

`spherify.formats.reading` runs it in a child process with limits; nothing else should run it on a stranger's file.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from importlib import import_module
from typing import Final

import numpy as np

from spherify.formats.errors import MeshRefusedError, UnreadableError
from spherify.formats.judge import defects, unforgiven
from spherify.formats.limits import ReadLimits
from spherify.formats.measure import enclosed_volume, report
from spherify.formats.raw import RawMesh
from spherify.formats.repair import draft, largest_component, turned_outward
from spherify.formats.report import Defect, MeshReport, counted
from spherify.formats.sniff import agreed_format
from spherify.geometry.mesh import Floats, TriangleMesh

Reader = Callable[[bytes, ReadLimits], RawMesh]

_READERS: Final = {
    "obj": ("obj", "read_obj"),
    "ply": ("ply", "read_ply"),
    "stl": ("stl", "read_stl"),
    "off": ("off", "read_off"),
    "glb": ("glb", "read_glb"),
    "3mf": ("threemf", "read_3mf"),
}

# Areas to the third and volumes to the second power stay well inside float64 (1e±308) between these sizes.
LEAST_SIZE: Final = 1e-30
GREATEST_SIZE: Final = 1e30
# Beyond this many sizes from the origin, float64 leaves a mesh fewer than some 5 digits.
GREATEST_DISTANCE: Final = 1e10
_FLAT: Final = 1e-6  # sphericity; a sheet a millionth as thick as it is wide has about 1e-4


@dataclass(frozen=True, eq=False, slots=True)
class ReadMesh:
    """An accepted mesh and what was found out about it."""

    mesh: TriangleMesh
    report: MeshReport


def read(data: bytes, mesh_format: str, limits: ReadLimits) -> RawMesh:
    """Return what a file of one format states, looked at no further; raises `UnreadableError`."""
    module, function = _READERS[mesh_format]
    reader: Reader = getattr(import_module(f"spherify.formats.readers.{module}"), function)
    with np.errstate(invalid="ignore"):  # of NaNs that signal; what is no finite number is refused below
        return reader(data, limits)


def _check_surface(raw: RawMesh) -> None:
    """Raise `UnreadableError` unless there are faces over vertices that can be reckoned with."""
    if not len(raw.faces):
        found = (
            f"no faces, only {len(raw.vertices):,} points" if len(raw.vertices) else "no faces and no points"
        )
        raise UnreadableError(
            f"The file has {found}. Export the surface as triangles; a point cloud needs a surface "
            "reconstruction first."
        )
    used = np.zeros(len(raw.vertices), dtype=bool)
    used[raw.faces] = True
    _check_coordinates(raw.vertices, np.flatnonzero(used))


def accept(data: bytes, name: str, allow: Collection[str], limits: ReadLimits) -> ReadMesh:
    """Turn a file's bytes into a mesh that can be morphed.

    Raises:
        UnreadableError: there are no vertices and triangles in it.
        MeshRefusedError: there are, but with a defect that ``allow`` does not let through.

    """
    mesh_format = agreed_format(data, name)
    raw = read(data, mesh_format, limits)
    _check_surface(raw)
    mesh = draft(raw)
    if not len(mesh.faces):
        raise UnreadableError("No face of the file names three different vertices. Export the mesh again.")
    if "components" in allow:
        mesh = largest_component(mesh)
    found = defects(mesh)
    two_sided = not len(mesh.topology.nonmanifold_edges) and not len(mesh.topology.misoriented_edges)
    if two_sided and enclosed_volume(mesh) < 0:
        mesh = turned_outward(mesh)
    problems = unforgiven(found, allow)
    figures = report(mesh, mesh_format, found, allow, eligible=not problems)
    if not problems and not figures.boundary_edges and figures.sphericity < _FLAT:
        problems = (_flat(),)
        figures = report(mesh, mesh_format, (*found, *problems), allow, eligible=False)
    if problems:
        raise MeshRefusedError(problems[0].code, _sentence(problems), problems, figures)
    return ReadMesh(TriangleMesh.checked(mesh.vertices, mesh.faces), figures)


def _flat() -> Defect:
    return Defect(
        "mesh-not-closed",
        "The mesh encloses no volume: it is flat, or its parts cancel out. Export a solid body.",
    )


def _sentence(problems: tuple[Defect, ...]) -> str:
    """Say the first problem, then the others."""
    return " ".join([problems[0].detail, *(f"Also: {problem.detail}" for problem in problems[1:])])


def _check_coordinates(vertices: Floats, used: np.ndarray) -> None:
    """Raise `UnreadableError` unless the vertices in use are finite and of a size that can be reckoned with."""
    points = vertices[used]
    finite = np.isfinite(points).all(axis=1)
    if not finite.all():
        first = int(used[np.argmin(finite)])
        raise UnreadableError(
            f"{counted(int((~finite).sum()), 'vertex has', 'vertices have')} a coordinate that is not a finite number, "
            f"the first is vertex {first} (from 0). Remove or mend them."
        )
    furthest = float(np.abs(points).max())
    size = float((points.max(axis=0) - points.min(axis=0)).max()) if furthest <= GREATEST_SIZE else furthest
    if not LEAST_SIZE <= size <= GREATEST_SIZE:
        raise UnreadableError(
            f"The mesh is {size:.3g} units in size, and only {LEAST_SIZE:g} to {GREATEST_SIZE:g} can be reckoned with. "
            "Scale it, to a size of 1 say."
        )
    if furthest > GREATEST_DISTANCE * size:
        raise UnreadableError(
            f"The mesh is {size:.3g} units in size but lies {furthest:.3g} units from the origin, where its "
            "coordinates have too few digits left. Move it to the origin before you export it."
        )
