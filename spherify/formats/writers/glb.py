"""GLB 2.0, through trimesh: one mesh of one primitive, float32 positions and 32-bit indices."""

from __future__ import annotations

from typing import Any, Final, Literal

from spherify.formats.colours import VertexColours, linear_light
from spherify.geometry.mesh import TriangleMesh

_OWN: Final = (
    "_COLOR_0"  # trimesh writes colours as sRGB bytes, where glTF means linear light; this it lets through
)
_MATTE: Final = {"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.8}, "doubleSided": True}


def glb(
    mesh: TriangleMesh,
    precision: Literal["double", "float"],  # float32 always
    colours: VertexColours | None = None,
) -> bytes:
    """Return GLB with the true bounds of the positions as they were rounded, colours as COLOR_0 in float32."""
    # Here, as importing it takes as long as reading a small mesh, and the process that reads never writes.
    from trimesh import Trimesh  # noqa: PLC0415
    from trimesh.exchange.gltf import export_glb  # noqa: PLC0415

    unprocessed = Trimesh(mesh.vertices, mesh.faces, process=False)  # keeps the order of vertices and faces
    if colours is not None:
        unprocessed.vertex_attributes[_OWN] = linear_light(colours.rgb)

    def finish(tree: dict[str, Any]) -> None:
        tree["asset"]["generator"] = "Spherify"
        if colours is not None:
            (primitive,) = tree["meshes"][0]["primitives"]
            primitive["attributes"]["COLOR_0"] = primitive["attributes"].pop(_OWN)
            primitive["material"] = 0
            tree["materials"] = [_MATTE]  # the default one is a mirror, which hides the colours
            tree["asset"]["extras"] = {"note": colours.note}

    exported: bytes = export_glb(  # type: ignore[no-untyped-call]  # trimesh leaves its exporters without types
        unprocessed, include_normals=False, tree_postprocessor=finish
    )
    return exported
