"""GLB, the binary form of glTF 2.0: the triangles of its scene, each node in its place.

Materials, textures, normals, skins and animations are passed over; nothing outside the file is ever opened.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np

from spherify.formats.errors import FormatError, TooLargeError, UnreadableError
from spherify.formats.limits import ReadLimits
from spherify.formats.raw import RawMesh
from spherify.formats.readers.gltf_accessors import Accessors, item, matrix
from spherify.formats.readers.placed import IDENTITY, Scene
from spherify.geometry.mesh import Floats, Ints

_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_COMPRESSED: Final = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")


def read_glb(data: bytes, limits: ReadLimits) -> RawMesh:
    """Read GLB; raises `UnreadableError`."""
    description, binary = _chunks(data)
    try:
        return _scene(description, Accessors(description, binary), limits)
    except FormatError:
        raise
    except (AttributeError, KeyError, TypeError, ValueError, OverflowError) as error:
        # The description is a stranger's JSON: any part of it may be of any type.
        raise UnreadableError(
            f"The JSON description of the GLB is not as glTF 2.0 has it ({type(error).__name__}). Export again."
        ) from error


def _chunks(data: bytes) -> tuple[Mapping[str, Any], bytes]:
    if len(data) < 20:
        raise UnreadableError("The GLB ends inside its header: it is cut off. Export or upload it again.")
    _, version, total, length, kind = struct.unpack_from("<4sIII4s", data)
    if version != 2:
        raise UnreadableError(
            f"The GLB is of version {version}; only version 2 is read. Export it as glTF 2.0."
        )
    if total > len(data) or 20 + length > len(data) or kind != b"JSON":
        raise UnreadableError(
            f"The GLB says it has {total:,} bytes, but {len(data):,} are there: it is cut off or damaged. Export or "
            "upload it again."
        )
    try:
        description = json.loads(data[20 : 20 + length])
    except (ValueError, RecursionError) as error:
        raise UnreadableError(
            "The JSON description of the GLB cannot be read. Export the mesh again."
        ) from error
    if not isinstance(description, dict):
        raise UnreadableError("The JSON description of the GLB is no object. Export the mesh again.")
    binary = b""
    at = 20 + length
    while at + 8 <= len(data):
        length, kind = struct.unpack_from("<I4s", data, at)
        if kind == b"BIN\0":
            binary = data[at + 8 : at + 8 + length]
            break
        at += 8 + length
    return description, binary


def _scene(description: Mapping[str, Any], accessors: Accessors, limits: ReadLimits) -> RawMesh:
    compressed = set(description.get("extensionsRequired", ())) & set(_COMPRESSED)
    if compressed:
        raise UnreadableError(f"The GLB is compressed with {min(compressed)}. Export it without compression.")
    scene = Scene(limits)
    for primitive, place in _primitives(description, limits):
        faces_of = _FACES.get(primitive.get("mode", _TRIANGLES))
        if faces_of is None:
            continue  # points and lines
        vertices = accessors.read(primitive["attributes"]["POSITION"], "VEC3", limits.max_vertices)
        if "indices" in primitive:
            corners = accessors.read(primitive["indices"], "SCALAR", 3 * limits.max_faces)[:, 0].astype(
                np.int64
            )
        else:
            corners = np.arange(len(vertices), dtype=np.int64)
        scene.place(vertices.astype(np.float64), faces_of(corners), place)
    return scene.mesh()


def _primitives(
    description: Mapping[str, Any], limits: ReadLimits
) -> Iterator[tuple[Mapping[str, Any], Floats]]:
    """Yield what the scene draws, each with its matrix; counted here, since many nodes may name one mesh of many."""
    drawn = 0
    for node, place in _nodes(description, limits):
        if "mesh" not in node:
            continue
        for primitive in item(description.get("meshes"), node["mesh"], "mesh")["primitives"]:
            drawn += 1
            if drawn > limits.max_primitives:
                raise TooLargeError(
                    f"The GLB draws more than {limits.max_primitives:,} parts. Join them into one body first."
                )
            yield primitive, place


def _nodes(description: Mapping[str, Any], limits: ReadLimits) -> Iterator[tuple[Mapping[str, Any], Floats]]:
    """Yield the nodes of the scene shown, each with its matrix; every node at most once, as the tree has it."""
    nodes = description.get("nodes", [])
    if description.get("scenes"):
        roots = item(description["scenes"], description.get("scene", 0), "scene").get("nodes", [])
    else:
        children = {child for node in nodes for child in node.get("children", ())}
        roots = [index for index in range(len(nodes)) if index not in children]
    waiting = [(root, IDENTITY) for root in reversed(roots)]
    seen = set()
    while waiting:
        index, above = waiting.pop()
        if index in seen:
            raise UnreadableError(f"Node {index} of the GLB hangs in two places. Export the mesh again.")
        seen.add(index)
        if len(seen) > limits.max_nodes:  # each costs a product of matrices
            raise TooLargeError(
                f"The scene of the GLB has more than {limits.max_nodes:,} nodes. Join its parts into one body first."
            )
        node = item(nodes, index, "node")
        own = matrix(node)
        place = own if above is IDENTITY else above @ own
        yield node, place
        waiting.extend((child, place) for child in reversed(node.get("children", ())))


def _triangles(corners: Ints) -> Ints:
    if len(corners) % 3:
        raise UnreadableError(
            f"A part of the GLB has {len(corners)} corners, not 3 a triangle. Export again."
        )
    return corners.reshape(-1, 3)


def _strip(corners: Ints) -> Ints:
    a, b, c = corners[:-2], corners[1:-1], corners[2:]
    odd = np.arange(len(a)) % 2 == 1
    return np.stack([np.where(odd, b, a), np.where(odd, a, b), c], axis=1)


def _fan(corners: Ints) -> Ints:
    b, c = corners[1:-1], corners[2:]
    return np.stack([np.broadcast_to(corners[:1], b.shape), b, c], axis=1)


_FACES: Final = {_TRIANGLES: _triangles, _STRIP: _strip, _FAN: _fan}
