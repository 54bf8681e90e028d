"""How many processors this process may use."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

_CGROUP: Final = Path("/sys/fs/cgroup/cpu.max")  # cgroup v2: "quota period", or "max period"


def available_cpus() -> int:
    """Return the processors of this machine, of the affinity mask, or of the container's quota, whichever is least."""
    masked = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    try:
        quota, period = _CGROUP.read_text("ascii").split()
    except (OSError, ValueError):
        return masked
    return masked if quota == "max" else max(1, min(masked, int(quota) // int(period)))
