"""GLB 2.0, through trimesh: one mesh of one primitive, float32 positions and 32-bit indices."""

from __future__ import annotations

from typing import Any, Literal

from spherify.geometry.mesh import TriangleMesh


def glb(mesh: TriangleMesh, precision: Literal["double", "float"]) -> bytes:  # float32 always
    """Return GLB with the true bounds of the positions as they were rounded."""
    # Here, as importing it takes as long as reading a small mesh, and the process that reads never writes.
    from trimesh import Trimesh  # noqa: PLC0415
    from trimesh.exchange.gltf import export_glb  # noqa: PLC0415

    unprocessed = Trimesh(mesh.vertices, mesh.faces, process=False)  # keeps the order of vertices and faces
    exported: bytes = export_glb(  # type: ignore[no-untyped-call]  # trimesh leaves its exporters without types
        unprocessed, include_normals=False, tree_postprocessor=_sign
    )
    return exported


def _sign(tree: dict[str, Any]) -> None:
    tree["asset"]["generator"] = "Spherify"
