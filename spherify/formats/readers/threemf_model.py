"""The XML of a 3MF model, parsed as a stream by expat; document types, and so entities, are refused."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Final
from xml.parsers import expat

import numpy as np

from spherify.formats.errors import UnreadableError
from spherify.formats.limits import ReadLimits
from spherify.formats.raw import check_counts
from spherify.formats.readers.placed import IDENTITY
from spherify.geometry.mesh import Floats, Ints

_SEPARATOR: Final = " "  # between the namespace and the name
_PATH: Final = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06 path"
_MODEL_RELATION: Final = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
_INDEX: Final = "q"  # array's code of a 64-bit integer

Attributes = dict[str, str]


@dataclass(frozen=True, slots=True)
class Reference:
    """A component or a build item: an object, where it is put, and the part it is in if that is another."""

    object_id: str
    matrix: Floats
    path: str | None


@dataclass(slots=True)
class Body:
    """An object: the mesh it holds, or the components it is made of."""

    vertices: array[float] = field(default_factory=lambda: array("d"))
    triangles: array[int] = field(default_factory=lambda: array(_INDEX))
    components: list[Reference] = field(default_factory=list)

    def vertex_array(self) -> Floats:
        """Return the positions, (n, 3)."""
        return np.array(self.vertices, dtype=np.float64).reshape(-1, 3)

    def triangle_array(self) -> Ints:
        """Return the triangles, (m, 3)."""
        return np.array(self.triangles, dtype=np.int64).reshape(-1, 3)


@dataclass
class Model:
    """What one model part holds."""

    limits: ReadLimits
    objects: dict[str, Body] = field(default_factory=dict)
    items: list[Reference] = field(default_factory=list)
    _current: Body = field(default_factory=Body)
    _n_vertices: int = 0
    _n_triangles: int = 0

    def start(self, name: str, attributes: Attributes) -> None:
        """Take an element."""
        handler = _HANDLERS.get(name.rpartition(_SEPARATOR)[2])
        if handler is not None:
            handler(self, attributes)

    def _vertex(self, attributes: Attributes) -> None:
        self._n_vertices += 1
        if self._n_vertices > self.limits.max_vertices:
            check_counts(self._n_vertices, 0, self.limits)
        self._current.vertices.extend(
            (float(attributes["x"]), float(attributes["y"]), float(attributes["z"]))
        )

    def _triangle(self, attributes: Attributes) -> None:
        self._n_triangles += 1
        if self._n_triangles > self.limits.max_faces:
            check_counts(0, self._n_triangles, self.limits)
        self._current.triangles.extend((int(attributes["v1"]), int(attributes["v2"]), int(attributes["v3"])))

    def _object(self, attributes: Attributes) -> None:
        self._current = self.objects[attributes["id"]] = Body()

    def _component(self, attributes: Attributes) -> None:
        self._current.components.append(_reference(attributes))

    def _item(self, attributes: Attributes) -> None:
        self.items.append(_reference(attributes))


_HANDLERS: Final[dict[str, Callable[[Model, Attributes], None]]] = {
    "vertex": Model._vertex,
    "triangle": Model._triangle,
    "object": Model._object,
    "component": Model._component,
    "item": Model._item,
}


def _reference(attributes: Attributes) -> Reference:
    transform = attributes.get("transform")
    matrix = IDENTITY
    if transform:
        # Twelve numbers, row by row, of a matrix that acts on row vectors (core specification, section 3.3).
        matrix = np.eye(4)
        matrix[:3, :] = np.array(list(map(float, transform.split()))).reshape(4, 3).T
    return Reference(attributes["objectid"], matrix, attributes.get(_PATH))


def parse_model(chunks: Iterable[bytes], limits: ReadLimits) -> Model:
    """Parse a model part; raises `UnreadableError` naming the line."""
    model = Model(limits)
    _parse(chunks, model.start)
    return model


def root_part(chunks: Iterable[bytes]) -> str | None:
    """Return the part that the relations of a package name as its 3D model, None if there is none."""
    targets: list[str] = []

    def start(name: str, attributes: Attributes) -> None:
        if name.endswith("Relationship") and attributes.get("Type") == _MODEL_RELATION:
            targets.append(attributes["Target"])

    _parse(chunks, start)
    return targets[0] if targets else None


def _parse(chunks: Iterable[bytes], start: Callable[[str, Attributes], None]) -> None:
    parser = expat.ParserCreate(namespace_separator=_SEPARATOR)
    parser.StartElementHandler = start
    parser.StartDoctypeDeclHandler = _refuse_doctype
    try:
        for chunk in chunks:
            parser.Parse(chunk, False)
        parser.Parse(b"", True)
    except UnreadableError:
        raise
    except expat.ExpatError as error:
        raise UnreadableError(
            f"The XML of the 3MF breaks off or is damaged: {error}. Export it again."
        ) from error
    except (KeyError, ValueError, OverflowError) as error:
        raise UnreadableError(
            f"Line {parser.CurrentLineNumber} of the 3MF model lacks a number or holds a wrong one ({error}). Export "
            "it again."
        ) from error


def _refuse_doctype(*_: object) -> None:
    raise UnreadableError("The XML of the 3MF declares a document type, which 3MF forbids. Export it again.")
