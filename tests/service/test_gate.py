"""What a page of another site may have a browser do, and under which names the service is there."""

from __future__ import annotations

from collections.abc import Iterator

import httpx
import pytest

from service.gate import is_loopback, name_of
from spherify.settings import Settings
from spherify.stores.connect import Stores
from tests.service.conftest import OCTAHEDRON, problem, serve

GOOD = "https://good.example"


@pytest.fixture(scope="module")
def open_url(shared_settings: Settings, shared_stores: Stores) -> Iterator[str]:
    """A service that pages of one origin may use."""
    with serve(shared_settings.model_copy(update={"cors_origins": [GOOD]}), shared_stores) as url:
        yield url


@pytest.fixture(scope="module")
def local_url(shared_settings: Settings, shared_stores: Stores) -> Iterator[str]:
    """A service for its own machine."""
    with serve(shared_settings, shared_stores, loopback="Machine.lan") as url:
        yield url


@pytest.fixture(scope="module")
def named_url(shared_settings: Settings, shared_stores: Stores) -> Iterator[str]:
    """A service for other machines too, whose names were set."""
    names = {"allowed_hosts": ["Spheres.example", "api"]}
    with serve(shared_settings.model_copy(update=names), shared_stores) as url:
        yield url


def told(**fetch: str) -> dict[str, str]:
    return {f"Sec-Fetch-{name.title()}": value for name, value in fetch.items()}


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
@pytest.mark.parametrize("origin", ["https://evil.example", "null", None])
def test_a_page_of_another_site_starts_nothing(
    client: httpx.Client, known: str, site: str, origin: str | None
) -> None:
    """As a form or a script sends it without asking first; of a script that asks, the browser hears no from CORS."""
    headers = told(site=site, mode="no-cors") | ({"Origin": origin} if origin else {})
    answer = client.post("/v1/jobs", files={"file": ("o.obj", OCTAHEDRON)}, headers=headers)
    detail = str(problem(answer, 403, "cross-site")["detail"])
    assert "SPHERIFY_CORS_ORIGINS" in detail
    assert (origin or "another site") in detail
    problem(client.delete(f"/v1/meshes/{known}", headers=headers), 403, "cross-site")
    problem(client.put("/v1/meshes?name=o.obj", content=OCTAHEDRON, headers=headers), 403, "cross-site")
    assert client.get("/v1/jobs", headers=headers).json()["items"] == []


@pytest.mark.parametrize("site", ["same-origin", "none", None])
def test_our_own_pages_and_programs_may(client: httpx.Client, known: str, site: str | None) -> None:
    headers = {} if site is None else told(site=site)
    assert client.post("/v1/jobs", json={"mesh_id": known}, headers=headers).status_code == 201


def test_pages_of_a_listed_origin_may(open_url: str, stores: Stores, known: str) -> None:
    def send(origin: str) -> httpx.Response:
        headers = told(site="cross-site") | {"Origin": origin}
        return httpx.post(f"{open_url}/v1/jobs", json={"mesh_id": known}, headers=headers)

    answer = send(GOOD)
    assert answer.status_code == 201
    assert answer.headers["access-control-allow-origin"] == GOOD
    problem(send("https://evil.example"), 403, "cross-site")


@pytest.mark.parametrize("host", ["attacker.example", "attacker.example:8000", "127.0.0.1.attacker.example"])
def test_a_name_that_was_made_to_stand_for_this_machine_is_refused(
    local_url: str, stores: Stores, host: str
) -> None:
    for path in ("/v1/jobs", "/", "/docs"):
        found = problem(httpx.get(local_url + path, headers={"Host": host}), 421, "unknown-host")
        assert "SPHERIFY_ALLOWED_HOSTS" in str(found["detail"])
    assert httpx.get(f"{local_url}/readyz", headers={"Host": host}).status_code == 200, "whoever probes, may"


@pytest.mark.parametrize(
    "host",
    ["localhost:8000", "LOCALHOST.", "a.localhost", "127.0.0.2:80", "[::1]:8000", "machine.lan", "10.0.0.1"],
)
def test_names_of_this_machine_and_addresses_are_taken(local_url: str, stores: Stores, host: str) -> None:
    """An address too that is not its own, as behind a forwarded port: no server of names can have lied about it."""
    assert httpx.get(f"{local_url}/v1/jobs", headers={"Host": host}).status_code == 200


@pytest.mark.parametrize(
    ("host", "status"),
    [("spheres.EXAMPLE:443", 200), ("api", 200), ("localhost", 200), ("other.example", 421)],
)
def test_names_that_are_set_are_the_only_ones(named_url: str, stores: Stores, host: str, status: int) -> None:
    assert httpx.get(f"{named_url}/v1/jobs", headers={"Host": host}).status_code == status


def test_who_listens_for_others_has_names_it_does_not_know(client: httpx.Client, settings: Settings) -> None:
    assert client.get("/v1/jobs", headers={"Host": "whatever.example"}).status_code == 200


def test_any_name_may_be_let_in(settings: Settings, stores: Stores) -> None:
    changed = settings.model_copy(update={"allowed_hosts": ["*"]})
    with serve(changed, stores, loopback="127.0.0.1") as url:
        assert httpx.get(f"{url}/v1/jobs", headers={"Host": "whatever.example"}).status_code == 200


def test_names_are_set_as_one_text(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SPHERIFY_ALLOWED_HOSTS", "a.example, b.example")
    assert Settings().allowed_hosts == ["a.example", "b.example"]


@pytest.mark.parametrize(
    ("host", "name"),
    [("A:80", "a"), ("a.", "a"), ("[::1]:80", "::1"), ("[::1]", "::1"), ("127.0.0.1", "127.0.0.1"), ("", "")],
)
def test_the_name_in_a_host_header(host: str, name: str) -> None:
    assert name_of(host) == name


@pytest.mark.parametrize(
    ("name", "own"),
    [
        ("localhost", True),
        ("a.localhost", True),
        ("127.8.9.1", True),
        ("::1", True),
        ("0.0.0.0", False),
        ("10.0.0.1", False),
        ("notlocalhost", False),
        ("localhost.example", False),
        ("", False),
    ],
)
def test_what_is_this_machine_whatever_anybody_says(name: str, own: bool) -> None:
    assert is_loopback(name) is own
