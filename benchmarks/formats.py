"""Reading and writing every format, against trimesh, which does less: it neither judges a mesh nor mends it."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Any, Final

import trimesh

from benchmarks.pictures import bars
from benchmarks.timing import best_of
from spherify.formats import ReadLimits, write_mesh
from spherify.formats.acceptance import accept, read
from spherify.geometry.mesh import TriangleMesh
from spherify.geometry.samples import SAMPLES

SIZES: Final = (10_000, 100_000)
ROUNDS: Final = 3
WRITTEN: Final[dict[str, tuple[str, dict[str, Any], dict[str, Any]]]] = {
    # format, how we are asked, how trimesh is: for digits enough to read the same number back, where it can
    "obj": ("obj", {}, {"digits": 17, "include_normals": False, "include_texture": False}),
    "off": ("off", {}, {"digits": 17}),
    "ply": ("ply", {"precision": "float"}, {"vertex_normal": False}),
    "ply ascii": (
        "ply",
        {"precision": "float", "ascii": True},
        {"encoding": "ascii", "vertex_normal": False},
    ),
    "stl": ("stl", {}, {}),
    "stl ascii": ("stl", {"ascii": True}, {}),
    "glb": ("glb", {}, {"include_normals": False}),
}


def main() -> None:
    """Print milliseconds, and how many times as quick as trimesh we are; draw the larger size."""
    print(
        "Meshes as files. `read` takes triangles from bytes; `accept` also judges the surface, as the service does."
    )
    print(
        f"{'vertices':>9}  {'format':<10} {'':<7} {'ours, ms':>9} {'trimesh, ms':>12} {'times as quick':>15}"
    )
    ratios: dict[str, dict[str, float]] = {}
    for size in SIZES:
        mesh = SAMPLES["stone"].build(size)
        ratios = {"write": {}, "read": {}}
        for name in WRITTEN:
            for what, (ours, theirs) in _measured(mesh, name).items():
                figures = f"{ours * 1e3:>9.1f}"
                if theirs is not None:
                    ratios[what][name] = theirs / ours
                    figures += f" {theirs * 1e3:>12.1f} {theirs / ours:>14.2f}×"
                print(f"{len(mesh.vertices):>9,}  {name:<10} {what:<7} {figures}", flush=True)
    series = {what: list(of_format.values()) for what, of_format in ratios.items()}
    title = f"Files of {SIZES[-1]:,} vertices, against trimesh"
    print("drawn:", bars("formats", title, list(WRITTEN), series, unit="times as quick").name)


def _measured(mesh: TriangleMesh, name: str) -> dict[str, tuple[float, float | None]]:
    """Return seconds of ours and of trimesh, by what is done; None where trimesh does nothing of the kind."""
    form, our_options, their_options = WRITTEN[name]
    their_form = "stl_ascii" if name == "stl ascii" else form

    def their_write() -> object:
        fresh = trimesh.Trimesh(
            mesh.vertices, mesh.faces, process=False
        )  # it keeps normals from call to call
        return fresh.export(file_type=their_form, **their_options)

    data = write_mesh(mesh, form, **our_options)
    rivals: dict[str, Callable[[], object]] = {
        "write": lambda: write_mesh(mesh, form, **our_options),
        "their write": their_write,
        "read": lambda: read(data, form, ReadLimits()),
        "accept": lambda: accept(data, f"stone.{form}", frozenset(), ReadLimits()),
        "their read": lambda: trimesh.load(io.BytesIO(data), file_type=form, process=False),
    }
    best = best_of(rivals, ROUNDS)
    return {
        "write": (best["write"], best["their write"]),
        "read": (best["read"], best["their read"]),
        "accept": (best["accept"], None),
    }
