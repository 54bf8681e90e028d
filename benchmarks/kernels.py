"""One elementary step of each preset by each engine, and by vtkCurvatures with numpy."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np

from benchmarks.timing import best_of
from benchmarks.vtk_step import VtkStep
from spherify.geometry.config import Stage
from spherify.geometry.kernels import ENGINES, get_engine
from spherify.geometry.presets import PRESETS
from spherify.geometry.samples import SAMPLES
from spherify.geometry.topology import Topology

SIZES = (2_500, 10_000, 40_000, 160_000)
ONE_EACH = Stage(1, 1, 1)  # one inward and one outward step
ROUNDS = 7
VTK = "vtkCurvatures + numpy"


def main() -> None:
    """Print nanoseconds a vertex and step, and how many times as quick as numpy and as VTK with numpy each one is."""
    print("One elementary step on a stone, one thread; the best of", ROUNDS, "interleaved rounds.")
    print(
        f"{'vertices':>9}  {'how':<22} {'ns a vertex':>11} {'against numpy':>14} {'against VTK + numpy':>20}"
    )
    for size in SIZES:
        mesh = SAMPLES["stone"].build(size)
        V = np.array(mesh.vertices)
        seconds = best_of({VTK: _vtk(VtkStep(mesh), V), **_engines(mesh.faces, V)}, ROUNDS)
        for name, best in seconds.items():
            ours = seconds.get(f"reference, {name.split(', ')[-1]}")
            line = f"{len(V):>9,}  {name:<22} {best / 2 / len(V) * 1e9:>11.0f}"
            line += f" {ours / best:>13.2f}×" if ours else f" {'':>14}"
            print(f"{line} {seconds[VTK] / best:>19.2f}×")


def _vtk(step: VtkStep, V: np.ndarray) -> Callable[[], object]:
    return lambda: step(step(V, 1e-6, outward=False), 1e-6, outward=True)


def _engines(faces: np.ndarray, V: np.ndarray) -> dict[str, Callable[[], object]]:
    topology = Topology.of(len(V), faces)
    found: dict[str, Callable[[], object]] = {}
    for engine, preset in product(ENGINES, ("paper", "robust")):
        config = PRESETS[preset].config
        kernel = get_engine(engine).prepare(topology, config)
        found[f"{engine}, {preset}"] = lambda kernel=kernel, config=config: kernel.transform(
            V, ONE_EACH, 1e-6, config.relaxation
        )
    return found
