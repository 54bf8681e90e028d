"""The web page's files: what they are sent with, and what a service without them says."""

from __future__ import annotations

from pathlib import Path

import anyio
import httpx
import pytest
from fastapi import FastAPI

from service.answers import add_handlers
from service.middleware import ErrorGuard, RequestContext
from service.routes import site as routes
from service.site import NOT_BUILT, Site
from tests.service.conftest import problem

SCRIPT = "export const answer = 42;\n" * 40


class Browser:
    """Asks an application without a server."""

    def __init__(self, app: FastAPI) -> None:
        self._app = app

    def get(self, path: str, headers: dict[str, str] | None = None) -> httpx.Response:
        async def ask() -> httpx.Response:
            transport = httpx.ASGITransport(self._app)
            async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as client:
                return await client.get(path, headers=headers)

        return anyio.run(ask)


def _browser(folder: Path) -> Browser:
    app = FastAPI()
    app.include_router(routes.router)
    app.state.site = Site(folder)
    app.state.methods_at = lambda _: {"GET"}
    app.add_middleware(ErrorGuard)
    app.add_middleware(RequestContext)
    add_handlers(app)
    return Browser(app)


@pytest.fixture
def built(tmp_path: Path) -> Browser:
    """A service with a small page."""
    (tmp_path / "assets").mkdir()
    (tmp_path / "index.html").write_text("<!doctype html>" + " page" * 100)
    (tmp_path / "embed.html").write_text("<!doctype html>frame")
    (tmp_path / "icon.svg").write_text("<svg/>")
    (tmp_path / "spherify-viewer.js").write_text(SCRIPT)
    (tmp_path / "assets" / "main-1a2b.js").write_text(SCRIPT)
    return _browser(tmp_path)


def test_pages_are_looked_at_again_and_hold_nothing_from_elsewhere(built: Browser) -> None:
    answer = built.get("/?job=job_1")
    assert answer.headers["cache-control"] == "no-cache"
    policy = answer.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert "http" not in policy
    assert policy.endswith("frame-ancestors 'self'")
    assert built.get("/embed").headers["content-security-policy"].endswith("frame-ancestors *")


def test_assets_are_kept_for_ever_and_come_compressed(built: Browser) -> None:
    plain = built.get("/assets/main-1a2b.js", headers={"Accept-Encoding": "identity"})
    zipped = built.get("/assets/main-1a2b.js", headers={"Accept-Encoding": "gzip"})
    assert "immutable" in plain.headers["cache-control"]
    assert plain.headers["content-type"] == "text/javascript; charset=utf-8"
    assert plain.text == zipped.text == SCRIPT
    assert zipped.headers["content-encoding"] == "gzip"
    assert int(zipped.headers["content-length"]) < int(plain.headers["content-length"])
    assert plain.headers["etag"] != zipped.headers["etag"]
    assert plain.headers["vary"] == zipped.headers["vary"] == "Accept-Encoding"


def test_what_the_browser_has_is_not_sent_again(built: Browser) -> None:
    etag = built.get("/").headers["etag"]
    problem(built.get("/", headers={"If-Match": '"nope"'}), 412, "precondition-failed")
    answer = built.get("/", headers={"If-None-Match": etag})
    assert (answer.status_code, answer.content) == (304, b"")
    assert answer.headers["etag"] == etag


def test_the_element_may_be_loaded_by_any_page(built: Browser) -> None:
    answer = built.get("/spherify-viewer.js")
    assert answer.headers["access-control-allow-origin"] == "*"
    assert answer.headers["cache-control"] == "no-cache"


@pytest.mark.parametrize("path", ["/assets/none.js", "/assets/..%2Findex.html", "/assets/..%2F..%2Fsite.py"])
def test_nothing_else_is_handed_out(built: Browser, path: str) -> None:
    answer = built.get(path)
    assert answer.status_code == 404
    assert answer.json()["type"] == "/problems/not-found"


def test_a_service_without_its_page_says_how_to_build_it(tmp_path: Path) -> None:
    browser = _browser(tmp_path / "nowhere")
    page = browser.get("/")
    assert page.status_code == 200
    assert NOT_BUILT.replace("`make setup`", "<code>make setup</code>") in page.text
    assert browser.get("/embed").json()["detail"] == NOT_BUILT


def test_the_real_page_loads_nothing_from_another_host(client: httpx.Client) -> None:
    page = client.get("/").text
    assert "https://" not in page
    assert client.get("/embed").status_code == 200
