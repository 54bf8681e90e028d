"""What campaigns submit, and what must come back: the bytes a local, undisturbed `spherify morph` writes."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from spherify.formats import write_mesh
from spherify.geometry.samples import SAMPLES
from tests.cli.program import spherify_here

FIXED = {"annealing": "null", "stop_radius_variation": "0"}
"""With these a run does all its iterations, so that its length is known."""


@dataclass(frozen=True)
class Specimen:
    """One upload with its parameters.

    Attributes:
        fields: of the form, beside the file.
        expected: name of a snapshot (an iteration, or ``final``) → sha256 of its PLY.

    """

    name: str
    content: bytes
    fields: dict[str, str]
    expected: dict[str, str]


def specimen(folder: Path, name: str, vertices: int, iterations: int, every: int) -> Specimen:
    """Morph a sample here and now, and return it with the hashes of everything it passes through."""
    stem = f"{name}-{vertices}-{iterations}"
    content = write_mesh(SAMPLES[name].build(vertices), "ply")
    (folder / f"{stem}.ply").write_bytes(content)
    plan = [str(i) for i in range(0, iterations + 1, every)]
    settings = [word for item in FIXED.items() for word in ("--set", "=".join(item))]
    done = spherify_here(
        "morph", f"{stem}.ply", "-o", "local.ply", "--iterations", str(iterations),
        "--snapshots", ",".join(plan), *settings, cwd=folder,
    )  # fmt: skip
    assert done.code == 0, done.err
    files = {i: folder / f"local_it{int(i):05d}.ply" for i in plan} | {"final": folder / "local.ply"}
    return Specimen(
        name=f"{stem}.ply",
        content=content,
        fields={"iterations": str(iterations), "snapshots": ",".join(plan), **FIXED},
        expected={which: hashlib.sha256(file.read_bytes()).hexdigest() for which, file in files.items()},
    )


def some(folder: Path, iterations: int = 30, every: int = 10) -> list[Specimen]:
    """Return a few that differ in shape, size and length."""
    shapes = [("stone", 60), ("cube", 100), ("head", 80), ("non-convex-sphere", 120)]
    return [
        specimen(folder, name, vertices, iterations + every * i, every)
        for i, (name, vertices) in enumerate(shapes)
    ]
