"""`make bench`: what a step costs, as ratios taken in one run."""

from __future__ import annotations

import os

# Ratios are of one thread against one thread; set before anything that computes is loaded.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "VTK_SMP_MAX_THREADS"):
    os.environ.setdefault(name, "1")

from benchmarks import kernels  # noqa: E402 - after the threads are set

kernels.main()
