"""Several files at once: each is judged, and what is accepted is run."""

from __future__ import annotations

import re

from playwright.sync_api import Page, Route, expect

from tests.e2e.api import Api
from tests.e2e.test_readme import BOX_WITHOUT_A_LID
from tests.stack import Stack
from tests.web.browser import Complaints, status
from tests.web.test_trouble import NETWORK


def test_of_several_files_those_that_are_accepted_are_run_in_every_way_that_is_asked_for(
    *, page: Page, complaints: Complaints, stack: Stack, api: Api, animal: bytes
) -> None:
    complaints.expect(NETWORK)
    page.goto(stack.url)
    meshes = {"cat.obj": animal, "box.obj": BOX_WITHOUT_A_LID, "dog.obj": animal + b"# another\n"}
    files = [{"name": name, "mimeType": "model/obj", "buffer": mesh} for name, mesh in meshes.items()]
    page.locator("input[type=file]").set_input_files(files)
    expect(page.get_by_role("heading", level=1)).to_have_text("3 files")
    expect(page.get_by_role("row", name="box.obj")).to_contain_text("4 edges have one face only")
    page.get_by_label("Conformal flow").check()
    page.get_by_label("Robust").uncheck()
    page.get_by_label("Vary").select_option(label="Iterations")
    page.get_by_label("Values").fill("1, 2")
    page.get_by_role("button", name="Run all 4").click()
    for name in ("cat.obj", "dog.obj"):
        expect(page.get_by_role("row", name=name).get_by_text("Done")).to_have_count(2)
    said = page.get_by_role("status").filter(has_text="tag").locator("code").inner_text()
    jobs = api.http.get("/v1/jobs", params={"tag": said}).json()["items"]
    assert {(job["name"], job["preset"], job["progress"]["iterations_total"]) for job in jobs} == {
        (f"{name} \N{MIDDLE DOT} iterations {most}", "conformal", most)
        for name in ("cat", "dog")
        for most in (1, 2)
    }
    expect(page.get_by_role("columnheader", name="iterations 2")).to_be_visible()
    page.get_by_role("link", name="See the run: cat.obj, iterations 2").click()
    expect(page).to_have_url(re.compile(r"\?job=job_"))
    expect(status(page)).to_have_text("Done")


def test_a_refused_one_of_several_is_shown_by_itself(
    page: Page, complaints: Complaints, stack: Stack, animal: bytes
) -> None:
    complaints.expect(NETWORK)
    page.goto(stack.url)
    meshes = {"cat.obj": animal, "box.obj": BOX_WITHOUT_A_LID}
    files = [{"name": name, "mimeType": "model/obj", "buffer": mesh} for name, mesh in meshes.items()]
    page.locator("input[type=file]").set_input_files(files)
    page.get_by_role("button", name="See why: box.obj").click()
    expect(page.get_by_label("Why it was refused")).to_contain_text("4 edges have one face only")


def test_while_runs_are_not_sent_yet_the_browser_asks_before_it_leaves(
    page: Page, stack: Stack, animal: bytes
) -> None:
    held: list[Route] = []

    def hold_the_first(route: Route) -> None:
        if route.request.method == "POST" and not held:
            held.append(route)
        else:
            route.continue_()

    page.route("**/v1/jobs", hold_the_first)
    page.goto(stack.url)
    names = ("cat.obj", "dog.obj")
    files = [
        {"name": name, "mimeType": "model/obj", "buffer": animal + name.encode().join([b"# ", b"\n"])}
        for name in names
    ]
    page.locator("input[type=file]").set_input_files(files)
    with page.expect_request(lambda request: request.method == "POST" and request.url.endswith("/v1/jobs")):
        page.get_by_role("button", name="Run all 2").click()
    with page.expect_event("dialog") as asked:
        page.close(run_before_unload=True)
    assert asked.value.type == "beforeunload"
    asked.value.dismiss()
    held[0].continue_()
    for name in names:
        expect(page.get_by_role("row", name=name).get_by_text("Done")).to_be_visible()
    with page.expect_event("close"):
        page.close(run_before_unload=True)
