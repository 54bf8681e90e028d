"""The XML of a 3MF model, parsed as a stream by expat; document types, and so entities, are refused."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Final
from xml.parsers import expat

import numpy as np

from spherify.formats.errors import TooLargeError, UnreadableError
from spherify.formats.limits import ReadLimits
from spherify.formats.raw import check_counts
from spherify.formats.readers.placed import IDENTITY
from spherify.geometry.mesh import Floats, Ints

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


class Model:
    """What one model part holds; fed with its elements in order."""

    def __init__(self, limits: ReadLimits) -> None:
        self.objects: dict[str, Body] = {}
        self.items: list[Reference] = []
        self._limits = limits
        self._n_vertices = 0
        self._n_triangles = 0
        self._n_references = 0
        self._handlers: dict[str, Callable[[Attributes], None]] = {
            "object": self._object,
            "component": self._component,
            "item": self._item,
        }
        self._enter(Body())

    def start(self, name: str, attributes: Attributes) -> None:
        """Take an element."""
        handler = self._handlers.get(name) or self._handlers.get(_local(name))
        if handler is not None:
            handler(attributes)

    def _enter(self, body: Body) -> None:
        """Let what follows fill a body; its arrays are bound here, as millions of elements go through these two."""
        self._current = body
        limits, add_positions, add_corners = self._limits, body.vertices.extend, body.triangles.extend

        def vertex(attributes: Attributes) -> None:
            self._n_vertices += 1
            if self._n_vertices > limits.max_vertices:
                check_counts(self._n_vertices, 0, limits)
            add_positions((float(attributes["x"]), float(attributes["y"]), float(attributes["z"])))

        def triangle(attributes: Attributes) -> None:
            self._n_triangles += 1
            if self._n_triangles > limits.max_faces:
                check_counts(0, self._n_triangles, limits)
            add_corners((int(attributes["v1"]), int(attributes["v2"]), int(attributes["v3"])))

        self._handlers["vertex"] = vertex
        self._handlers["triangle"] = triangle

    def _object(self, attributes: Attributes) -> None:
        body = self.objects[attributes["id"]] = Body()
        self._enter(body)

    def _component(self, attributes: Attributes) -> None:
        self._current.components.append(self._reference(attributes))

    def _item(self, attributes: Attributes) -> None:
        self.items.append(self._reference(attributes))

    def _reference(self, attributes: Attributes) -> Reference:
        self._n_references += 1
        if self._n_references > self._limits.max_primitives:  # a ZIP of a few kB holds millions
            raise TooLargeError(
                f"The 3MF places more than {self._limits.max_primitives:,} parts. Join them into one body first."
            )
        return _reference(attributes)


def _reference(attributes: Attributes) -> Reference:
    transform = attributes.get("transform")
    matrix = IDENTITY
    if transform:
        # Twelve numbers, row by row, of a matrix that acts on row vectors (core specification, section 3.3).
        matrix = np.eye(4)
        matrix[:3, :] = np.array(list(map(float, transform.split()))).reshape(4, 3).T
    path = next((value for name, value in attributes.items() if _local(name) == "path"), None)
    return Reference(attributes["objectid"], matrix, path)


def _local(name: str) -> str:
    """Return an XML name without its prefix."""
    return name.rpartition(":")[2]


def parse_model(chunks: Iterable[bytes], limits: ReadLimits) -> Model:
    """Parse a model part; raises `UnreadableError` naming the line."""
    model = Model(limits)
    _parse(chunks, model.start)
    return model


def root_part(chunks: Iterable[bytes]) -> str | None:
    """Return the part that the relations of a package name as its 3D model, None if there is none."""
    targets: list[str] = []

    def start(name: str, attributes: Attributes) -> None:
        if _local(name) == "Relationship" and attributes.get("Type") == _MODEL_RELATION:
            targets.append(attributes["Target"])

    _parse(chunks, start)
    return targets[0] if targets else None


def _parse(chunks: Iterable[bytes], start: Callable[[str, Attributes], None]) -> None:
    parser = expat.ParserCreate()
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
