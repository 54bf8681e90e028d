"""The service's routes, and its committed description."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from fastapi.routing import iter_route_contexts

from service.app import create_app
from spherify.settings import Settings
from tests.architecture.source import ROOT


@pytest.fixture(scope="session")
def routes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, set[str]]:
    """Methods by path, as the service knows them."""
    app = create_app(Settings(data_dir=Path(tmp_path_factory.mktemp("data"))))
    found: dict[str, set[str]] = {}
    for context in iter_route_contexts(app.routes):
        if context.path is not None:
            found.setdefault(context.path, set()).update(context.methods or ())
    return found


@pytest.fixture(scope="session")
def description() -> dict[str, Any]:
    """openapi/openapi.json."""
    return dict(json.loads((ROOT / "openapi" / "openapi.json").read_text("utf-8")))
