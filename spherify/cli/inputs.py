"""Meshes and parameters as they are written on the command line."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Final, TypeAlias

import typer
from pydantic import ValidationError

from spherify.cli.console import REFUSED, fail
from spherify.formats import MeshRefusedError, check_allow, read_mesh
from spherify.geometry.errors import InvalidConfigError
from spherify.geometry.mesh import TriangleMesh
from spherify.geometry.presets import PRESETS
from spherify.geometry.samples import SAMPLES
from spherify.parameters import PARAMETERS_OF, Parameters, chosen_preset, resolve
from spherify.settings import Settings

MethodOption: TypeAlias = Annotated[
    str | None,
    typer.Option(
        metavar="NAME", help="Method: curvature, conformal or mean-curvature; by default, the preset's."
    ),
]
PresetOption: TypeAlias = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        help="Preset: robust (the default), paper or paper-absolute; or conformal, mean-curvature.",
    ),
]
IterationsOption: TypeAlias = Annotated[
    int | None,
    typer.Option(metavar="N", help="Maximum number of iterations; by default, the preset's."),
]
AssignmentsOption: TypeAlias = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="Change one parameter; may be given several times."),
]
AllowOption: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        metavar="KIND",
        help="Accept meshes with: boundary, components, genus or nonmanifold-vertex; may be given several times.",
    ),
]
SAMPLE: Final = "sample:"
SAMPLE_VERTICES: Final = 3000
SAMPLE_MOST: Final = 1_000_000  # vertices; time and memory are one's own


def mesh_of(source: str, allow: list[str]) -> TriangleMesh:
    """Read a file, or build ``sample:NAME`` or ``sample:NAME:VERTICES``; ends the program if it cannot."""
    try:
        check_allow(allow)
    except ValueError as e:
        fail(f"--allow: {e}", REFUSED)
    if source.startswith(SAMPLE):
        return sample(source.removeprefix(SAMPLE))
    path = Path(source)
    try:
        with _file_of(path) as file:
            return read_mesh(file, path.name, allow=allow).mesh
    except MeshRefusedError as e:
        fail(f"{path.name}: {e}", REFUSED)
    except OSError as e:
        fail(f"{path} cannot be read: {e.strerror or e}", REFUSED)


@contextmanager
def _file_of(path: Path) -> Iterator[Path]:
    """Yield a file, of a pipe a copy: the process that reads it opens it by its path, and asks for its size."""
    if not path.is_fifo():
        yield path
        return
    with path.open("rb") as pipe, tempfile.NamedTemporaryFile(prefix="spherify-") as copy:
        shutil.copyfileobj(pipe, copy)
        copy.flush()
        yield Path(copy.name)


def sample(text: str) -> TriangleMesh:
    """Build ``NAME`` or ``NAME:VERTICES``; ends the program if there is none."""
    name, _, vertices = text.partition(":")
    if name not in SAMPLES:
        fail(f"there is no sample {name!r}; there are {', '.join(SAMPLES)}", REFUSED)
    if vertices and not vertices.isdecimal():
        fail(f"write a sample's number of vertices as in sample:{name}:5000, not {vertices!r}", REFUSED)
    if len(vertices) > len(str(SAMPLE_MOST)) or int(vertices or 0) > SAMPLE_MOST:
        fail(f"a sample has at most {SAMPLE_MOST:,} vertices", REFUSED)
    return SAMPLES[name].build(int(vertices or SAMPLE_VERTICES))


def read_settings() -> Settings:
    """Read what the environment says; ends the program where it is wrong."""
    try:
        return Settings()
    except ValidationError as e:
        first = e.errors(include_url=False, include_context=False, include_input=False)[0]
        name = str(first["loc"][0]).upper()
        name = name if name == "REDIS_URL" else f"SPHERIFY_{name.removeprefix('SPHERIFY_')}"
        fail(f"{name} in the environment: {first['msg'].removeprefix('Value error, ')}", REFUSED)


def parameters_of(
    preset: str | None, method: str | None, iterations: int | None, assignments: list[str]
) -> tuple[str, Parameters]:
    """Lay ``name=value`` assignments over a preset; ends the program where one is wrong.

    Returns:
        the name of the preset, chosen by the method where none is named, and the parameters.

    """
    overrides = dict(assignment_of(text) for text in assignments)
    if iterations is not None:
        overrides["iterations"] = iterations
    if method is not None and overrides.setdefault("method", method) != method:
        fail("--method and --set method=… name two methods", REFUSED)
    try:
        chosen = chosen_preset(preset, overrides.get("method"))
        return chosen, resolve(chosen, overrides)
    except ValidationError as e:
        first = e.errors(include_url=False, include_context=False, include_input=False)[0]
        name = ".".join(map(str, first["loc"]))
        if first["type"] == "extra_forbidden" and len(first["loc"]) == 1:
            names = PARAMETERS_OF[PRESETS[chosen].config.method].model_fields
            fail(f"there is no parameter {name}; there are {', '.join(names)}", REFUSED)
        fail(f"{name}: {first['msg']}", REFUSED)
    except InvalidConfigError as e:
        fail(str(e), REFUSED)


def assignment_of(text: str) -> tuple[str, Any]:
    """Read ``name=value``, the value as JSON, and as plain text where it is none."""
    name, equals, value = text.partition("=")
    if not equals or not name:
        fail(f"--set takes name=value, such as --set window=[30,70], not {text!r}", REFUSED)
    try:
        return name, json.loads(value)
    except ValueError:
        return name, value
