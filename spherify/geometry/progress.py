"""Where a run is: everything its next iteration depends on, and the same as named arrays for a file."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from spherify.geometry.config import Config
from spherify.geometry.errors import InvalidCheckpointError
from spherify.geometry.mesh import Floats, TriangleMesh
from spherify.geometry.roundness import Shape

VERSION: Final = 6  # of the form of a state; what computes is told by SOURCES


def digest_of(package: Traversable) -> str:
    """Return the SHA-256 of the names and contents of all sources in a folder, hexadecimal."""
    digest = hashlib.sha256()
    for name, content in _sources(package):
        digest.update(f"{name}:{len(content)}\n".encode())
        digest.update(content)
    return digest.hexdigest()


def _sources(folder: Traversable, above: str = "") -> Iterator[tuple[str, bytes]]:
    """Yield path and content of each, in order; where they are installed compiled only, of what is in their place."""
    for entry in sorted(folder.iterdir(), key=lambda entry: entry.name):
        name = above + entry.name
        if entry.is_dir() and entry.name != "__pycache__":
            yield from _sources(entry, f"{name}/")
        elif name.endswith((".py", ".pyc")):
            yield name, entry.read_bytes()


SOURCES: Final = digest_of(files(__package__))
"""Of this package when it was loaded: nobody need remember to say that a change alters what is computed."""

Memory: TypeAlias = Mapping[
    str, NDArray[Any]
]  # what a method carries from one iteration to the next, by name
Layout: TypeAlias = Mapping[str, tuple[tuple[int, ...], type]]  # shape and type of each of these arrays


@dataclass(frozen=True, eq=False, slots=True)
class Progress:
    """The whole state of a run after ``iteration`` iterations. Positions and lengths are in the run's `Frame`.

    Attributes:
        iteration: iterations done.
        position: (n, 3) vertices.
        shape: of ``position``.
        memory: what the method itself goes on from.
        best_iteration: iterations done at the best valid state.
        best_position: (n, 3) its vertices.
        best_shape: its shape.
        broke_at: the iteration after which the mesh was no longer valid; None while it is.
        broke_how: what that iteration did, the beginning of a sentence.

    """

    iteration: int
    position: Floats
    shape: Shape
    memory: Memory
    best_iteration: int
    best_position: Floats
    best_shape: Shape
    broke_at: int | None = None
    broke_how: str = ""

    @classmethod
    def first(cls, position: Floats, shape: Shape, memory: Memory) -> Progress:
        """Return the state before the first iteration."""
        return cls(0, position, shape, memory, 0, position, shape)

    def broken(self, how: str) -> Progress:
        """Return the best state, noting that the iteration after this one broke the mesh, and how."""
        return replace(
            self,
            iteration=self.best_iteration,
            position=self.best_position,
            shape=self.best_shape,
            broke_at=self.iteration + 1,
            broke_how=how,
        )

    def arrays(self, fingerprint: NDArray[np.uint8]) -> dict[str, NDArray[Any]]:
        """Return the state as named arrays, bit by bit; `restored` is the way back."""
        counts = (self.iteration, self.best_iteration, -1 if self.broke_at is None else self.broke_at)
        return {
            "fingerprint": fingerprint,
            "position": self.position,
            "best_position": self.best_position,
            "counts": np.array(counts, dtype=np.int64),
            "shape": _shape_to_array(self.shape),
            "best_shape": _shape_to_array(self.best_shape),
            "broke_how": np.frombuffer(self.broke_how.encode(), dtype=np.uint8),
            **self.memory,
        }

    @classmethod
    def restored(
        cls, arrays: Mapping[str, NDArray[Any]], fingerprint: NDArray[np.uint8], n: int, layout: Layout
    ) -> Progress:
        """Read what `arrays` wrote, with a memory of this layout; further entries are ignored.

        Positions are laid out column by column again, as the run had them: sums depend on it in their last bit.

        Raises:
            InvalidCheckpointError: an array is missing or has the wrong shape or type, or the fingerprint is another.

        """
        wanted: dict[str, tuple[tuple[int, ...] | None, type]] = {
            "fingerprint": (fingerprint.shape, np.uint8),
            "position": ((n, 3), np.float64),
            "best_position": ((n, 3), np.float64),
            "counts": ((3,), np.int64),
            "shape": ((7,), np.float64),
            "best_shape": ((7,), np.float64),
            "broke_how": (None, np.uint8),
            **layout,
        }
        for name, (shape, kind) in wanted.items():
            array = arrays.get(name)
            if array is None:
                raise InvalidCheckpointError(f"the checkpoint has no array {name!r}")
            if name == "fingerprint" and not np.array_equal(array, fingerprint):
                raise InvalidCheckpointError(
                    "the checkpoint belongs to another mesh, other parameters, another engine or another version"
                )
            if array.dtype != kind or (shape is not None and array.shape != shape):
                raise InvalidCheckpointError(
                    f"array {name!r} of the checkpoint is {array.dtype} {array.shape}, not {kind.__name__} {shape}"
                )
        iteration, best_iteration, broke_at = (int(count) for count in arrays["counts"])
        return cls(
            iteration=iteration,
            position=np.asfortranarray(arrays["position"]),
            shape=_shape_from_array(arrays["shape"]),
            memory={name: np.asfortranarray(arrays[name]) for name in layout},
            best_iteration=best_iteration,
            best_position=np.asfortranarray(arrays["best_position"]),
            best_shape=_shape_from_array(arrays["best_shape"]),
            broke_at=None if broke_at < 0 else broke_at,
            broke_how=arrays["broke_how"].tobytes().decode(),
        )


def fingerprint_of(mesh: TriangleMesh, config: Config, computed_by: str) -> NDArray[np.uint8]:
    """(32,) SHA-256 of all that decides how a run goes on: mesh, parameters, and who computes, by which sources.

    The number of iterations is left out: a run may be extended from its last state.
    """
    parameters = asdict(config)
    del parameters["iterations"]
    digest = hashlib.sha256(
        json.dumps([VERSION, SOURCES, computed_by, _as_floats(parameters)], sort_keys=True).encode()
    )
    for array in (mesh.vertices, mesh.faces):
        digest.update(str(array.shape).encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return np.frombuffer(digest.digest(), dtype=np.uint8)


def _as_floats(value: object) -> object:
    """Write 1 and 1.0 alike: they are the same parameter."""
    if isinstance(value, dict):
        return {name: _as_floats(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_as_floats(entry) for entry in value]
    return float(value) if isinstance(value, int) else value


def _shape_to_array(shape: Shape) -> Floats:
    return np.array([shape.area, shape.volume, *shape.centroid, shape.mean_edge, shape.radius_variation])


def _shape_from_array(numbers: Floats) -> Shape:
    area, volume, mean_edge, variation = (float(numbers[k]) for k in (0, 1, 5, 6))
    return Shape(area, volume, numbers[2:5].copy(), mean_edge, variation)
