"""Every view in light, dark and on a phone: a picture of each, and nothing serious for axe to find."""

from __future__ import annotations

import io
import json
import re
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect
from pypdf import PdfReader

from tests.architecture.source import ROOT
from tests.e2e.api import Api
from tests.stack import Stack
from tests.web.browser import LIMIT_MS, PICTURES, Complaints, settled

AXE = ROOT / "service" / "web" / "node_modules" / "axe-core" / "axe.min.js"
SIZES = {"light": (1440, 900), "dark": (1440, 900), "phone": (390, 844)}


def _views(run: str, mesh: str) -> dict[str, str]:
    return {
        "home": "/",
        "mesh": f"/?mesh={mesh}&up=z",
        "job": f"/?job={run}&it=10&up=z",
        "colours": f"/?job={run}&it=20&up=z&color=distance&wire=1",
        "compare": f"/?compare={run}@0,{run}@20&up=z",
        "embed": f"/embed?job={run}&it=5&up=z",
    }


def serious(found: dict[str, Any]) -> list[str]:
    """Name what axe takes for serious, and where."""
    return [
        f"{one['id']}: {node['html'][:160]} {node['failureSummary'][:200]}"
        for one in found["violations"]
        if one["impact"] in {"serious", "critical"}
        for node in one["nodes"]
    ]


@pytest.mark.timeout(240)
@pytest.mark.parametrize("look", SIZES)
def test_every_view_is_drawn_and_open_to_all(
    *, browser: Browser, complaints: Complaints, stack: Stack, api: Api, run: str, look: str
) -> None:
    width, height = SIZES[look]
    theme = "dark" if look == "dark" else "light"
    # axe is put into the page from outside, which the page's own policy would not let anybody do
    context = browser.new_context(
        viewport={"width": width, "height": height},
        color_scheme=theme,
        reduced_motion="reduce",
        bypass_csp=True,
    )
    context.set_default_timeout(LIMIT_MS)
    page = context.new_page()
    complaints.watch(page)
    PICTURES.mkdir(exist_ok=True)
    for name, path in _views(run, api.job(run)["mesh_id"]).items():
        page.goto(stack.url + path)
        settled(page)
        if name != "embed":
            expect(page.locator(".run").first).to_be_attached()
        page.screenshot(path=PICTURES / f"{name}-{look}.png")
        page.add_script_tag(path=AXE)
        found = page.evaluate("axe.run({ resultTypes: ['violations'] })")
        assert not serious(found), f"{name}: {json.dumps(serious(found), indent=1)}"
        overflow = page.evaluate("document.documentElement.scrollWidth - innerWidth")
        assert overflow <= 0, f"{name} is wider than the screen by {overflow}"
    context.close()


def test_on_paper_a_run_is_its_picture_its_figures_and_its_chart(
    browser: Browser, stack: Stack, run: str
) -> None:
    context = browser.new_context(viewport={"width": 1440, "height": 900}, color_scheme="dark")
    context.set_default_timeout(LIMIT_MS)
    page = context.new_page()
    page.goto(f"{stack.url}/?job={run}&it=10&up=z")
    settled(page)
    printed = PdfReader(io.BytesIO(page.pdf())).pages[0]
    width = page.locator(".viewer canvas").evaluate("(canvas) => canvas.width")
    (picture,) = (one.image for one in printed.images if one.image is not None and one.image.width == width)
    assert len(set(picture.convert("L").tobytes())) > 50, "the picture is printed empty"
    page.emulate_media(media="print")
    for name in ("Status", "Chart", "Timeline"):
        expect(page.get_by_role("region", name=name)).to_be_visible()
    for hidden in (".rail", ".top", ".corner", "[aria-label=Downloads]", ".timeline .buttons"):
        expect(page.locator(hidden).first).to_be_hidden()
    page.screenshot(path=PICTURES / "job-print.png", full_page=True)
    page.set_viewport_size(
        {"width": 718, "height": 1010}
    )  # the paper's own width, where a narrow screen's rules hold
    expect(page.locator(".work > .tabs")).to_be_hidden()
    for shown in (".stage", "[aria-label=Chart]"):
        expect(page.locator(shown).first).to_be_visible()
    page.emulate_media(media="screen")
    page.get_by_role("button", name="Figures and downloads").click()
    page.get_by_role("button", name="Runs").click()
    page.emulate_media(media="print")
    expect(page.locator(".rail")).to_be_hidden()
    expect(page.locator(".stage")).to_be_visible()
    context.close()


def test_a_phone_shows_picture_or_figures(browser: Browser, stack: Stack, run: str) -> None:
    context = browser.new_context(viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True)
    context.set_default_timeout(LIMIT_MS)
    page = context.new_page()
    page.goto(f"{stack.url}/?job={run}")
    settled(page)
    expect(page.get_by_role("heading", name="Downloads")).to_be_hidden()
    page.get_by_role("button", name="Figures and downloads").tap()
    expect(page.get_by_role("heading", name="Downloads")).to_be_visible()
    for link in page.locator(".files a, .top nav a").all():
        box = link.bounding_box()
        assert box is not None
        assert min(box["width"], box["height"]) >= 24, f"too small for a finger: {link.inner_text()}"
    page.get_by_role("button", name="Runs").tap()
    expect(page.locator(".run").first).to_be_visible()
    context.close()


def test_long_numbers_are_not_broken_and_have_room(page: Page, stack: Stack, api: Api, animal: bytes) -> None:
    fields = {"preset": "paper", "step": "1e-8", "iterations": "12000", "snapshots": "1", "name": "slow"}
    job = api.http.post("/v1/jobs", files={"file": ("a.obj", animal)}, data=fields).json()
    assert api.finished(job["id"])["progress"]["iteration"] == 12000
    page.goto(f"{stack.url}/?job={job['id']}")
    settled(page)
    last = page.locator(".ticks span").last
    expect(last).to_have_text(re.compile(r"^12\s000$"))
    first = page.locator(".ticks span").first
    assert last.evaluate("(one) => one.offsetHeight") == first.evaluate("(one) => one.offsetHeight")
    card = page.get_by_role("region", name="Chart").bounding_box()
    assert card is not None
    labels = page.locator(".chart .up span").all()
    assert max(len(one.inner_text()) for one in labels) > 7, (
        "its curve is so flat that many digits are told apart"
    )
    for box in (one.bounding_box() for one in labels):
        assert box is not None
        assert box["x"] > card["x"] + 8
