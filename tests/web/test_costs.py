"""What the page must not do, whatever the clock says: draw or read meshes on its own thread, load much, or flicker."""

from __future__ import annotations

import gzip
import io
import re

import pytest
from PIL import Image, ImageChops, ImageStat
from playwright.sync_api import Page, Route, expect

from service.site import BUILT
from tests.stack import Stack, wait_for
from tests.web.browser import iteration, settled, worker

FIRST_BYTES = 30_000  # compressed: what is needed before anything can be seen
RENDERER = "WebGLRenderer: Context Lost"  # what it alone says
WATCH = """
window.did = { contexts: [], fetched: [], read: 0 };
const context = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
  did.contexts.push(kind);
  return context.call(this, kind, ...rest);
};
const fetched = window.fetch;
window.fetch = (what, ...rest) => {
  did.fetched.push(String(what));
  return fetched(what, ...rest);
};
const read = Response.prototype.arrayBuffer;
Response.prototype.arrayBuffer = function () {
  did.read += 1;
  return read.call(this);
};
"""


def test_before_the_first_picture_little_is_loaded_and_nothing_that_draws() -> None:
    page = (BUILT / "index.html").read_text("utf-8")
    found = set(re.findall(r'(?:src|href)="/(assets/[^"]+)"', page))
    assert found, "the page loads nothing"
    size = sum(len(gzip.compress((BUILT / name).read_bytes())) for name in found)
    assert size < FIRST_BYTES
    texts = {path.name: path.read_text("utf-8") for path in BUILT.glob("assets/*.js")}
    drawing = {name for name, text in texts.items() if RENDERER in text}
    assert len(drawing) == 2, "the renderer is a worker's, and once more for browsers that have none for it"
    for start in ("new Worker(new URL(`/assets/{}`", "import(`./{}`)"):
        assert any(start.format(name) in text for name in drawing for text in texts.values()), start


EXPECTING = """
window.expected = [];
new MutationObserver(() => {
  const viewer = document.querySelector('.viewer');
  if (!viewer) return;
  const now = viewer.classList.contains('expecting') ? 'ball' : viewer.dataset.drawn;
  if (expected.at(-1) !== now) expected.push(now);
}).observe(document, { attributes: true, childList: true, subtree: true });
"""


@pytest.mark.parametrize("path", ["/", "/embed"])
def test_the_place_of_the_picture_is_held_until_it_is_there(
    page: Page, stack: Stack, run: str, path: str
) -> None:
    page.add_init_script(EXPECTING)
    page.goto(f"{stack.url}{path}?job={run}&it=5")
    settled(page)
    seen = page.evaluate("expected")
    assert seen[0] == "ball"
    assert "ball" not in seen[1:]  # it is gone with the first picture, and does not come back


SEEN = """
window.seen = [];
new MutationObserver(() => {
  const viewer = document.querySelector('.viewer');
  const note = document.querySelector('.over')?.textContent.trim();
  seen.push(!viewer ? 'nothing' : viewer.classList.contains('expecting') ? 'ball' : note || viewer.dataset.drawn);
}).observe(document, { attributes: true, characterData: true, childList: true, subtree: true });
"""


def test_the_preview_of_a_file_stays_until_what_the_service_has_is_drawn(
    page: Page, stack: Stack, animal: bytes
) -> None:
    held: list[Route] = []

    def hold(route: Route) -> None:
        held.append(route)

    def picture() -> Image.Image:
        return Image.open(io.BytesIO(page.locator(".viewer").screenshot())).convert("RGB")

    page.route(re.compile("/v1/meshes[?]"), hold)
    page.goto(stack.url)
    page.locator("input[type=file]").set_input_files(
        {"name": "cat.obj", "mimeType": "model/obj", "buffer": animal}
    )
    settled(page)
    canvas = page.locator(".viewer canvas")
    canvas.focus()
    for key in ("ArrowLeft", "ArrowLeft", "ArrowLeft", "ArrowUp", "+", "+"):
        page.keyboard.press(key)
    settled(page)
    preview, before = canvas.element_handle(), picture()
    page.evaluate(SEEN)
    wait_for(lambda: held, what="the file is sent")
    held[0].continue_()
    expect(page.locator(".report .good")).to_have_count(3)
    wait_for(lambda: "no" in page.evaluate("seen"), what="the surface of the service is put in")
    settled(page)
    assert set(page.evaluate("seen")) <= {"no", "yes"}  # no ball, no note, and never without a picture
    assert canvas.evaluate("(canvas, preview) => canvas === preview", preview)
    difference = ImageChops.difference(before, picture())
    assert max(ImageStat.Stat(difference).mean) < 0.8, "the camera stands elsewhere"


def test_a_canvas_is_handed_on_from_view_to_view_and_keeps_nothing(
    page: Page, stack: Stack, run: str
) -> None:
    def picture() -> Image.Image:
        return Image.open(io.BytesIO(page.locator(".viewer").screenshot())).convert("RGB")

    page.goto(f"{stack.url}/?job={run}&it=5&up=z&color=curvature&wire=1")
    settled(page)
    canvas, before = page.locator(".viewer canvas").element_handle(), picture()
    for _ in range(2):
        page.get_by_role("link", name="Spherify").click()
        expect(page.locator(".hero .viewer canvas")).to_have_count(1)
        settled(page)
        assert page.locator(".viewer canvas").evaluate("(one, other) => one === other", canvas)
        page.go_back()
        expect(page.locator(".work .viewer canvas")).to_have_count(1)
        settled(page)
        assert page.locator(".viewer canvas").evaluate("(one, other) => one === other", canvas)
        assert max(ImageStat.Stat(ImageChops.difference(before, picture())).mean) < 0.8


CANVASES = """
window.canvases = 0;
const handed = HTMLCanvasElement.prototype.transferControlToOffscreen;
HTMLCanvasElement.prototype.transferControlToOffscreen = function () {
  canvases += 1;
  return handed.call(this);
};
self.OffscreenCanvas = new Proxy(OffscreenCanvas, {
  construct: (made, how) => (canvases += 1, new made(...how)),
});
"""


def test_small_pictures_need_no_canvas_and_what_plays_rests_while_a_file_is_chosen(
    page: Page, stack: Stack, run: str
) -> None:
    page.emulate_media(reduced_motion="no-preference")
    page.add_init_script(CANVASES)
    page.goto(stack.url)
    pause = page.locator(".hero").get_by_role("button", name="Pause")
    expect(pause).to_be_visible()
    expect(page.locator(".run img").first).to_be_visible()
    assert page.evaluate("canvases") == 1
    with page.expect_file_chooser():
        page.locator(".drop").click()
    expect(pause).to_have_count(0)
    page.locator("input[type=file]").dispatch_event("cancel")
    expect(pause).to_be_visible()


def test_its_own_thread_neither_draws_nor_reads_meshes(page: Page, stack: Stack, run: str) -> None:
    page.context.add_init_script(WATCH)
    page.goto(f"{stack.url}/?job={run}&it=0&up=z&color=curvature")
    settled(page)
    before = iteration(page)
    page.keyboard.press("ArrowRight")
    settled(page)
    assert iteration(page) > before
    expect(page.locator(".run img").first).to_be_visible()  # small pictures come from the worker, too
    did = page.evaluate("did")
    assert did["contexts"] == []  # the first one has the thread wait for the graphics card, a flat one too
    assert did["fetched"], "the page asks the service by fetch"
    assert not [one for one in did["fetched"] if re.search(r"/(topology|positions|fields)\b", one)]
    assert did["read"] == 0
    assert worker(page, "reading").evaluate("performance.getEntriesByType('resource').length") > 3
