"""`make bench`: every suite in one run, or those named: ``make bench ARGS="formats service"``."""

from __future__ import annotations

import argparse
import importlib
import os
import pkgutil
import time
from types import ModuleType

# Ratios are of one thread against one thread; set before anything that computes is loaded.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "VTK_SMP_MAX_THREADS"):
    os.environ.setdefault(name, "1")

import benchmarks  # noqa: E402 - after the threads are set
from benchmarks.machine import description  # noqa: E402

ORDER = ("kernels", "scaling", "roundness", "formats", "service", "page")
PACKAGES = ("numpy", "numba", "scipy", "vtk", "trimesh", "lapy", "celery", "fastapi", "uvicorn")


def suites() -> list[str]:
    """Return the names of the suites, in their order."""
    there = {module.name for module in pkgutil.iter_modules(benchmarks.__path__)}
    return [name for name in ORDER if name in there]


def main() -> None:
    """Run suites, each a module of this folder with a function ``main`` that prints its table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=main.__doc__)
    parser.add_argument("suite", nargs="*", help=f"which: {', '.join(suites())}; all by default")
    wanted = parser.parse_args().suite or suites()
    if unknown := [name for name in wanted if name not in suites()]:
        parser.error(f"there is no {unknown[0]!r}; there are {', '.join(suites())}")
    print(f"On {description(PACKAGES)}.")
    for number, name in enumerate(wanted, 1):
        print(f"\n[{number}/{len(wanted)}] {name}", flush=True)
        suite: ModuleType = importlib.import_module(f"benchmarks.{name}")
        began = time.perf_counter()
        suite.main()
        print(f"({time.perf_counter() - began:.0f} s)", flush=True)


main()
