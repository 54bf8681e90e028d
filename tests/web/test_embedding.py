"""Runs on other people's pages: the custom element, on a page of another origin."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.architecture.source import ROOT
from tests.e2e.api import Api
from tests.stack import Stack, wait_for
from tests.web.browser import OPTIONS, Complaints, chromium

MOVED = """
const viewer = document.querySelector('spherify-viewer');
const place = viewer.parentNode;
viewer.remove();
viewer.setAttribute('iteration', '10');
place.append(viewer);
"""
SENT = """
([address, mesh]) => {
    const form = new FormData();
    form.append('file', new Blob([mesh]), 'foreign.obj');
    return fetch(address, {method: 'POST', mode: 'no-cors', body: form}).then(answer => answer.type);
}
"""
EXAMPLE = ROOT / "docs" / "embedding.html"


class Quiet(SimpleHTTPRequestHandler):
    """Serves a folder and says nothing."""

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 (its name in the library)
        """Say nothing."""


@pytest.fixture
def elsewhere(tmp_path: Path) -> Iterator[tuple[Path, str]]:
    """A folder and the address that another server gives it."""
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(tmp_path))) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield tmp_path, f"http://127.0.0.1:{server.server_port}"
        server.shutdown()
        thread.join()


def test_the_example_page_shows_a_run_and_hears_of_it(
    page: Page, stack: Stack, api: Api, run: str, elsewhere: tuple[Path, str]
) -> None:
    folder, address = elsewhere
    # another site, not only another origin: the frame is a stranger there, and the browser keeps nothing for it
    address = address.replace("127.0.0.1", "localhost")
    last = str(api.job(run)["snapshots"]["available"][-1])
    example = EXAMPLE.read_text("utf-8")
    assert "http://localhost:8000" in example
    example = example.replace("http://localhost:8000", stack.url).replace(
        "job_01K5Z9Q8M4T6V2X0Y7R3N1W5BC", run
    )
    (folder / "index.html").write_text(example)
    page.goto(address)
    frame = page.frame_locator("spherify-viewer iframe")
    expect(frame.locator(".readout b")).to_have_text("5")
    page.evaluate("document.querySelector('spherify-viewer').setAttribute('iteration', '20')")
    expect(frame.locator(".readout b")).to_have_text("20")
    wait_for(lambda: page.locator("output").inner_text() == "iteration 20", what="the page hears of it")
    page.evaluate("document.querySelector('spherify-viewer').removeAttribute('iteration')")
    expect(frame.locator(".readout b")).to_have_text(last)
    page.evaluate("document.querySelector('spherify-viewer').setAttribute('color', 'quality')")
    expect(frame.get_by_label("Legend: Triangle quality")).to_be_visible()
    page.evaluate(MOVED)
    expect(frame.locator(".readout b")).to_have_text("10")  # what it was told while it was away
    page.evaluate("document.querySelector('spherify-viewer').play()")
    expect(frame.get_by_role("button", name="Pause")).to_be_visible()


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost"])
def test_a_page_of_another_origin_starts_no_job(
    *,
    page: Page,
    stack: Stack,
    api: Api,
    animal: bytes,
    elsewhere: tuple[Path, str],
    name: str,
    complaints: Complaints,
) -> None:
    """Without asking: a browser sends forms wherever a page says. To it one of these is of the same site."""
    folder, address = elsewhere
    (folder / "index.html").write_text("<link rel='icon' href='data:,'>another page")
    complaints.expect("403")
    page.goto(address.replace("127.0.0.1", name))
    with page.expect_response(f"{stack.url}/v1/jobs") as answer:
        assert page.evaluate(SENT, [f"{stack.url}/v1/jobs", animal.decode()]) == "opaque"
    assert answer.value.status == 403
    assert "foreign" not in {job["name"] for job in api.http.get("/v1/jobs").json()["items"]}


def test_a_page_that_gives_its_name_to_this_machine_sees_nothing(browser: Browser, stack: Stack) -> None:
    """The browser takes us for that page's own site, as it does once its name is said to be at our address."""
    rule = "--host-resolver-rules=MAP attacker.example 127.0.0.1"
    with browser.browser_type.launch(
        executable_path=chromium(), headless=True, args=[*OPTIONS, rule]
    ) as fooled:
        port = stack.url.rpartition(":")[2]
        answer = fooled.new_page().goto(f"http://attacker.example:{port}/v1/jobs")
        assert answer is not None
        assert answer.status == 421
