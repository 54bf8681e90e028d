"""Without a pointer: where Tab and the arrow keys lead, and where the focus is after a change of view."""

from __future__ import annotations

import re

from playwright.sync_api import Page, Route, expect

from tests.e2e.api import Api
from tests.e2e.test_readme import BOX_WITHOUT_A_LID
from tests.stack import Stack, wait_for
from tests.web.browser import Complaints, address, iteration, settled, status

FOCUSED = "document.activeElement.getAttribute('aria-label') ?? document.activeElement.textContent.trim()"


def test_runs_are_reached_opened_and_compared_by_keys_alone(page: Page, stack: Stack, run: str) -> None:
    page.goto(stack.url)
    expect(page.locator(".run").first).to_be_visible()
    heading = page.get_by_role("heading", level=1)

    # the whole list is one stop, and the arrows lead through it
    page.get_by_label("Only with this tag").fill("gallery")  # those that ended well, whatever else there is
    runs = page.get_by_role("grid", name="Runs")
    held: list[Route] = []
    filtered = re.compile("limit=30&tag=gallery")
    page.route(filtered, lambda route: held.append(route))  # noqa: PLW0108 - playwright takes no built-in method
    with page.expect_request(filtered):
        page.get_by_label("Only with this tag").press("Enter")
    # what is focused now may go with what is filtered away
    expect(runs).to_have_attribute("aria-busy", "true")
    for route in held:
        route.continue_()
    page.unroute(filtered)
    expect(runs).to_have_attribute("aria-busy", "false")
    expect(runs.get_by_role("row").filter(has_not_text="Ψ")).to_have_count(0)
    page.keyboard.press("Tab")
    expect(runs.locator(":focus")).to_have_count(1)
    expect(runs.locator("[tabindex='0']")).to_have_count(1)
    page.keyboard.press("Control+End")
    assert page.evaluate(FOCUSED).startswith("Delete: ")
    page.keyboard.press("ArrowLeft")
    assert page.evaluate(FOCUSED).startswith("Download as PLY: ")
    page.keyboard.press("Home")
    expect(runs.get_by_role("row").last.locator(".run")).to_be_focused()
    page.keyboard.press("Tab")
    expect(runs.locator(":focus")).to_have_count(0)

    # into a run: its heading has the focus, and its name is said
    page.goto(f"{stack.url}/?job={run}&it=5&up=z")
    settled(page)
    page.get_by_role("button", name="With its beginning").focus()
    page.keyboard.press("Enter")
    expect(heading).to_have_text("Compare: animal")
    expect(heading).to_be_focused()
    expect(page).to_have_title(re.compile("^Compare: animal"))
    expect(page.get_by_role("status").filter(has_text="Compare: animal")).to_have_count(1)
    settled(page)

    # both sides at once, or the one whose timeline has the focus
    page.keyboard.press("ArrowRight")
    wait_for(lambda: address(page).count("@10,") == 1 and "@1&" in address(page), what="each one state on")
    page.get_by_role("slider", name="Iteration").last.focus()
    page.keyboard.press("End")
    page.keyboard.press("ArrowDown")
    wait_for(lambda: "@10," in address(page) and "@1&" not in address(page), what="the right one alone")
    page.keyboard.press("w")
    expect(page.get_by_role("button", name="Show triangles")).to_have_attribute("aria-pressed", "true")

    # and back
    page.go_back()
    expect(heading).to_have_text("animal")
    expect(heading).to_be_focused()
    assert iteration(page) == 5


def test_a_file_that_has_arrived_leaves_the_focus_where_the_visitor_types(
    page: Page, stack: Stack, animal: bytes
) -> None:
    held: list[Route] = []

    def hold(route: Route) -> None:
        held.append(route)

    page.route(re.compile("/v1/meshes[?]"), hold)
    page.goto(stack.url)
    with page.expect_request(re.compile("/v1/meshes[?]")):
        page.locator("input[type=file]").set_input_files(
            {"name": "cat.obj", "mimeType": "model/obj", "buffer": animal}
        )
    expect(page.get_by_role("heading", level=1)).to_be_focused()
    tag = page.get_by_label("Only with this tag")
    tag.focus()
    page.keyboard.type("sm")
    held[0].continue_()
    expect(page).to_have_url(re.compile("[?]mesh=mesh_"))
    expect(page.locator(".report .good")).to_have_count(3)
    page.keyboard.type("all")
    expect(tag).to_have_value("small")


SAID = """
window.said = [];
new MutationObserver(() => {
  const now = document.querySelector('#app > p[role=status]')?.textContent;
  if (now !== said.at(-1)) said.push(now);
}).observe(document, { characterData: true, childList: true, subtree: true });
"""
DROP = """() => {
  const dataTransfer = new DataTransfer();
  dataTransfer.items.add(new File(['nothing'], 'nothing.obj'));
  document.body.dispatchEvent(new DragEvent('drop', { dataTransfer, bubbles: true, cancelable: true }));
}"""


def test_the_name_of_a_file_that_is_dropped_twice_is_said_twice(
    page: Page, complaints: Complaints, stack: Stack
) -> None:
    complaints.expect("status of 422")
    page.add_init_script(SAID)
    page.goto(stack.url)
    page.evaluate(DROP)
    wait_for(lambda: page.evaluate("said").count("nothing.obj") == 1, what="the name is said")
    page.evaluate(DROP)
    wait_for(lambda: page.evaluate("said").count("nothing.obj") == 2, what="the name is said again")
    expect(page.get_by_role("alert")).to_be_visible()


def test_the_run_that_is_chosen_to_compare_with_stays_chosen_when_another_is_new(
    page: Page, stack: Stack, api: Api, run: str, animal: bytes
) -> None:
    def finished(name: str) -> str:
        fields = {"name": name, "preset": "paper", "iterations": "1", "tags": "compared"}
        answer = api.http.post("/v1/jobs", files={"file": ("a.obj", animal)}, data=fields)
        return str(api.finished(answer.json()["id"])["id"])

    chosen = finished("chosen")
    page.goto(f"{stack.url}/?job={run}")
    page.get_by_label("Only with this tag").fill("compared")
    page.get_by_label("Only with this tag").blur()
    others = page.get_by_label("Another run")
    expect(others.locator("option")).to_have_count(1)
    newer = finished("newer")
    page.get_by_label("Which runs").select_option(label="Done")  # which fetches the list
    expect(others.locator("option").first).to_have_attribute("value", newer)
    expect(others).to_have_value(chosen)


def test_the_focus_is_handed_on_when_what_has_it_goes(
    page: Page, complaints: Complaints, stack: Stack, api: Api, stone: bytes
) -> None:
    complaints.expect("status of 422")

    def press(name: str) -> None:
        page.get_by_role("button", name=name, exact=True).focus()
        page.keyboard.press("Enter")

    # a run is cancelled, and can be gone on with
    fields = {"preset": "paper", "step": "1e-6", "iterations": "900000", "name": "endless"}
    job = api.http.post("/v1/jobs", files={"file": ("stone.obj", stone)}, data=fields).json()
    page.goto(f"{stack.url}/?job={job['id']}")
    press("Cancel")
    expect(status(page)).to_have_text("Cancelled")
    expect(page.get_by_role("button", name="Go on")).to_be_visible()
    expect(page.locator(".actions :focus")).to_have_count(1)

    # a mesh is let in
    page.goto(stack.url)
    box = {"name": "box.obj", "mimeType": "model/obj", "buffer": BOX_WITHOUT_A_LID}
    page.locator("input[type=file]").set_input_files(box)
    press("Morph it with its holes")
    expect(page.get_by_role("button", name="Run")).to_be_visible()
    expect(page.get_by_role("heading", level=1)).to_be_focused()

    # a parameter is put back, and a row taken away
    page.get_by_text("All parameters").click()
    step = page.get_by_label("Step", exact=True)
    step.fill("0.123")
    step.blur()
    press("Step: back to the preset's value")
    expect(step).to_be_focused()
    press("Add a stage")
    press("Remove row 2")
    expect(page.get_by_label("Outward steps an iteration, row 1")).to_be_focused()
