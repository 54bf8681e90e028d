"""`spherify samples`: the shapes of the paper's pictures, built by us."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spherify.cli.console import REFUSED, fail, out
from spherify.cli.inputs import SAMPLE_MOST, SAMPLE_VERTICES
from spherify.formats import FORMATS_OUT, write_mesh
from spherify.geometry.samples import SAMPLES


def samples(
    folder: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="DIR", help="Write them all into this folder.")
    ] = None,
    mesh_format: Annotated[
        str,
        typer.Option("--format", metavar="FORMAT", help=f"Format of the files: {', '.join(FORMATS_OUT)}."),
    ] = "obj",
    vertices: Annotated[
        int, typer.Option(min=4, max=SAMPLE_MOST, metavar="N", help="Approximate number of vertices of each.")
    ] = SAMPLE_VERTICES,
) -> None:
    """List the sample meshes, or write them as files."""
    if mesh_format not in FORMATS_OUT:
        fail(f"--format must be one of {', '.join(FORMATS_OUT)}, not {mesh_format!r}", REFUSED)
    try:
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        fail(f"{folder} cannot be made: {e.strerror}", REFUSED)
    for sample in SAMPLES.values():
        if folder is None:
            out.print(f"sample:{sample.name:<20} {sample.title}", markup=False)
            continue
        mesh = sample.build(vertices)
        path = folder / f"{sample.name}.{mesh_format}"
        try:
            path.write_bytes(write_mesh(mesh, mesh_format))
        except OSError as e:
            fail(f"{path} cannot be written: {e.strerror}")
        out.print(f"{path}  {len(mesh.vertices):,} vertices", markup=False)
