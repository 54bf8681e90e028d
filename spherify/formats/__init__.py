"""Bytes to triangle meshes and back: OBJ, PLY, STL, OFF, GLB and 3MF in; all but 3MF out."""

from spherify.formats.acceptance import ReadMesh
from spherify.formats.errors import FormatError, InvalidExportError, MeshRefusedError
from spherify.formats.limits import ReadLimits
from spherify.formats.names import FORMATS_IN, FORMATS_OUT, media_type, safe_name, safe_stem
from spherify.formats.reading import read_mesh
from spherify.formats.report import ALLOW, Defect, Location, MeshReport, Repair, check_allow
from spherify.formats.writing import COLOURED, write_mesh

__all__ = [
    "ALLOW",
    "COLOURED",
    "FORMATS_IN",
    "FORMATS_OUT",
    "Defect",
    "FormatError",
    "InvalidExportError",
    "Location",
    "MeshRefusedError",
    "MeshReport",
    "ReadLimits",
    "ReadMesh",
    "Repair",
    "check_allow",
    "media_type",
    "read_mesh",
    "safe_name",
    "safe_stem",
    "write_mesh",
]
