"""How much a stranger's file may cost."""

from __future__ import annotations

from dataclasses import dataclass

MIB = 1024 * 1024


@dataclass(frozen=True, slots=True)
class ReadLimits:
    """Bounds on one reading.

    Materials, textures, normals and animations are never read, so that any number of them costs nothing.

    Attributes:
        max_vertices: vertices in the file.
        max_faces: triangles, polygons counted as the triangles they fall into.
        max_primitives: drawing primitives of a GLB, points and lines counted too, or placed objects of a 3MF.
        max_nodes: nodes in the tree of a GLB's scene, whether or not they draw anything.
        max_unpacked_bytes: of the parts of a 3MF, counted while unpacking.
        seconds: wall clock of the reading process for an empty file.
        seconds_per_mib: added for each MiB of the file.
        memory_bytes: address space of the reading process for an empty file.
        memory_per_byte: added for each byte of the file.

    """

    max_vertices: int = 2_000_000
    max_faces: int = 4_000_000
    max_primitives: int = 4_096
    max_nodes: int = 65_536
    max_unpacked_bytes: int = 512 * MIB
    seconds: float = 7.0
    seconds_per_mib: float = 1.0
    memory_bytes: int = 1_280 * MIB
    memory_per_byte: int = 24

    def seconds_for(self, size: int) -> float:
        """Return the wall clock in seconds that a file of ``size`` bytes is given."""
        return self.seconds + self.seconds_per_mib * size / MIB

    def memory_for(self, size: int) -> int:
        """Return the address space in bytes that a file of ``size`` bytes is given."""
        return self.memory_bytes + self.memory_per_byte * size
