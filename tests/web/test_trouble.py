"""When something is wrong: a broken mesh, a service that goes away, a picture that is lost, an address of nothing."""

from __future__ import annotations

import io
import re
import signal

import httpx
import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Page, Route, expect

from tests.e2e.api import Api
from tests.e2e.test_readme import BOX_WITHOUT_A_LID
from tests.stack import QUICK, Stack, started_stack, wait_for
from tests.web.browser import Complaints, address, iteration, settled, status, worker

NETWORK = r"Failed to load resource: (net::ERR|the server responded with a status of (404|410|422|503))"


def red_pixels(page: Page) -> int:
    """Count the pixels of the picture that are the red of faults."""
    picture = Image.open(io.BytesIO(page.locator(".viewer canvas").screenshot())).convert("RGB")
    r, g, b = np.moveaxis(np.asarray(picture), 2, 0)
    return int(((r > 170) & (g < 90) & (b < 90)).sum())


def test_a_refused_mesh_shows_where_it_is_broken_and_the_cure(
    page: Page, complaints: Complaints, stack: Stack
) -> None:
    complaints.expect(NETWORK)
    page.goto(stack.url)
    box = {"name": "box.obj", "mimeType": "model/obj", "buffer": BOX_WITHOUT_A_LID}
    page.locator("input[type=file]").set_input_files(box)
    refusal = page.get_by_label("Why it was refused")
    expect(refusal).to_contain_text("4 edges have one face only")
    expect(refusal).to_contain_text("req_")
    expect(page.locator(".report .bad")).to_contain_text("1 hole")
    wait_for(lambda: red_pixels(page) > 50, what="the open edges in red")
    page.get_by_role("button", name="Morph it with its holes").click()
    expect(page.get_by_role("button", name="Run")).to_be_visible()
    wait_for(lambda: red_pixels(page) == 0, what="the mesh as it was let in, with nothing marked")


def test_what_cannot_be_read_is_said_in_the_services_words(
    page: Page, complaints: Complaints, stack: Stack
) -> None:
    complaints.expect(NETWORK)
    page.goto(stack.url)
    nothing = {"name": "nothing.obj", "mimeType": "model/obj", "buffer": b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"}
    page.locator("input[type=file]").set_input_files(nothing)
    expect(page.get_by_role("alert")).to_contain_text("The file has no faces")
    expect(page.get_by_role("alert")).to_contain_text("nothing.obj")
    expect(page.locator(".note")).to_contain_text("No preview")
    expect(page.get_by_role("button", name="Turn upright")).to_have_count(0)  # there is nothing to turn
    box = {"name": "box.obj", "mimeType": "model/obj", "buffer": BOX_WITHOUT_A_LID}
    page.locator("input[type=file]").set_input_files(box)  # another one, from here
    expect(page.get_by_label("Why it was refused")).to_contain_text("4 edges have one face only")


def test_the_same_bytes_under_another_name_have_that_name_here(
    page: Page, stack: Stack, api: Api, animal: bytes
) -> None:
    first = api.http.post("/v1/meshes", files={"file": ("first.obj", animal + b"# once more\n")}).json()
    page.goto(stack.url)
    again = {"name": "my second.obj", "mimeType": "model/obj", "buffer": animal + b"# once more\n"}
    page.locator("input[type=file]").set_input_files(again)
    expect(page).to_have_url(f"{stack.url}/?mesh={first['id']}&up=y&name=my+second.obj")
    expect(page.get_by_role("heading", name="my second.obj", level=2)).to_be_visible()
    expect(page.get_by_label("Name", exact=True)).to_have_value("my second")


def test_a_run_is_followed_although_its_events_cannot_be_had_at_first(
    page: Page, complaints: Complaints, stack: Stack, api: Api, stone: bytes
) -> None:
    complaints.expect(NETWORK)
    at_rest: list[bool] = []

    def busy(route: Route) -> None:
        if at_rest:
            route.continue_()
            return
        route.fulfill(
            status=503, headers={"Retry-After": "1"}, content_type="application/problem+json", body="{}"
        )

    page.route("**/events", busy)
    fields = {"preset": "paper", "step": "1e-6", "iterations": "900000", "name": "busy"}
    job = api.http.post("/v1/jobs", files={"file": ("stone.obj", stone)}, data=fields).json()
    page.goto(f"{stack.url}/?job={job['id']}")
    expect(page.get_by_text("asking every second")).to_be_visible()
    at_rest.append(True)
    expect(page.get_by_text("asking every second")).to_have_count(0)
    page.get_by_role("button", name="Cancel", exact=True).click()
    expect(status(page)).to_have_text("Cancelled")


def test_small_pictures_come_once_a_service_that_was_away_is_back(
    page: Page, complaints: Complaints, stack: Stack, run: str
) -> None:
    complaints.expect(NETWORK)
    turned_away: list[Route] = []

    def busy(route: Route) -> None:
        if turned_away:
            route.continue_()
            return
        turned_away.append(route)
        route.fulfill(status=503, content_type="application/problem+json", body="{}")

    page.route(f"**/v1/jobs/{run}/snapshots/initial/positions*", busy)
    page.goto(stack.url)
    page.get_by_label("Only with this tag").fill("gallery")
    page.get_by_label("Only with this tag").blur()
    expect(page.locator(".run", has_text="animal").locator("img")).to_be_visible()
    assert turned_away


def test_an_address_of_nothing_says_so(page: Page, complaints: Complaints, stack: Stack) -> None:
    complaints.expect(NETWORK)
    page.goto(f"{stack.url}/?job=job_01K5Z9Q8M4T6V2X0Y7R3N1W5BC")
    expect(page.get_by_role("alert")).to_contain_text("job_01K5Z9Q8M4T6V2X0Y7R3N1W5BC")
    page.goto(f"{stack.url}/?compare=job_01K5Z9Q8M4T6V2X0Y7R3N1W5BC@3,cat")
    expect(page.get_by_role("alert")).to_contain_text("“cat” is not the id of a run")
    expect(page).to_have_title(re.compile("leads nowhere"))
    page.get_by_role("link", name="To the first page").click()
    expect(page.get_by_role("heading", level=1)).to_be_focused()
    expect(page).to_have_url(f"{stack.url}/")


def test_what_is_answered_after_one_has_left_leads_nowhere(page: Page, stack: Stack, run: str) -> None:
    held: list[Route] = []
    page.route("**/v1/jobs?dry_run=true", lambda route: held.append(route))  # noqa: PLW0108 - a builtin is not taken
    page.goto(f"{stack.url}/?job={run}&it=5")
    settled(page)
    with page.expect_request("**/v1/jobs?dry_run=true"):
        page.get_by_role("button", name="From here").click()
    page.get_by_role("link", name="Spherify").click()
    expect(page.get_by_role("heading", level=1)).to_be_focused()
    with page.expect_response("**/v1/jobs?dry_run=true"):
        held[0].continue_()
    page.evaluate("new Promise((seen) => requestAnimationFrame(() => requestAnimationFrame(seen)))")
    assert address(page) == f"{stack.url}/"


def test_what_of_an_address_cannot_be_followed_is_named(page: Page, stack: Stack, run: str) -> None:
    page.goto(f"{stack.url}/?job={run}&it=5&color=pink&k=3")
    note = page.locator(".banner")
    expect(note.locator("code")).to_have_text(["color=pink", "k=3"])
    settled(page)
    assert iteration(page) == 5
    page.get_by_role("button", name="Close this note").click()
    expect(note).to_have_count(0)


def test_a_browser_whose_workers_cannot_draw_has_the_same_picture(
    page: Page, complaints: Complaints, stack: Stack, run: str
) -> None:
    address = f"{stack.url}/?job={run}&it=5&up=z"
    page.goto(address)
    settled(page)
    plain = page.context.new_page()
    complaints.watch(plain)
    plain.add_init_script("delete window.OffscreenCanvas")
    plain.goto(address)
    settled(plain)
    assert [one.evaluate("self.name") for one in plain.workers] == ["reading"]
    expect(plain.locator(".run img").first).to_be_visible()
    canvas, other = (one.locator(".viewer canvas") for one in (page, plain))
    wait_for(lambda: difference(canvas.screenshot(), other.screenshot()) < 1, what="the same picture")
    with plain.expect_download() as download:
        plain.get_by_role("button", name="Picture", exact=True).last.click()
    assert Image.open(download.value.path()).getextrema() != ((0, 0),) * 4
    plain.close()


def test_on_a_finer_screen_the_picture_is_finer(page: Page, stack: Stack, run: str) -> None:
    page.goto(f"{stack.url}/?job={run}&it=5&up=z")
    settled(page)
    width = "document.querySelector('.viewer canvas').width"
    before = page.evaluate(width)
    screen = {"width": 1440, "height": 900, "mobile": False}
    session = page.context.new_cdp_session(page)
    session.send("Emulation.setDeviceMetricsOverride", screen | {"deviceScaleFactor": 2})
    page.keyboard.press("w")  # the browser tells of a screen, but not of one that is made up
    wait_for(lambda: page.evaluate(width) == 2 * before, what="twice as many pixels")


HIDE = """(hidden) => {
  Object.defineProperty(document, 'hidden', { configurable: true, get: () => hidden });
  document.dispatchEvent(new Event('visibilitychange'));
}"""


def test_while_nobody_looks_nothing_is_asked_and_then_nothing_was_missed(
    page: Page, stack: Stack, api: Api, stone: bytes
) -> None:
    fields = {
        "preset": "paper",
        "step": "1e-6",
        "iterations": "900000",
        "snapshots": "every:20000",
        "name": "unseen",
    }
    job = api.http.post("/v1/jobs", files={"file": ("stone.obj", stone)}, data=fields).json()
    page.add_init_script(
        "const News = EventSource; EventSource = class extends News { heard = opened.push(this) }"
    )
    page.add_init_script("window.opened = []")
    page.goto(f"{stack.url}/?job={job['id']}")
    expect(status(page)).to_have_text("Running")
    settled(page)
    page.evaluate(HIDE, True)  # a browser without a screen has no tab behind another
    assert page.evaluate("opened.map((one) => one.readyState)") == [2]
    api.http.post(f"/v1/jobs/{job['id']}/cancel")
    ended = api.finished(job["id"])
    expect(status(page)).to_have_text("Running")
    page.evaluate(HIDE, False)
    expect(status(page)).to_have_text("Cancelled")
    wait_for(lambda: iteration(page) == ended["snapshots"]["available"][-1], what="the newest state")


CONTEXTS = """() => {
  const clear = WebGL2RenderingContext.prototype.clear;
  WebGL2RenderingContext.prototype.clear = function (...what) {
    if (this.canvas.width > 192) self.context = this; // no thumbnails
    return clear.apply(this, what);
  };
}"""


def test_a_lost_picture_comes_back(page: Page, stack: Stack, run: str) -> None:
    page.goto(f"{stack.url}/?job={run}&it=5&up=z")
    settled(page)
    drawing = worker(page, "drawing")
    drawing.evaluate(CONTEXTS)
    canvas = page.locator(".viewer canvas")
    canvas.press("ArrowLeft")
    canvas.press("ArrowRight")
    wait_for(lambda: drawing.evaluate("'context' in self"), what="the context is known by what it draws")
    settled(page)
    canvas.blur()  # its frame is no part of the picture
    before, first = canvas.screenshot(), canvas.element_handle()
    drawing.evaluate("self.loss = self.context.getExtension('WEBGL_lose_context')")
    drawing.evaluate("self.loss.loseContext()")
    expect(page.locator(".note")).to_contain_text("took the picture away")
    page.get_by_role("button", name="Picture", exact=True).last.click()
    expect(page.get_by_text("The picture could not be made")).to_be_visible()
    drawing.evaluate("self.loss.restoreContext()")
    expect(page.locator(".note")).to_have_count(0)
    wait_for(lambda: difference(before, canvas.screenshot()) < 1, what="the same picture again")

    drawing.evaluate("self.loss.loseContext()")
    expect(page.locator(".note")).to_contain_text("took the picture away")
    page.get_by_role("link", name="Spherify").click()
    page.go_back()
    settled(page)
    assert not canvas.evaluate("(one, other) => one === other", first), "a lost one is not handed on"
    wait_for(lambda: difference(before, canvas.screenshot()) < 1, what="the same picture on another one")


def test_a_service_that_was_restarted_in_mid_run_is_found_again(
    page: Page, complaints: Complaints, stone: bytes, tmp_path_factory: pytest.TempPathFactory
) -> None:
    complaints.expect(NETWORK)
    complaints.expect("ERR_")
    with started_stack(tmp_path_factory.mktemp("restart"), api=False, environment=QUICK) as stack:
        process = stack.start_api()
        api = Api(stack.url)
        fields = {
            "preset": "paper",
            "step": "1e-6",
            "iterations": "900000",
            "snapshots": "every:20000",
            "name": "long",
        }
        answer = api.http.post("/v1/jobs", files={"file": ("stone.obj", stone)}, data=fields)
        page.goto(f"{stack.url}/?job={answer.json()['id']}&it=0")
        expect(status(page)).to_have_text("Running")
        settled(page)
        process.send_signal(signal.SIGKILL)
        process.wait(10)
        expect(page.get_by_role("alert")).to_contain_text("The service does not answer")
        assert iteration(page) == 0
        stack.start_api(httpx.URL(stack.url).port)
        expect(page.locator(".banner")).to_have_count(0)
        reached = api.job(answer.json()["id"])["progress"]["iteration"]

        def shown() -> int:
            text = page.locator(".going span").first.inner_text()
            return int(re.sub(r"\D", "", text.split(" of")[0]))  # five digits are grouped

        wait_for(lambda: shown() > reached, limit_s=60, what="the run goes on before our eyes")
        page.get_by_role("button", name="Cancel", exact=True).click()
        expect(status(page)).to_have_text("Cancelled")
        api.http.close()


def difference(one: bytes, other: bytes) -> float:
    """Return by how much two pictures differ, from 0 to 255, seen from afar: antialiasing does not count."""
    from PIL import ImageChops, ImageStat

    small = [Image.open(io.BytesIO(data)).convert("L").resize((96, 72)) for data in (one, other)]
    return float(ImageStat.Stat(ImageChops.difference(*small)).mean[0])
