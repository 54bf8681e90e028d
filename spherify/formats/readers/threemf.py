"""3MF: a ZIP archive of XML models.

It is unpacked and parsed as a stream, and what is unpacked is counted while it is, so that neither a part nor its tree
is ever held whole. 3MF core specification 1.3: objects hold a mesh or components; the build places objects. Of the
production extension: the path by which a component or item names an object of another model in the same archive.
"""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

from spherify.formats.errors import TooLargeError, UnreadableError
from spherify.formats.limits import MIB, ReadLimits
from spherify.formats.raw import RawMesh
from spherify.formats.readers.placed import Scene
from spherify.formats.readers.threemf_model import Model, parse_model, root_part
from spherify.geometry.mesh import Floats

_CHUNK = MIB // 4
_DEPTH = 32  # of components in components
_RELATIONS = "_rels/.rels"
_USUAL_ROOT = "3d/3dmodel.model"


def read_3mf(data: bytes, limits: ReadLimits) -> RawMesh:
    """Read 3MF; raises `UnreadableError`."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            package = _Package(archive, limits)
            return package.read()
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, OSError) as error:
        # RuntimeError is zipfile's word for an encrypted part.
        raise UnreadableError(
            f"The ZIP archive of the 3MF cannot be unpacked ({error}). Export it again."
        ) from error


@dataclass(frozen=True, slots=True)
class _Place:
    """An object of a model, where it is put, and how deep in components."""

    part: str
    object_id: str
    matrix: Floats
    depth: int


class _Package:
    """The parts of one archive; each model is parsed at most once."""

    def __init__(self, archive: zipfile.ZipFile, limits: ReadLimits) -> None:
        self._archive = archive
        self._limits = limits
        self._names = {info.filename.lstrip("/").lower(): info for info in archive.infolist()}
        self._models: dict[str, Model] = {}
        self._unpacked = 0

    def read(self) -> RawMesh:
        root = self._root()
        scene = Scene(self._limits)
        items = self._model(root).items
        waiting = [
            _Place(_key(item.path) or root, item.object_id, item.matrix, 0) for item in reversed(items)
        ]
        placed = 0
        while waiting:
            place = waiting.pop()
            placed += 1
            if placed > self._limits.max_primitives or place.depth > _DEPTH:
                raise TooLargeError(
                    f"The 3MF places more than {self._limits.max_primitives:,} parts, or components more than {_DEPTH} "
                    "deep. Join them into one body first."
                )
            body = self._model(place.part).objects.get(place.object_id)
            if body is None:
                raise UnreadableError(
                    f"The 3MF places object {place.object_id[:40]!r}, which is not there. Export it again."
                )
            if body.triangles:
                scene.place(body.vertex_array(), body.triangle_array(), place.matrix)
            waiting.extend(
                _Place(_key(c.path) or place.part, c.object_id, place.matrix @ c.matrix, place.depth + 1)
                for c in reversed(body.components)
            )
        return scene.mesh()

    def _root(self) -> str:
        """Return the model the archive starts with."""
        named = None
        if _RELATIONS in self._names:
            named = _key(root_part(self._chunks(_RELATIONS)))
        root = named or _USUAL_ROOT
        if root not in self._names:
            raise UnreadableError(
                "The ZIP archive holds no 3D model, so it is no 3MF. Unpack it and use the mesh inside.",
                "unsupported-mesh-format",
            )
        return root

    def _model(self, part: str) -> Model:
        if part not in self._models:
            if part not in self._names:
                raise UnreadableError(
                    f"The 3MF names a part {part[:60]!r}, which is not there. Export it again."
                )
            self._models[part] = parse_model(self._chunks(part), self._limits)
        return self._models[part]

    def _chunks(self, part: str) -> Iterator[bytes]:
        """Yield a part's bytes; raises `TooLargeError` once all parts together pass the limit."""
        info = self._names[part]
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise UnreadableError("The 3MF is packed in a way that is not deflate. Export it again.")
        with self._archive.open(info) as file:
            while chunk := file.read(_CHUNK):
                self._unpacked += len(chunk)
                if self._unpacked > self._limits.max_unpacked_bytes:
                    raise TooLargeError(
                        f"The 3MF unpacks to more than {self._limits.max_unpacked_bytes // MIB} MiB. Decimate the mesh."
                    )
                yield chunk


def _key(path: str | None) -> str | None:
    """Return a part's name as archives are searched for it: without the leading slash, in lower case."""
    return path.lstrip("/").lower() if path else None
