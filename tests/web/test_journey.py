"""The way of a visitor: drop a mesh, run it, watch it, go through it, compare, download, share."""

from __future__ import annotations

import json
import re
from pathlib import Path

import httpx
from playwright.sync_api import BrowserContext, Page, expect

from tests.e2e.api import Api
from tests.stack import Stack, wait_for
from tests.web.browser import PICTURES, Complaints, address, iteration, settled, status


def test_from_a_file_to_a_shared_link(
    *, page: Page, context: BrowserContext, complaints: Complaints, stack: Stack, api: Api, animal: bytes
) -> None:
    context.grant_permissions(["clipboard-read", "clipboard-write"], origin=stack.url)
    page.goto(stack.url)
    expect(page.get_by_role("heading", level=1)).to_have_text("See a mesh become a sphere")

    # a shape that the service builds
    page.get_by_role("button", name="Quadruped", exact=True).first.click()
    expect(page).to_have_url(re.compile(r"\?mesh=mesh_\w+&up=z"))
    expect(page.get_by_role("heading", name="quadruped.ply", level=2)).to_be_visible()
    page.get_by_role("link", name="Spherify").click()

    # a file: preview, report, form
    page.locator("input[type=file]").set_input_files(
        {"name": "cat.obj", "mimeType": "model/obj", "buffer": animal}
    )
    expect(page.locator(".report .good")).to_have_count(3)
    expect(page).to_have_url(re.compile(r"\?mesh=mesh_"))
    mesh = api.http.get(f"/v1/meshes/{page.url.partition('mesh=')[2][:31]}").json()
    expect(page.locator(".report dd").first).to_have_text(str(mesh["report"]["vertices"]))
    expect(page.get_by_role("radio", name="Robust", exact=False).first).to_be_checked()
    page.get_by_label("Iterations", exact=True).fill("70")
    page.get_by_text("All parameters").click()
    page.get_by_label("Step", exact=True).fill("0")
    page.get_by_label("Step", exact=True).blur()
    expect(page.get_by_role("alert")).to_have_text("more than 0")
    expect(page.get_by_role("button", name="Run")).to_be_disabled()
    page.get_by_role("button", name="Step: back to the preset's value").click()

    # the same as curl
    page.get_by_role("button", name="curl").click()
    copied = page.evaluate("navigator.clipboard.readText()")
    assert json.loads(copied.split("'")[1])["iterations"] == 70
    assert copied.endswith(f"{stack.url}/v1/jobs")

    # live
    page.get_by_role("button", name="Run").click()
    expect(page).to_have_url(re.compile(r"\?job=job_"))
    job_id = page.url.partition("job=")[2][:30]
    expect(status(page)).to_have_text("Done")
    job = api.job(job_id)
    assert job["progress"]["iteration"] <= 70
    settled(page)
    heading = page.get_by_role("heading", level=1)
    expect(heading).to_have_text(job["name"])
    expect(heading).to_be_focused()
    expect(page).to_have_title(f"{job['name']} \N{MIDDLE DOT} Spherify")
    states = job["snapshots"]["available"]
    wait_for(lambda: iteration(page) == states[-1], what="the newest state, without a click")

    # the timeline by keys, by pointer, and played
    page.keyboard.press("Home")
    assert iteration(page) == 0
    page.keyboard.press("ArrowRight")
    assert iteration(page) == states[1]
    page.keyboard.press("End")
    assert iteration(page) == states[-1]
    track = page.get_by_role("slider", name="Iteration").bounding_box()
    assert track is not None
    page.mouse.click(track["x"] + 0.62 * track["width"], track["y"] + 10)
    assert 0 < iteration(page) < states[-1]
    page.keyboard.press("Home")
    page.keyboard.press(" ")
    expect(page.get_by_role("button", name="Pause")).to_be_visible()
    wait_for(lambda: iteration(page) > 2, what="the timeline plays")
    page.keyboard.press(" ")
    expect(page.get_by_role("button", name="Play")).to_be_visible()

    # the chart leads there too
    expect(page.locator(".chart .along span").last).to_have_text(str(states[-1]))
    page.keyboard.press("Home")
    plot = page.locator(".chart .area").bounding_box()
    assert plot is not None
    page.mouse.move(plot["x"] + 0.8 * plot["width"], plot["y"] + 30)
    expect(page.locator(".chart .reading")).to_have_text(re.compile(r"^0\.\d+ at \d\d$"))
    page.mouse.click(plot["x"] + 0.8 * plot["width"], plot["y"] + 30)
    assert iteration(page) > 10

    # colours with a legend
    page.keyboard.press("End")
    page.get_by_label("Colour by").select_option("curvature")
    expect(page.get_by_label("Legend: Curvature")).to_be_visible()
    settled(page)

    # the files are the API's, byte for byte, with the colours that are shown and their range
    for name, suffix in (("Result as PLY", "final.ply?color=curvature"), ("Result as STL", "final.stl")):
        with page.expect_download() as download:
            page.get_by_role("link", name=name).click()
        served = api.http.get(f"/v1/jobs/{job_id}/snapshots/{suffix}").content
        assert Path(download.value.path()).read_bytes() == served
    ends = page.locator(".legend .ends span").all_inner_texts()
    coloured = api.http.get(f"/v1/jobs/{job_id}/snapshots/final.ply?color=curvature").content
    said = re.search(rb"from (\S+) to (\S+)", coloured)
    assert said is not None
    assert [f"{float(number):.3g}" for number in said.groups()] == [
        end.replace("\N{MINUS SIGN}", "-") for end in (ends[0], ends[-1])
    ]
    with page.expect_download() as download:
        page.get_by_role("button", name="Picture", exact=True).last.click()
    assert Path(download.value.path()).read_bytes().startswith(b"\x89PNG")

    # the run again, as it was asked for: the plan, and not what the service made of it
    page.get_by_role("button", name="curl").click()
    again = json.loads(page.evaluate("navigator.clipboard.readText()").split("'")[1])
    asked = {"mesh_id": mesh["id"], "preset": "robust", "iterations": 70, "snapshots": "log:40"}
    assert again == asked | {"name": "cat"}
    planned = api.http.post("/v1/jobs", params={"dry_run": "true"}, json=again).json()
    assert planned["snapshots"]["requested"] == job["snapshots"]["requested"]

    # a link opens the same view
    page.keyboard.press("ArrowLeft")
    canvas = page.locator(".viewer canvas")
    canvas.focus()
    page.keyboard.press("ArrowUp")
    wait_for(lambda: "cam=" in address(page), what="the camera in the address")
    settled(page)
    page.get_by_role("button", name="Copy link").click()
    link = page.evaluate("navigator.clipboard.readText()")
    expect(page.get_by_text("Link copied")).to_be_visible()
    other = context.new_page()
    complaints.watch(other)
    other.goto(link)
    settled(other)
    expect(other.get_by_label("Legend: Curvature")).to_be_visible()
    assert iteration(other) == iteration(page)
    cameras = [httpx.URL(address(one)).params["cam"].split(",") for one in (page, other)]
    assert all(abs(float(a) - float(b)) < 0.002 for a, b in zip(*cameras, strict=True))
    other.close()

    # beside its beginning, with one camera
    page.get_by_role("button", name="With its beginning").click()
    expect(page.locator(".pane")).to_have_count(2)
    expect(page.locator(".pane h2").first).to_have_text(job["name"])
    settled(page)
    wait_for(lambda: "compare=" in address(page), what="both in the address")
    before = address(page)
    right = page.locator(".viewer canvas").last.bounding_box()
    assert right is not None
    page.mouse.move(right["x"] + 200, right["y"] + 300)
    page.mouse.down()
    page.mouse.move(right["x"] + 320, right["y"] + 330, steps=4)
    page.mouse.up()
    wait_for(lambda: address(page) != before, what="the left one, whose camera the address holds, turned too")
    PICTURES.mkdir(exist_ok=True)
    page.screenshot(path=PICTURES / "journey-compare.png")

    # and home again, where the run is listed
    page.get_by_role("link", name="Spherify").click()
    expect(page.locator(".run", has_text=job["name"]).first).to_be_visible()


def test_a_run_is_found_cancelled_and_deleted(page: Page, stack: Stack, api: Api, stone: bytes) -> None:
    fields = {"preset": "paper", "step": "1e-6", "iterations": "900000", "name": "endless", "tags": "mine"}
    answer = api.http.post("/v1/jobs", files={"file": ("stone.obj", stone)}, data=fields)
    job_id = answer.json()["id"]
    page.goto(f"{stack.url}/?job={job_id}")
    expect(status(page)).to_have_text("Running")
    expect(page.locator(".going")).to_contain_text("of at most")
    wait_for(lambda: iteration(page) > 0, what="the newest state is shown as it comes")
    page.get_by_label("Only with this tag").fill("mine")
    page.get_by_label("Only with this tag").blur()
    expect(page.locator(".run")).to_have_count(1)
    page.get_by_role("button", name="Cancel", exact=True).click()
    expect(status(page)).to_have_text("Cancelled")
    page.on("dialog", lambda dialog: dialog.accept())
    page.get_by_role("button", name="Delete", exact=True).click()
    expect(page).to_have_url(f"{stack.url}/")  # home, once it is gone
    assert api.http.get(f"/v1/jobs/{job_id}").status_code == 410


def test_a_state_begins_a_new_run(
    *, page: Page, context: BrowserContext, stack: Stack, api: Api, run: str
) -> None:
    context.grant_permissions(["clipboard-read", "clipboard-write"], origin=stack.url)
    page.goto(f"{stack.url}/?job={run}&it=5")
    settled(page)
    wait_for(lambda: "up=z" in address(page), what="the run's upright axis, which the address did not name")
    page.get_by_role("button", name="curl").click()
    assert json.loads(page.evaluate("navigator.clipboard.readText()").split("'")[1])["tags"] == ["up:z"]
    page.get_by_role("button", name="From here").click()
    expect(page).to_have_url(re.compile(r"\?mesh=mesh_\w+&up=z"))
    expect(page.get_by_role("heading", name="animal_it00005.ply", level=2)).to_be_visible()
    page.get_by_role("button", name="curl").click()
    asked = json.loads(page.evaluate("navigator.clipboard.readText()").split("'")[1])
    assert asked["tags"] == ["up:z"]  # so that its small pictures stand upright, too
    mesh = api.http.get(f"/v1/meshes/{page.url.partition('mesh=')[2][:31]}").json()
    metrics = api.http.get(f"/v1/jobs/{run}/metrics").json()
    (row,) = (row for row in metrics["rows"] if row["iteration"] == 5)
    assert abs(mesh["report"]["sphericity"] - row["sphericity"]) < 1e-9


def test_a_gallery_that_is_being_made_grows_before_our_eyes(
    *, page: Page, stack: Stack, api: Api, run: str, animal: bytes
) -> None:
    assert "gallery" in api.job(run)["tags"]
    page.goto(stack.url)
    expect(page.locator(".shape")).to_have_count(1)  # it has ended, and no other is on its way
    fields = {"iterations": "1", "name": "head", "tags": "gallery"}
    job = api.http.post("/v1/jobs", files={"file": ("head.obj", animal)}, data=fields).json()
    api.finished(job["id"])
    page.get_by_label("Which runs").select_option(label="Done")  # which fetches the list
    expect(page.locator(".shape")).to_have_count(2)
    expect(page.locator(".shape").last).to_contain_text("Head")
    assert api.http.delete(f"/v1/jobs/{job['id']}").status_code == 204


def test_small_pictures_of_others_are_drawn_while_a_run_is_watched(
    *, page: Page, stack: Stack, api: Api, run: str, stone: bytes
) -> None:
    fields = {"preset": "paper", "step": "1e-6", "iterations": "900000", "name": "endless"}
    live = api.http.post("/v1/jobs", files={"file": ("a.obj", stone)}, data=fields).json()["id"]
    page.goto(f"{stack.url}/?job={live}")
    settled(page)
    other = page.locator(".run", has_text=api.job(run)["name"]).first
    expect(other.locator("img")).to_be_visible(timeout=30_000)
    assert not api.job(live)["done"]
    assert api.http.post(f"/v1/jobs/{live}/cancel").is_success
    api.finished(live)
    assert api.http.delete(f"/v1/jobs/{live}").status_code == 204


def test_a_run_is_cancelled_fetched_and_deleted_from_the_list(
    *, page: Page, stack: Stack, api: Api, animal: bytes, stone: bytes
) -> None:
    def sent(mesh: bytes, **fields: str) -> str:
        answer = api.http.post("/v1/jobs", files={"file": ("a.obj", mesh)}, data=fields | {"tags": "listed"})
        return str(answer.json()["id"])

    endless = sent(stone, name="endless", preset="paper", step="1e-6", iterations="900000")
    page.on("dialog", lambda dialog: dialog.accept())
    page.goto(stack.url)
    page.get_by_label("Only with this tag").fill("listed")
    page.get_by_label("Only with this tag").blur()
    expect(page.locator(".run")).to_have_count(1)
    page.get_by_role("button", name="Cancel: endless").focus()
    page.keyboard.press("Enter")
    expect(page.locator(".run", has_text="Cancelled")).to_be_visible()
    expect(page.get_by_role("button", name="Cancel: endless")).to_have_count(0)
    expect(page.locator(".runs :focus")).to_have_count(1)  # what was pressed is gone, and the place is kept
    page.keyboard.press("End")
    page.keyboard.press("Enter")
    expect(page.locator(".run")).to_have_count(0)
    expect(page.get_by_label("Which runs")).to_be_focused()
    assert api.http.get(f"/v1/jobs/{endless}").status_code == 410

    brief = api.finished(sent(animal, name="brief", iterations="3"))["id"]
    with page.expect_download() as download:
        page.get_by_role("link", name="Download as PLY: brief").click()
    assert (
        Path(download.value.path()).read_bytes()
        == api.http.get(f"/v1/jobs/{brief}/snapshots/final.ply").content
    )


PLAYED = """new Promise((ended) => {
  const seen = new Set();
  const look = () => {
    seen.add(document.querySelector('.status .at').textContent);
    if (document.querySelector('[aria-label=Pause]')) requestAnimationFrame(look);
    else ended([...seen]);
  };
  document.querySelector('[aria-label=Play]').click();
  requestAnimationFrame(() => requestAnimationFrame(look));
})"""


def test_figures_follow_while_it_plays(page: Page, stack: Stack, run: str) -> None:
    page.goto(f"{stack.url}/?job={run}&it=0&color=curvature")
    settled(page)
    states = page.locator(".track path.mark").get_attribute("d") or ""
    for _ in range(states.count("M")):  # all are here then, and no news of theirs comes in between
        page.keyboard.press("ArrowRight")
        settled(page)
    page.keyboard.press("]")
    said = page.evaluate(PLAYED)
    assert len(said) > 4, said  # of some sixteen: a busy machine leaves out pictures, and their figures
