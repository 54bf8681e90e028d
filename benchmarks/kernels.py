"""One elementary step of each preset by each engine, and by vtkCurvatures with numpy."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from benchmarks.vtk_step import VtkStep
from spherify.geometry.config import Stage
from spherify.geometry.kernels import ENGINES
from spherify.geometry.presets import PRESETS
from spherify.geometry.samples import SAMPLES
from spherify.geometry.topology import Topology

SIZES = (2_500, 10_000, 40_000, 160_000)
ONE_EACH = Stage(1, 1, 1)  # one inward and one outward step
ROUNDS = 5


def main() -> None:
    """Print nanoseconds a vertex and step, and how many times as quick as vtkCurvatures with numpy each one is."""
    print("One elementary step on a stone, one thread; the best of", ROUNDS, "interleaved rounds.")
    print(f"{'vertices':>9}  {'how':<22} {'ns a vertex':>11} {'against VTK + numpy':>20}")
    for size in SIZES:
        mesh = SAMPLES["stone"].build(size)
        V = np.array(mesh.vertices)
        rivals = {"vtkCurvatures + numpy": _vtk(VtkStep(mesh), V), **_engines(mesh.faces, V)}
        seconds = _best_of(rivals)
        for name, best in seconds.items():
            each = best / 2 / len(V) * 1e9
            print(f"{len(V):>9,}  {name:<22} {each:>11.0f} {seconds['vtkCurvatures + numpy'] / best:>19.2f}×")


def _vtk(step: VtkStep, V: np.ndarray) -> Callable[[], object]:
    return lambda: step(step(V, 1e-6, outward=False), 1e-6, outward=True)


def _engines(faces: np.ndarray, V: np.ndarray) -> dict[str, Callable[[], object]]:
    topology = Topology.of(len(V), faces)
    found: dict[str, Callable[[], object]] = {}
    for engine in ENGINES.values():
        for name in ("paper", "robust"):
            config = PRESETS[name].config
            kernel = engine.prepare(topology, config)
            found[f"{engine.name}, {name}"] = lambda kernel=kernel, config=config: kernel.transform(
                V, ONE_EACH, 1e-6, config.relaxation
            )
    return found


def _best_of(rivals: dict[str, Callable[[], object]]) -> dict[str, float]:
    """Time them in turn, round after round, so that what else the machine does meets all of them."""
    best = dict.fromkeys(rivals, float("inf"))
    for run in rivals.values():
        run()  # what is prepared at the first call is not the step's cost
    for _ in range(ROUNDS):
        for name, run in rivals.items():
            began = time.perf_counter()
            run()
            best[name] = min(best[name], time.perf_counter() - began)
    return best
