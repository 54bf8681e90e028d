"""What campaigns submit, made once."""

from __future__ import annotations

import pytest

from tests.faults.specimens import Specimen, some


@pytest.fixture(scope="session")
def specimens(tmp_path_factory: pytest.TempPathFactory) -> list[Specimen]:
    """Some uploads, and what must come back."""
    return some(tmp_path_factory.mktemp("specimens"))
