"""What a vertex costs from a thousand to a million of them, on one thread and two, and what a run adds to its steps."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

from benchmarks.kernels import IN_A_ROW, STEPS, chained, needed, wanted
from benchmarks.pictures import lines
from benchmarks.timing import best_of
from spherify.geometry.kernels import get_engine
from spherify.geometry.samples import SAMPLES

SIZES = (1_000, 2_500, 10_000, 40_000, 160_000, 1_000_000)
THREADS = (1, 2)
PRESETS = ("paper", "robust")
WORK = 3_000_000  # vertices in all the rounds of a size


def main() -> None:
    """Print nanoseconds a vertex: an elementary step by threads, and the figures of the surface, once an iteration."""
    print(
        "The compiled engine on a stone, ns a vertex. Measuring: its share in an iteration with it; beyond need: what"
    )
    print(
        "of that the next step does not depend on, the cost of metrics, progress and the look for a collapse."
    )
    names = [
        f"{preset}, {threads} thread{'s'[: threads - 1]}" for preset, threads in product(PRESETS, THREADS)
    ]
    print(
        f"{'vertices':>9}"
        + "".join(f"{name:>19}" for name in names)
        + "".join(f"{f'measuring, {preset}':>19}{'beyond need':>13}" for preset in PRESETS)
    )
    sizes: list[int] = []
    costs: dict[str, list[float]] = {name: [] for name in names}
    for size in SIZES:
        n, cost = _costs(size)
        sizes.append(n)
        for name in names:
            costs[name].append(cost[name])
        shares = [
            f"{1 - cost[f'{preset}, 1 thread'] / whole:>19.1%}{1 - cost[f'{preset}, needed'] / whole:>13.1%}"
            for preset, whole in ((preset, cost[f"{preset}, measured"]) for preset in PRESETS)
        ]
        print(f"{n:>9,}" + "".join(f"{cost[name]:>19.1f}" for name in names) + "".join(shares), flush=True)
    print(lines("scaling", "One elementary step, compiled", sizes, costs, unit="ns a vertex"))


def _costs(size: int) -> tuple[int, dict[str, float]]:
    """Return how many vertices there are, and nanoseconds a vertex."""
    mesh = SAMPLES["stone"].build(size)
    n = len(mesh.vertices)
    rivals: dict[str, Callable[[], object]] = {
        f"{preset}, {threads} thread{'s'[: threads - 1]}": chained(
            mesh, get_engine("compiled", threads), preset
        )
        for preset, threads in product(PRESETS, THREADS)
    }
    for preset in PRESETS:
        for name, of_it in (("measured", wanted(mesh, preset)), ("needed", needed(mesh, preset))):
            rivals[f"{preset}, {name}"] = chained(mesh, get_engine("compiled"), preset, measured=of_it)
    calls = max(2, IN_A_ROW // n)
    seconds = best_of(rivals, max(5, WORK // (calls * n)), calls)
    return n, {name: best / n * 1e9 / STEPS for name, best in seconds.items()}
