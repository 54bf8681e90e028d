"""The README's pictures and figures, made by the project itself from its own samples.

.venv/bin/python docs/figures.py pictures     draws docs/images/*.png (a minute)
.venv/bin/python docs/figures.py table        prints the table of what to expect (some seconds)
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Final

from spherify.geometry.flow import StopReason, flow
from spherify.geometry.presets import PRESETS
from spherify.geometry.samples import SAMPLES
from spherify.pictures import Panel, View, side_by_side

IMAGES: Final = Path(__file__).parent / "images"
PICTURE_VERTICES: Final = 6_000
PICTURE_ITERATIONS: Final = (0, 5, 10, 20, 40, 150)
TABLE_VERTICES: Final = 600
TABLE_ITERATIONS: Final = 300
TABLE_PAPER_ITERATIONS: Final = 2_000
WAYMARKS: Final = (0.95, 0.99)


def picture(name: str, view: View) -> Path:
    """Draw one sample on its way to a sphere, by the robust preset."""
    mesh = SAMPLES[name].build(PICTURE_VERTICES)
    panels = []
    for state in flow(mesh, PRESETS["robust"].config):
        if state.iteration in PICTURE_ITERATIONS:
            shape = mesh.with_vertices(state.vertices)
            panels.append(Panel(shape, f"iteration {state.iteration}", f"Ψ {state.sphericity:.4f}"))
        if state.iteration == PICTURE_ITERATIONS[-1]:
            break
    path = IMAGES / f"{name}.png"
    path.write_bytes(side_by_side(panels, view=view, dpi=100))
    return path


def row(name: str) -> str:
    """Return one line of the table: a sample under the preset robust, and under paper."""
    mesh = SAMPLES[name].build(TABLE_VERTICES)
    reached: dict[float, int] = {}
    start = 0.0
    for state in flow(mesh, replace(PRESETS["robust"].config, iterations=TABLE_ITERATIONS)):
        start = start or state.sphericity
        for mark in WAYMARKS:
            if state.sphericity >= mark:
                reached.setdefault(mark, state.iteration)
    marks = " | ".join(str(reached.get(mark, "–")) for mark in WAYMARKS)
    robust = f"{marks} | {state.sphericity:.4f} | {state.metrics().inward_faces} of {len(mesh.faces):,}"
    *_, state = flow(mesh, replace(PRESETS["paper"].config, iterations=TABLE_PAPER_ITERATIONS))
    paper = f"{state.best.sphericity:.3f}"
    if state.stop_reason is StopReason.COLLAPSED:
        paper += f", collapsed; best at {state.best.iteration:,}"
    return f"| {name} | {len(mesh.vertices):,} | {start:.3f} | {robust} | {paper} |"


def main(arguments: list[str]) -> int:
    """Return the exit code."""
    if arguments == ["pictures"]:
        IMAGES.mkdir(exist_ok=True)
        for name, view in (("quadruped", View()),):
            sys.stdout.write(f"{picture(name, view)}\n")
    elif arguments == ["table"]:
        for name in SAMPLES:
            sys.stdout.write(f"{row(name)}\n")
            sys.stdout.flush()
    else:
        sys.stderr.write(__doc__ or "")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
