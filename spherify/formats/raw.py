"""Vertices and triangles as a file states them, before anything is mended or judged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spherify.formats.errors import TooLargeError, UnreadableError
from spherify.formats.limits import ReadLimits
from spherify.formats.report import Repair, counted
from spherify.geometry.mesh import Floats, Ints


@dataclass(frozen=True, eq=False, slots=True)
class RawMesh:
    """What a reader returns.

    Attributes:
        vertices: (n, 3) float64, in the file's order; finite or not.
        faces: (m, 3) int64 indices; each within 0 … n - 1, which the reader has seen to.
        repairs: what the reader had to do on the way (polygons cut into triangles, say).

    """

    vertices: Floats
    faces: Ints
    repairs: tuple[Repair, ...] = ()


def fans(lengths: Ints, corners: Ints) -> tuple[Ints, tuple[Repair, ...]]:
    """Cut polygons into triangles that share the polygon's first corner.

    Args:
        lengths: (p,) corners of each polygon; those with fewer than 3 are left out.
        corners: (Σ lengths,) their vertex indices, one polygon after the other.

    Returns:
        (m, 3) triangles in the order of the polygons, and what is to be reported.

    """
    if (lengths == 3).all():  # nearly every file
        return corners.reshape(-1, 3).astype(np.int64, copy=False), ()
    starts = np.cumsum(lengths) - lengths
    triangles = np.maximum(lengths - 2, 0)
    owner = np.repeat(np.arange(len(lengths)), triangles)
    step = np.arange(len(owner)) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    first = starts[owner]
    faces = np.stack([corners[first], corners[first + 1 + step], corners[first + 2 + step]], axis=1)
    repairs = []
    if polygons := int((lengths > 3).sum()):
        repairs.append(
            Repair(
                "triangulated",
                polygons,
                f"{counted(polygons, 'face of more than 3 corners was', 'faces of more than 3 corners were')} cut into "
                "triangles",
            )
        )
    if short := int((lengths < 3).sum()):
        what = counted(short, "face of fewer than 3 corners was", "faces of fewer than 3 corners were")
        repairs.append(Repair("short-faces", short, f"{what} left out"))
    return faces.astype(np.int64, copy=False), tuple(repairs)


def check_counts(vertices: int, triangles: int, limits: ReadLimits) -> None:
    """Raise `TooLargeError` when there are more vertices or triangles than the limits let in."""
    for count, most, what in (
        (vertices, limits.max_vertices, "vertices"),
        (triangles, limits.max_faces, "triangles"),
    ):
        if count > most:
            raise TooLargeError(
                f"The mesh has {count:,} {what} or more; at most {most:,} are taken. Decimate it first."
            )


def check_claim(claimed: int, what: str, least_bytes: int, available: int) -> None:
    """Raise `UnreadableError` when a header claims more than the bytes behind it can hold."""
    if claimed < 0:
        raise UnreadableError(
            f"The header claims {claimed:,} {what}, which cannot be. Export the mesh again."
        )
    if claimed * least_bytes > available:
        raise UnreadableError(
            f"The header claims {claimed:,} {what}, which take {claimed * least_bytes:,} bytes or more, but only "
            f"{available:,} follow: the file is cut off or damaged. Export or upload it again."
        )
