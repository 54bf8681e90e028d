"""Real meshes for tests on machines that have them; elsewhere those tests are skipped."""

from __future__ import annotations

from pathlib import Path

import pytest

SHARED = Path(__file__).resolve().parents[2] / "shared" / "meshes"


def shared_mesh(name: str) -> Path:
    """Return the path of one shared mesh, or skip the test that asked for it."""
    path = SHARED / name
    if not path.exists():
        pytest.skip(f"{name} is not on this machine")
    return path
