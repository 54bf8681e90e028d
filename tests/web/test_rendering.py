"""What the viewer draws, against small pictures of our own shapes, drawn by software as on every machine.

Compared are the pictures at half their size, slightly blurred: an edge that is smoothed another way does not count, a
light that comes from elsewhere does. A difference is drawn beside the new picture, in tests/web/pictures. After a
change that is meant, look at the new ones and `RENEW_PICTURES=1 make test ARGS=tests/web/test_rendering.py`.
"""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from PIL import Image, ImageChops, ImageFilter, ImageStat
from playwright.sync_api import Browser, Page, expect

from tests.e2e.api import Api
from tests.e2e.test_readme import BOX_WITHOUT_A_LID
from tests.stack import Stack
from tests.web.browser import LIMIT_MS, PICTURES, settled

REFERENCES = Path(__file__).parent / "references"
RENEW = os.environ.get("RENEW_PICTURES") == "1"
ALONE = ".corner, .legend, .over { visibility: hidden }"  # no letters: fonts differ
MEAN = 0.8  # of 255: all over the picture
FAR = 40  # of 255: a pixel that is another colour
MOST_FAR = 0.004  # of all pixels


@pytest.fixture(scope="module")
def paper(api: Api, animal: bytes) -> str:
    """A run by the preset that is kept as it is: its states are the same from one version to the next."""
    fields = {"preset": "paper", "step": "0.05", "iterations": "30", "snapshots": "10", "tags": "up:z"}
    answer = api.http.post("/v1/jobs", files={"file": ("paper.obj", animal)}, data=fields)
    return str(api.finished(answer.json()["id"])["id"])


@pytest.fixture
def canvas(browser: Browser) -> Iterator[Page]:
    """A page of which little more than the picture is left."""
    context = browser.new_context(
        viewport={"width": 900, "height": 560}, reduced_motion="reduce", color_scheme="light", bypass_csp=True
    )
    context.set_default_timeout(LIMIT_MS)
    page = context.new_page()
    yield page
    context.close()


@pytest.mark.parametrize(
    ("name", "address"),
    [
        ("clay", "it=0"),
        ("between", "it=5"),
        ("distance", "it=10&color=distance"),
        ("quality", "it=10&color=quality"),
        ("triangles", "it=10&wire=1"),
    ],
)
def test_the_picture_is_the_one_it_was(
    canvas: Page, stack: Stack, paper: str, name: str, address: str
) -> None:
    canvas.goto(f"{stack.url}/?job={paper}&up=z&cam=0.65,0.38,3.1,0,0,0&{address}")
    settled(canvas)
    if "color" in address:
        expect(canvas.locator(".legend")).to_be_visible()
    compare(canvas, name)


def test_faults_are_drawn_where_they_were(canvas: Page, stack: Stack) -> None:
    canvas.goto(stack.url)
    box = {"name": "box.obj", "mimeType": "model/obj", "buffer": BOX_WITHOUT_A_LID}
    canvas.locator("input[type=file]").set_input_files(box)
    expect(canvas.get_by_label("Why it was refused")).to_be_visible()
    settled(canvas)
    compare(canvas, "faults")


def compare(page: Page, name: str) -> None:
    """Hold what is drawn against the reference, or make it the reference."""
    # two frames: the first may be the last one before the newest state
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    shot = page.locator(".viewer canvas").screenshot(style=ALONE)
    whole = Image.open(io.BytesIO(shot)).convert("RGB")
    path = REFERENCES / f"{name}.png"
    if RENEW:
        REFERENCES.mkdir(exist_ok=True)
        half(whole, (whole.width // 2, whole.height // 2)).save(path, optimize=True)
        return
    reference = Image.open(path).convert("RGB")
    now = half(whole, reference.size)
    PICTURES.mkdir(exist_ok=True)
    new = PICTURES / f"{name}-now.png"
    now.save(new)
    grown = [abs(one // 2 - other) for one, other in zip(whole.size, reference.size, strict=True)]
    assert max(grown) <= 4, f"{name} has {whole.size} pixels now, and had twice {reference.size}: {new}"
    soft = ImageFilter.GaussianBlur(1)
    difference = ImageChops.difference(now.filter(soft), reference.filter(soft)).convert("L")
    mean = ImageStat.Stat(difference).mean[0]
    far = sum(difference.histogram()[FAR:]) / (now.width * now.height)
    if mean > MEAN or far > MOST_FAR:
        drawn = PICTURES / f"{name}-difference.png"
        difference.point(lambda value: min(255, 4 * value)).save(drawn)
        pytest.fail(
            f"{name}: the pixels differ by {mean:.2f} of 255 on average (at most {MEAN}), and {far:.2%} of them by "
            f"{FAR} or more (at most {MOST_FAR:.2%}).\nnew: {new}\nbefore: {path}\n"
            f"difference, four times as bright: {drawn}"
        )


def half(picture: Image.Image, size: tuple[int, int]) -> Image.Image:
    """Return a picture at half its size, or a pixel more or less: other fonts leave it more room or less."""
    return picture.resize(size, Image.Resampling.BOX)
