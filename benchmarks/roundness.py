"""How round meshes become, how soon, and what becomes of their triangles: our presets, and LaPy's flow.

``python -m benchmarks.roundness FOLDER`` tries the meshes of a folder; ``make bench`` tries generated shapes.
"""

from __future__ import annotations

import argparse
import json
import os
import sys

if __name__ == "__main__":  # as a program, it sets the threads before anything that computes is loaded
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(variable, "1")

import time
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from statistics import median
from typing import Final

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from benchmarks import pictures
from benchmarks.runs import LAPY, MARKS, Run, run
from benchmarks.shapes import SHAPES
from spherify.formats import FORMATS_IN, FormatError, read_mesh
from spherify.geometry.errors import InvalidConfigError
from spherify.geometry.kernels import Engine, default_engine
from spherify.geometry.mesh import TriangleMesh
from spherify.geometry.presets import PRESETS
from spherify.geometry.samples.implicit import Implicit, surface
from spherify.geometry.samples.solids import icosphere

FLOWS: Final = ("robust", "paper", "conformal", LAPY)
SHAPE_VERTICES: Final = 2_000
LIMIT: Final = 60.0  # seconds for one flow on one mesh
COLUMNS: Final = (
    *("mesh", "vertices", "flow", "Ψ", "radius variation", "inward faces", "least area / mean"),
    *("least quality", "iterations", *(f"s to Ψ {mark:g}" for mark in MARKS), "s", "true sphere", "ended"),
)
RULE: Final = "|" + "---|" * len(COLUMNS)
_FINER: Final = (1, 1.25, 1.5, 2, 3)  # times the vertices asked for, tried in turn
_REFRESH: Final = 0.2  # seconds between pictures of the progress bar


def main() -> None:
    """Print the table of the generated shapes, and draw it."""
    bench(generated(SHAPE_VERTICES))


def bench(
    meshes: Sequence[tuple[str, TriangleMesh]], flows: Sequence[str] = FLOWS, limit: float = LIMIT
) -> None:
    """Print the table, a line as soon as it is there, and what it comes to; write the report and the plot."""
    print(
        f"Meshes to spheres, one thread, at most {limit:g} s each. Seconds are the flow's own processor time. A true "
        "sphere: Ψ ≥ 0.995, at most 0.1 % of the faces inward, no triangle below a millionth of the mean area.\n"
    )
    print(f"| {' | '.join(COLUMNS)} |\n{RULE}", flush=True)
    runs: list[Run] = []
    for done in table(meshes, flows, limit):
        print(line(done), flush=True)
        runs.append(done)
    print(f"\n{summary(runs)}")
    print("drawn:", drawn(runs).name, "and", report(runs).name)


def table(meshes: Sequence[tuple[str, TriangleMesh]], flows: Sequence[str], limit: float) -> Iterator[Run]:
    """Run each flow on each mesh, and show how far that is."""
    engine = default_engine(say=print)
    warm(flows, engine)
    columns = (TextColumn("{task.description}", markup=False), BarColumn(bar_width=28), MofNCompleteColumn())
    # Drawn between iterations, when no clock runs: a thread that draws would be charged to the flows.
    bars = Progress(*columns, console=Console(stderr=True), auto_refresh=False, transient=True)
    with bars:
        task = bars.add_task("", total=len(meshes) * len(flows))
        for name, mesh in meshes:
            for flow in flows:
                shown = 0.0

                def watch(iteration: int, sphericity: float, what: str = f"{name}, {flow}") -> None:
                    nonlocal shown
                    if time.perf_counter() - shown >= _REFRESH:
                        at = f"{what}: iteration {iteration}, Ψ {sphericity:.4f}"
                        bars.update(task, description=at, refresh=True)
                        shown = time.perf_counter()

                done = run(name, mesh, flow, engine, limit=limit, watch=watch)
                bars.advance(task)
                yield done


def warm(flows: Sequence[str], engine: Engine) -> None:
    """Have machine code made and libraries loaded: each flow goes a little way on a pebble, and on what is round."""
    engine.warm()  # unfolding too, which a pebble does not come to
    ball = icosphere(3)
    pebble = ball.with_vertices(ball.vertices * [1.0, 1.2, 1.5])
    for flow in flows:
        for mesh in (pebble, ball):
            run("pebble", mesh, flow, engine, limit=0.05, watch=lambda _, __: None)


def generated(vertices: int, only: Collection[str] | None = None) -> list[tuple[str, TriangleMesh]]:
    """Return the long-limbed shapes, or those named, of about so many vertices, or as many as keep limbs apart."""
    return [(name, _built(body, vertices)) for name, body in SHAPES.items() if only is None or name in only]


def _built(body: Implicit, vertices: int) -> TriangleMesh:
    for factor in _FINER:
        try:
            return surface(body, round(factor * vertices))
        except InvalidConfigError as e:  # its limbs touch at this resolution
            why = e
    raise why


def read_folder(folder: Path) -> list[tuple[str, TriangleMesh]]:
    """Return the closed meshes of genus 0 of a folder, the smallest first; the others are named, with the reason."""
    found = []
    for path in sorted(folder.iterdir()):
        if path.suffix.lower().removeprefix(".") not in FORMATS_IN:
            continue
        try:
            found.append((path.stem, read_mesh(path, path.name).mesh))
        except FormatError as e:  # open, in pieces, with handles, or no mesh
            print(f"left out: {path.name}: {e}")
    return sorted(found, key=lambda one: len(one[1].vertices))


def line(done: Run) -> str:
    """Return one line of the table."""
    inward = f"{done.inward_faces:,} ({100 * done.inward_faces / done.faces:.2f} %)"
    times = [done.seconds_to[mark] for mark in MARKS]
    cells = (
        *(done.mesh, f"{done.vertices:,}", done.flow, f"{done.sphericity:.5f}"),
        *(f"{done.radius_variation:.1e}", inward, f"{done.least_area:.1e}", f"{done.least_quality:.1e}"),
        *(f"{done.iterations:,}", *("-" if at is None else f"{at:.2f}" for at in times)),
        *(f"{done.seconds:.2f}", "yes" if done.true_sphere else "no", done.ended),
    )
    return f"| {' | '.join(cells)} |"


def summary(runs: Sequence[Run]) -> str:
    """Return, for each flow, how many true spheres, and how much sooner than LaPy's it is at the first mark."""
    rival = {done.mesh: done.seconds_to[MARKS[0]] for done in runs if done.flow == LAPY}
    lines = []
    for flow in dict.fromkeys(done.flow for done in runs):
        of_flow = [done for done in runs if done.flow == flow]
        said = f"{flow}: {sum(done.true_sphere for done in of_flow)} of {len(of_flow)} are true spheres"
        ratios = []
        for done in of_flow:
            ours, theirs = done.seconds_to[MARKS[0]], rival.get(done.mesh)
            if flow != LAPY and ours and theirs:  # a mesh that is as round from the start takes no time
                ratios.append(theirs / ours)
        if ratios:
            said += (
                f"; Ψ {MARKS[0]:g} {median(ratios):.2g} times as soon as LaPy (median of the {len(ratios)} "
            )
            said += f"where both reach it; {min(ratios):.2g} to {max(ratios):.2g})"
        lines.append(said)
    return "\n".join(lines)


def report(runs: Sequence[Run]) -> Path:
    """Write all figures as JSON, beside the plots."""
    path = pictures.FOLDER / "roundness.json"
    pictures.FOLDER.mkdir(exist_ok=True)
    figures = [{**asdict(done), "true_sphere": done.true_sphere} for done in runs]
    path.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    return path


def drawn(runs: Sequence[Run]) -> Path:
    """Draw what the table says, a panel a figure."""
    meshes = list(dict.fromkeys(done.mesh for done in runs))
    flows = list(dict.fromkeys(done.flow for done in runs))
    of = {(done.mesh, done.flow): done for done in runs}
    shown: dict[str, Callable[[Run], float | None]] = {
        "1 - Ψ": lambda done: 1 - done.sphericity,
        "inward faces, %": lambda done: 100 * done.inward_faces / done.faces,
        "least area / mean": lambda done: done.least_area,
        f"seconds to Ψ {MARKS[0]:g}": lambda done: done.seconds_to[MARKS[0]],
    }
    panels = {
        what: {flow: [figure(of[mesh, flow]) for mesh in meshes] for flow in flows}
        for what, figure in shown.items()
    }
    return pictures.panels("roundness", "Meshes to spheres", meshes, panels)


def _command(words: Sequence[str]) -> None:
    """Do what the command line says."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.roundness", description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, help="of meshes; the generated shapes by default")
    parser.add_argument("--shapes", action="store_true", help="try the generated shapes too")
    parser.add_argument("--vertices", type=int, default=SHAPE_VERTICES, help="of a generated shape, about")
    parser.add_argument("--limit", type=float, default=LIMIT, help="seconds for one flow on one mesh")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="of meshes, without the ending of the file")
    parser.add_argument("--flows", nargs="+", default=FLOWS, choices=(*PRESETS, LAPY))
    given = parser.parse_args(words)
    meshes = read_folder(given.folder) if given.folder else []
    if given.shapes or not given.folder:
        meshes += generated(given.vertices, given.only)
    if given.only:
        if unknown := set(given.only) - {name for name, _ in meshes}:
            parser.error(f"there is no mesh {', '.join(sorted(unknown))}")
        meshes = [one for one in meshes if one[0] in given.only]
    if not meshes:
        parser.error("there is no mesh to try")
    bench(meshes, given.flows, given.limit)


if __name__ == "__main__":
    _command(sys.argv[1:])
