"""One browser for the whole folder, and a page in it for each test."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect, sync_playwright

from spherify.formats import write_mesh
from spherify.geometry.samples import SAMPLES
from tests.e2e.api import Api
from tests.stack import Stack
from tests.web.browser import LIMIT_MS, NONE, OPTIONS, Complaints, built, chromium

expect.set_options(timeout=LIMIT_MS)


@pytest.fixture(scope="package")  # Playwright's event loop would be in the way of other folders' tests
def browser() -> Iterator[Browser]:
    """The system's Chromium; without one these tests are left out, loudly."""
    path = chromium()
    if path is None:
        pytest.skip(NONE)
    assert built(), "the web page is not built: `make setup`"
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, headless=True, args=OPTIONS)
        yield browser
        browser.close()


@pytest.fixture
def context(browser: Browser) -> Iterator[BrowserContext]:
    """A visitor with nothing kept from before."""
    context = browser.new_context(
        viewport={"width": 1440, "height": 900}, reduced_motion="reduce", color_scheme="light"
    )
    context.set_default_timeout(LIMIT_MS)
    yield context
    context.close()


@pytest.fixture
def complaints() -> Iterator[Complaints]:
    """What the browser complained about: nothing, unless the test expects it."""
    complaints = Complaints()
    yield complaints
    assert not complaints.unexpected()


@pytest.fixture
def page(context: BrowserContext, complaints: Complaints) -> Page:
    """An empty page."""
    page = context.new_page()
    complaints.watch(page)
    return page


@pytest.fixture(scope="session")
def api(stack: Stack) -> Iterator[Api]:
    api = Api(stack.url)
    yield api
    api.http.close()


@pytest.fixture(scope="session")
def animal() -> bytes:
    """A sample as a file: it has ears, legs and a tail, and is round in a moment."""
    return write_mesh(SAMPLES["quadruped"].build(300), "obj")


@pytest.fixture(scope="session")
def stone() -> bytes:
    """A sample that `paper` goes on with for as long as it may, by steps so small that nothing breaks."""
    return write_mesh(SAMPLES["stone"].build(4000), "obj")


@pytest.fixture(scope="session")
def run(api: Api, animal: bytes) -> str:
    """The id of a finished run of the sample."""
    fields = {"iterations": "60", "snapshots": "1,2,5,10,20,40", "name": "animal", "tags": "gallery"}
    answer = api.http.post("/v1/jobs", files={"file": ("animal.obj", animal)}, data=fields)
    assert answer.status_code == 201, answer.text
    return str(api.finished(answer.json()["id"])["id"])
