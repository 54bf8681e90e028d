"""What a run does once an iteration, by each engine and preset, by numpy as first written, and by vtkCurvatures."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from benchmarks.plain_step import PlainStep
from benchmarks.timing import best_of, in_a_process_of_its_own
from benchmarks.vtk_step import VtkStep
from spherify.geometry.config import FlowConfig, Stage
from spherify.geometry.flow import flow
from spherify.geometry.kernels import ENGINES, Engine, get_engine
from spherify.geometry.measures import face_areas
from spherify.geometry.mesh import Floats, TriangleMesh
from spherify.geometry.presets import PRESETS
from spherify.geometry.roundness import Wanted
from spherify.geometry.samples import SAMPLES
from spherify.geometry.topology import Topology

SIZES = (2_500, 10_000, 40_000, 100_000)
PAIRS = tuple(product(("paper", "robust"), ENGINES))
STEP = 1e-6  # C: the surface stays what it is
ROUNDS = 7
IN_A_ROW = 100_000  # vertices of a turn's calls, so that small meshes are in the caches as in a run
VTK = "vtkCurvatures + numpy"
PLAIN = "plain numpy, paper"
STEPS = 4  # elementary, in an iteration of the first stage of either preset


def main() -> None:
    """Print nanoseconds a vertex, of an elementary step and of an iteration of a run, and how they compare."""
    print(
        "On a stone; processor time, the best of",
        ROUNDS,
        "rounds in turn, each given what its last one returned.",
    )
    print(
        f"{'vertices':>9}  {'how':<22} {'ns a step':>10} {'× plain':>9} {'× numpy':>9} {'× VTK + numpy':>14}"
        f" {'ns an iteration of a run':>25} {'× numpy':>9}"
    )
    for size in SIZES:
        mesh = SAMPLES["stone"].build(size)
        per = 1e9 / len(mesh.vertices)
        steps = {f"{engine}, {preset}": chained(mesh, get_engine(engine), preset) for preset, engine in PAIRS}
        runs = {f"run: {engine}, {preset}": _run(mesh, engine, preset) for preset, engine in PAIRS}
        rivals = {VTK: _repeated(VtkStep(mesh), mesh), **steps, **runs}
        seconds = _best_of(rivals, mesh) | {PLAIN: in_a_process_of_its_own(_plain, size)}
        for name in (VTK, PLAIN):
            print(f"{len(mesh.vertices):>9,}  {name:<22} {seconds[name] * per / STEPS:>10.1f}", flush=True)
        for preset, engine in PAIRS:
            name, numpy = f"{engine}, {preset}", f"reference, {preset}"
            once, whole = seconds[name], seconds[f"run: {name}"]
            print(
                f"{len(mesh.vertices):>9,}  {name:<22} {once * per / STEPS:>10.1f}"
                f" {f'{seconds[PLAIN] / once:.2f}' if preset == 'paper' else '':>9} {seconds[numpy] / once:>9.2f}"
                f" {seconds[VTK] / once:>14.2f} {whole * per:>25.1f} {seconds[f'run: {numpy}'] / whole:>9.2f}",
                flush=True,
            )


def _best_of(rivals: dict[str, Callable[[], object]], mesh: TriangleMesh) -> dict[str, float]:
    """Return the least seconds of processor time of each."""
    return best_of(rivals, ROUNDS, max(2, IN_A_ROW // len(mesh.vertices)), time.process_time)


def _plain(size: int) -> float:
    """Return those of plain numpy.

    What it frees lets the C library's allocator keep memory that it else returns at once, by which whatever allocates
    after it is quicker: the reference engine by a third at 40,000 vertices.
    """
    mesh = SAMPLES["stone"].build(size)
    return _best_of({PLAIN: _repeated(PlainStep(mesh), mesh)}, mesh)[PLAIN]


def configuration(preset: str) -> FlowConfig:
    """Return the configuration of a preset of the transformation."""
    config = PRESETS[preset].config
    if not isinstance(config, FlowConfig):
        raise TypeError(f"{preset} is of another method")
    return config


def _stage(config: FlowConfig) -> Stage:
    """Return the preset's first stage, checked to have as many steps as the figures are divided by."""
    stage = config.schedule[0]
    if stage.k_in + stage.k_out != STEPS:
        raise ValueError(f"an iteration has {stage.k_in + stage.k_out} elementary steps, not {STEPS}")
    return stage


def wanted(mesh: TriangleMesh, preset: str) -> Wanted:
    """Return what a run by a preset wants to know of each state of a mesh."""
    config = configuration(preset)
    area = float(face_areas(mesh.vertices, mesh.faces).sum()) if config.rescale == "area" else 0.0
    least = math.inf if config.unfolding else config.stop_radius_variation
    return Wanted(config.step_unit == "mean-edge", least, area)


def needed(mesh: TriangleMesh, preset: str) -> Wanted | None:
    """Return what of that the next step depends on; None if on nothing.

    `robust` scales back by area and centroid, steps by the mean edge, and keeps its momentum by the sphericity; the
    radius variation only ends a run, and is shown.
    """
    config = configuration(preset)
    depends = config.momentum > 0 or config.rescale != "none" or config.step_unit == "mean-edge"
    return wanted(mesh, preset)._replace(variation=0.0) if depends else None


def chained(
    mesh: TriangleMesh, engine: Engine, preset: str, *, measured: Wanted | None = None
) -> Callable[[], Floats]:
    """Return T of a preset's first stage, from where it led the last time; ``measured``: and the shape after it."""
    config = configuration(preset)
    kernel = engine.prepare(Topology.of(len(mesh.vertices), mesh.faces), config)
    V, stage = np.asfortranarray(mesh.vertices), _stage(config)

    def once() -> Floats:
        nonlocal V
        moved = kernel.transform(V, stage, STEP, config.relaxation, measured=measured)
        if moved is None:
            raise ValueError("the curvature is the same everywhere")
        V = moved
        if measured is not None:
            kernel.shape(V, measured)
        return V

    return once


def _run(mesh: TriangleMesh, engine: str, preset: str) -> Callable[[], object]:
    """Return one iteration of a run that nothing ends, from the state of the last time; without metrics and files."""
    config = replace(configuration(preset), annealing=None, unfolding=None, stop_radius_variation=0.0)
    states: Iterator[object] = flow(mesh, config, engine=engine)
    next(states)  # the mesh as it came
    return lambda: next(states)


def _repeated(step: Callable[..., Floats], mesh: TriangleMesh) -> Callable[[], object]:
    """Return the steps of an iteration of `paper`, from where they led the last time."""
    stage = _stage(configuration("paper"))
    V: Floats = np.array(mesh.vertices)

    def once() -> None:
        nonlocal V
        for outward in [False] * stage.k_in + [True] * stage.k_out:
            V = step(V, STEP, outward=outward)

    return once
