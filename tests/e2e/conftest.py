"""A client of the started stack."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.e2e.api import Api
from tests.stack import Stack


@pytest.fixture(scope="session")
def api(stack: Stack) -> Iterator[Api]:
    api = Api(stack.url)
    yield api
    api.http.close()
