"""`spherify morph`: one mesh, here and now, without any server."""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import Progress as Bars

from spherify.cli.console import COLLAPSED, FAILED, INTERRUPTED, REFUSED, err, fail, progress_bar, warn
from spherify.cli.inputs import (
    SAMPLE,
    AllowOption,
    AssignmentsOption,
    IterationsOption,
    MethodOption,
    PresetOption,
    mesh_of,
    parameters_of,
)
from spherify.cli.interruption import interruptible
from spherify.cli.snapshots import snapshot_name
from spherify.formats import FORMATS_OUT, write_mesh
from spherify.geometry.errors import GeometryError, InvalidConfigError
from spherify.geometry.flow import StopReason
from spherify.geometry.kernels import ENGINES, default_engine, get_engine
from spherify.geometry.mesh import TriangleMesh
from spherify.geometry.schedule import SnapshotPlan
from spherify.jobs.model import Progress
from spherify.jobs.rows import Row
from spherify.jobs.run import Kept, RunEnd, Stop, run


def morph(
    source: Annotated[str, typer.Argument(metavar="IN", help="Mesh file, or sample:NAME.")],
    *,
    output: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="OUT", help="File for the result; its suffix is the format."),
    ],
    method: MethodOption = None,
    preset: PresetOption = None,
    iterations: IterationsOption = None,
    snapshots: Annotated[
        str, typer.Option(metavar="WHICH", help="States to save beside OUT: 100,500 or every:100 or log:12.")
    ] = "",
    assignments: AssignmentsOption = None,
    engine: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help=f"Engine: {' or '.join(ENGINES)}; by default compiled, where numba can be loaded.",
        ),
    ] = None,
    threads: Annotated[int, typer.Option(min=1, metavar="N", help="Threads to compute with.")] = 1,
    allow: AllowOption = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON report on standard output.")
    ] = False,
) -> None:
    """Morph one mesh on this machine and write the result.

    Exit codes: 0 after a run that ended by itself; 1 if something failed, as when a file cannot be written; 2 if the
    mesh or an option is refused; 3 if the run collapsed (the best state is written); 130 after Ctrl-C (the last state
    is written).
    """
    form = output.suffix.lower().removeprefix(".")
    if form not in FORMATS_OUT:
        fail(f"{output}: the suffix must be one of {', '.join('.' + f for f in FORMATS_OUT)}", REFUSED)
    if not output.parent.is_dir():
        fail(f"the folder {output.parent} does not exist", REFUSED)
    if output.is_dir():
        fail(f"{output} is a folder: name a file", REFUSED)
    if not os.access(output if output.exists() else output.parent, os.W_OK):  # better told before the work
        fail(f"{output} cannot be written: permission denied", REFUSED)
    preset, parameters = parameters_of(preset, method, iterations, assignments or [])
    try:
        computing = default_engine(threads, warn) if engine is None else get_engine(engine, threads)
        plan = SnapshotPlan.parse(snapshots, parameters.iterations)
    except InvalidConfigError as e:
        fail(str(e), REFUSED)
    if snapshots:
        _spare(Path(source), output, plan)
    mesh = mesh_of(source, allow or [])
    if not computing.ready:
        warn("compiling the kernels, once on this machine: up to a minute")
        computing.warm()

    with progress_bar() as bars, interruptible() as interrupted:
        files = _Files(mesh, output, form, frozenset(plan.iterations) if snapshots else frozenset(), bars)
        try:
            end = run(
                mesh,
                parameters.config(),
                plan,
                files,
                engine=computing,
                stop=lambda: Stop.CANCEL if interrupted else None,
                checkpoint_s=float("inf"),
                clock=files.clock,
            )
            files.finish(end)
        except GeometryError as e:
            fail(f"{source}: {e}", REFUSED)
        except OSError as e:
            fail(f"{e.filename or output} cannot be written: {e.strerror}", FAILED)
    report = {
        "input": source,
        "output": str(output),
        "method": parameters.method,
        "preset": preset,
        "engine": computing.name,
        "vertices": len(mesh.vertices),
        "faces": len(mesh.faces),
        "iterations": end.iteration,
        "stop_reason": end.stop_reason,
        "stop_detail": end.stop_detail,
        "seconds": round(files.seconds, 6),
        "snapshots": [str(path) for path in files.written.values()],
        # JSON has no number for what is not finite
        **{name: value if math.isfinite(value) else None for name, value in files.figures(end).items()},
    }
    _say(report, as_json=as_json)
    if end.stop_reason is StopReason.COLLAPSED:
        fail(f"{end.stop_detail}; {output} holds the best state", COLLAPSED)
    if end.stop_reason is StopReason.CANCELLED:
        fail(f"interrupted; {output} holds the state at iteration {end.iteration}", INTERRUPTED)


@dataclass
class _Files:
    """The sink of a local run: mesh files and a progress bar. Its clock stands still while it works."""

    mesh: TriangleMesh
    output: Path
    form: str
    wanted: frozenset[int]
    bars: Bars
    written: dict[int, Path] = field(default_factory=dict)
    seconds: float = 0.0
    _rows: dict[int, Row] = field(default_factory=dict)
    _last: tuple[int, bytes] = (-1, b"")
    _busy_s: float = 0.0
    _began: float | None = None

    def __post_init__(self) -> None:
        name = self.output.stem
        self._task = self.bars.add_task(
            name, total=None, start=False, visible=False, note="", rate=None, eta=None
        )

    def clock(self) -> float:
        """Seconds spent outside of this sink."""
        return time.perf_counter() - self._busy_s

    def snapshot(self, kept: Kept) -> None:
        """Write a state that was asked for, and remember it: it may be the result."""
        with self._aside():
            data = write_mesh(self.mesh.with_vertices(kept.arrays["vertices"]), self.form)
            if kept.iteration in self.wanted:
                path = _snapshot(self.output, kept.iteration)
                path.write_bytes(data)
                self.written[kept.iteration] = path
            self._rows[kept.iteration], self._last = kept.row, (kept.iteration, data)

    def checkpoint(self, kept: Kept) -> None:
        """Keep nothing: a local run is not resumed."""

    def report(self, progress: Progress, rows: Sequence[Row]) -> None:
        """Move the bar; the first call, of state 0, ends the preparations."""
        if self._began is None:
            self._began = self.clock()
        with self._aside():
            self._move(progress, rows[-1]["sphericity"] if rows else None)

    def finish(self, end: RunEnd) -> None:
        """Write the result: the state the run ended with, which a collapsed one has left behind."""
        self.seconds = 0.0 if self._began is None else self.clock() - self._began
        iteration, data = self._last
        self.output.write_bytes(
            data if iteration == end.iteration else self.written[end.iteration].read_bytes()
        )
        self._move(end.progress, end.sphericity)
        self.bars.update(self._task, total=end.iteration, completed=end.iteration, rate=None)

    def figures(self, end: RunEnd) -> Row:
        """Return the figures of the result."""
        return {name: value for name, value in self._rows[end.iteration].items() if name != "iteration"}

    def _move(self, progress: Progress, sphericity: float | None) -> None:
        changes: dict[str, object] = {} if sphericity is None else {"note": f"Ψ {sphericity:.4f}"}
        self.bars.update(
            self._task,
            completed=progress.iteration,
            total=progress.iterations_total,
            visible=True,
            rate=progress.iterations_per_s,
            eta=progress.eta_s,
            **changes,  # type: ignore[arg-type] # rich takes any field
        )

    @contextmanager
    def _aside(self) -> Iterator[None]:
        began = time.perf_counter()
        try:
            yield
        finally:
            self._busy_s += time.perf_counter() - began


def _snapshot(output: Path, iteration: int) -> Path:
    """Return the file for a state, beside that for the result and of the same suffix."""
    return output.with_name(snapshot_name(output.stem, iteration, output.suffix.removeprefix(".")))


def _spare(source: Path, output: Path, plan: SnapshotPlan) -> None:
    """End the program if a snapshot would be written over what is read."""
    for path in (_snapshot(output, iteration) for iteration in plan.iterations):
        if path.exists() and source.exists() and path.samefile(source):
            fail(f"a snapshot would take the place of {path}: give -o another name", REFUSED)


def _say(report: Mapping[str, object], *, as_json: bool) -> None:
    if as_json:
        typer.echo(json.dumps(report, ensure_ascii=False))
        return
    source = str(report["input"]).removeprefix(SAMPLE)
    err.print(
        f"{source} ({report['vertices']:,} vertices) → {report['output']}: {report['stop_reason']} after "
        f"{report['iterations']:,} iterations in {report['seconds']:.2f} s, Ψ {report['sphericity']:.4f}, "
        f"radius variation {report['radius_variation']:.4f}, faces inward: {report['inward_faces']}",
        markup=False,
    )
