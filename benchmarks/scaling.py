"""What a vertex costs from a thousand to a million of them, on one thread and two, and what a run adds to its steps."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

from benchmarks.kernels import STEP, STEPS, chained, configuration
from benchmarks.pictures import lines
from benchmarks.timing import best_of
from spherify.geometry.config import Stage
from spherify.geometry.kernels import get_engine
from spherify.geometry.samples import SAMPLES
from spherify.geometry.topology import Topology

SIZES = (1_000, 2_500, 10_000, 40_000, 160_000, 1_000_000)
THREADS = (1, 2)
WORK = 3_000_000  # vertices in all the rounds of a size


def main() -> None:
    """Print nanoseconds a vertex: an elementary step by threads, and the figures of the surface, once an iteration."""
    print(
        "The compiled engine on a stone, ns a vertex; shape: the share of volume, area and spread in an iteration."
    )
    names = [
        f"{preset}, {threads} thread{'s'[: threads - 1]}"
        for preset, threads in product(("paper", "robust"), THREADS)
    ]
    print(
        f"{'vertices':>9}"
        + "".join(f"{name:>19}" for name in names)
        + f"{'shape, paper':>14}{'shape, robust':>14}"
    )
    sizes: list[int] = []
    costs: dict[str, list[float]] = {name: [] for name in names}
    for size in SIZES:
        n, cost = _costs(size)
        sizes.append(n)
        for name in names:
            costs[name].append(cost[name])
        shares = [
            f"{cost['shape'] / (cost['shape'] + STEPS * cost[f'{preset}, 1 thread']):>13.1%}"
            for preset in ("paper", "robust")
        ]
        print(
            f"{n:>9,}" + "".join(f"{cost[name]:>19.1f}" for name in names) + " " + " ".join(shares),
            flush=True,
        )
    print(lines("scaling", "One elementary step, compiled", sizes, costs, unit="ns a vertex"))


def _costs(size: int) -> tuple[int, dict[str, float]]:
    """Return how many vertices there are, and nanoseconds a vertex."""
    mesh = SAMPLES["stone"].build(size)
    n = len(mesh.vertices)
    rivals: dict[str, Callable[[], object]] = {
        f"{preset}, {threads} thread{'s'[: threads - 1]}": chained(
            mesh, get_engine("compiled", threads), preset
        )
        for preset, threads in product(("paper", "robust"), THREADS)
    }
    kernel = get_engine("compiled").prepare(Topology.of(n, mesh.faces), configuration("robust"))
    moved = kernel.transform(mesh.vertices, Stage(1, 1, 1), STEP, 0.0)
    if moved is None:
        raise ValueError("the curvature is the same everywhere")
    rivals["shape"] = lambda: kernel.shape(moved)  # of what T has just returned, as in a run
    seconds = best_of(rivals, max(5, WORK // n), 2)
    return n, {name: best / n * 1e9 / (1 if name == "shape" else STEPS) for name, best in seconds.items()}
