"""A server of the records that refuses, or accepts and never answers: every route says so, and soon."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack

import httpx
import pytest

from spherify.settings import Settings
from spherify.stores.connect import open_stores
from tests.faults.chaos import ChaosProxy
from tests.faults.polling import Clients
from tests.service.conftest import OCTAHEDRON, problem, serve
from tests.service.test_openapi import DOCUMENT

NEEDS_NOTHING = {"/healthz", "/v1/info", "/v1/presets", "/v1/parameters", "/v1/samples"}
NAMES = {
    "{job_id}": "job_" + "0" * 26,
    "{mesh_id}": "mesh_" + "0" * 26,
    "{which}": "0",
    "{format}": "ply",
    "{field}": "curvature",
    "{sample}": "stone",
}
ROUTES = [
    (method, path)
    for path, methods in DOCUMENT["paths"].items()
    for method in methods
    if path not in NEEDS_NOTHING
]


@pytest.fixture(scope="module", params=["refused", "hung"])
def away(
    request: pytest.FixtureRequest, shared_settings: Settings, server_url: str
) -> Iterator[tuple[str, float]]:
    """A service whose server is away, and within which time it must answer."""
    with ExitStack() as exits:
        address = "redis://127.0.0.1:1/0"
        if request.param == "hung":
            proxy = exits.enter_context(ChaosProxy(server_url))
            proxy.hang()
            address = proxy.url
        settings = shared_settings.model_copy(update={"redis_url": address})
        stores = open_stores(settings)
        exits.callback(stores.close)
        yield exits.enter_context(serve(settings, stores)), 2.0 if request.param == "hung" else 1.0


def ask(url: str, limit_s: float, method: str, path: str) -> httpx.Response:
    """Send what the operation needs; an answer that does not come within the limit is an error of the client."""
    for name, value in NAMES.items():
        path = path.replace(name, value)
    more: dict[str, object] = {}
    if method == "post" and path in {"/v1/jobs", "/v1/meshes"}:
        more["files"] = {"file": ("o.obj", OCTAHEDRON)}
    elif path.endswith("/extend"):
        more["json"] = {"iterations": 5}
    elif method == "put":
        more |= {"content": OCTAHEDRON, "params": {"name": "o.obj"}}
    with httpx.Client(base_url=url, timeout=limit_s, trust_env=False) as client:
        return client.request(method, path, **more)  # type: ignore[arg-type]


@pytest.mark.parametrize(("method", "path"), ROUTES)
def test_every_route_says_so_in_time(away: tuple[str, float], method: str, path: str) -> None:
    answer = ask(*away, method, path)
    problem(answer, 503, "not-ready")
    assert answer.headers["retry-after"]


def test_a_crowd_is_told_as_well(away: tuple[str, float]) -> None:
    """Two hundred at once, of which most wait for a thread."""
    where = httpx.URL(away[0])
    polled = Clients(where.host, where.port or 80, "/v1/jobs", clients=200, period_s=0.01, rounds=1).poll()
    assert polled.errors == ["HTTP/1.1 503 Service Unavailable"] * 200
