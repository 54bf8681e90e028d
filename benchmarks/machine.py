"""What the figures were taken on."""

from __future__ import annotations

import os
import platform
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path


def description(packages: Sequence[str]) -> str:
    """Return one sentence: processor, processors in use, system, Python, and versions of packages."""
    versions = ", ".join(f"{package} {version(package)}" for package in packages)
    return f"{_processor()}, {_usable()} cores, {platform.system()}, Python {platform.python_version()}, {versions}"


def _processor() -> str:
    """Return the name of the processor."""
    information = Path("/proc/cpuinfo")
    if information.exists():
        for line in information.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _usable() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
