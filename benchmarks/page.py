"""What the web page costs in a real Chromium, without a graphics card: figures to look at, none is asserted.

A task of the page's own thread counts as long above 200 ms. What it spends waiting for the process that draws by
software is told apart by Chromium's trace: on a machine with a graphics card that share is next to nothing.
"""

from __future__ import annotations

import os
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any, Final

import httpx
from playwright.sync_api import Browser, Page, sync_playwright

from benchmarks.page_trace import CATEGORIES, long_tasks
from spherify.cli.stack import Address, Stack
from spherify.formats import write_mesh
from spherify.geometry.samples import SAMPLES
from tests.web.browser import LIMIT_MS, OPTIONS, chromium

LOADS: Final = 7
STATES: Final = 500
EVERY: Final = 4
SIZES: Final = (50_000, 655_362)
WATCHED_S: Final = 120.0
LOOKED_MS: Final = 1500  # that a visitor looks before choosing a file
SETTLED: Final = """
document.querySelector('.viewer:not(.expecting)')?.dataset.drawn === 'yes' && !document.querySelector('.note')
"""
READ: Final = "Number(document.querySelector('[role=slider]')?.getAttribute('aria-valuenow') ?? -1)"
WATCH: Final = """
window.seen = { paint: {}, long: [], states: new Set() };
const observe = (type, take) =>
  new PerformanceObserver((list) => list.getEntries().forEach(take)).observe({ type, buffered: true });
observe('paint', (entry) => (seen.paint[entry.name] = entry.startTime));
observe('longtask', (entry) => seen.long.push(entry.duration));
"""
FETCHED: Final = """Math.max(...performance.getEntriesByType('resource')
  .filter(({ name }) => /assets\\/(index|stage).*(js|css)$/.test(name)).map((one) => one.responseEnd))"""
REPORTED: Final = """(file) => new Promise((done) => {
  const began = performance.now();
  const times = {};
  const look = () => {
    const now = performance.now() - began;
    if (!document.querySelector('.home') && document.querySelector('.viewer:not(.expecting)')) times.preview ??= now;
    if (document.querySelector('.report .good')) times.report ??= now;
    if (times.preview && times.report) done(times);
    else requestAnimationFrame(look);
  };
  look();
})"""


def main() -> None:
    """Print first paint, the way from a file to its report, a run watched live, five hundred states, a large mesh."""
    path = chromium()
    if path is None:
        raise SystemExit("there is no Chromium on PATH")
    with (
        tempfile.TemporaryDirectory(prefix="spherify-bench-") as scratch,
        sync_playwright() as playwright,
        Stack(Address("127.0.0.1", 0), Path(scratch), 1, _quiet, redis_url=None) as stack,
        httpx.Client(base_url=stack.url, timeout=60, trust_env=False) as http,
    ):
        browser = playwright.chromium.launch(executable_path=path, headless=True, args=OPTIONS)
        stack.start()
        print(f"Chromium {browser.version}, load {os.getloadavg()[0]:.1f} at the beginning")
        _first_paint(browser, stack.url)
        for size in SIZES:
            _from_file_to_report(browser, stack.url, size, Path(scratch))
        job = _watched(browser, stack.url, http)
        _scrubbed(browser, stack.url, http, job)
        browser.close()
    print(f"load {os.getloadavg()[0]:.1f} at the end")


def _quiet(_name: str, _line: str) -> None:
    """Leave the programs' logs aside."""


def _page(browser: Browser) -> Page:
    # what is waited for is evaluated in the page, which its own policy would not let anybody do
    page = browser.new_context(viewport={"width": 1440, "height": 900}, bypass_csp=True).new_page()
    page.context.set_default_timeout(LIMIT_MS)
    page.add_init_script(WATCH)
    return page


def _first_paint(browser: Browser, url: str) -> None:
    """Load the page with an empty cache: right after the service has started, and some times more."""
    times, fetched = [], []
    for _ in range(LOADS):
        page = _page(browser)
        page.goto(url)
        page.wait_for_function("seen.paint['first-contentful-paint'] && document.querySelector('h1')")
        times.append(page.evaluate("seen.paint['first-contentful-paint']"))
        fetched.append(page.evaluate(FETCHED))
        page.context.close()
    first, *rest = times
    print(
        f"first paint: {first:.0f} ms right after the start of service and browser (its files were there after "
        f"{fetched[0]:.0f} ms), "
        f"then {statistics.median(rest):.0f} ms ({min(rest):.0f} to {max(rest):.0f}; "
        f"files after {statistics.median(fetched[1:]):.0f} ms)"
    )


def _from_file_to_report(browser: Browser, url: str, vertices: int, scratch: Path) -> None:
    """Choose a file, and wait for its picture and for the service's report."""
    mesh = SAMPLES["stone"].build(vertices)
    file = scratch / f"stone-{vertices}.ply"
    file.write_bytes(write_mesh(mesh, "ply"))
    times: list[dict[str, float]] = []
    for _ in range(3):
        page = _page(browser)
        page.goto(url)
        page.wait_for_selector("input[type=file]", state="attached")
        page.wait_for_timeout(LOOKED_MS)
        page.evaluate("window.report = null")
        page.evaluate(f"(window.report = ({REPORTED})()) && null")
        page.locator("input[type=file]").set_input_files(file)
        times.append(page.evaluate("window.report"))
        page.context.close()
    best = {name: min(one[name] for one in times) for name in ("preview", "report")}
    print(
        f"{len(mesh.vertices):,} vertices, {len(mesh.faces):,} triangles, PLY, best of three: "
        f"picture after {best['preview']:.0f} ms, report after {best['report']:.0f} ms"
    )


def _watched(browser: Browser, url: str, http: httpx.Client) -> str:
    """Watch a run of five hundred states from its first to its last; its id."""
    sent = http.put(
        "/v1/meshes", params={"name": "stone.ply"}, content=write_mesh(SAMPLES["stone"].build(10_000), "ply")
    )
    order = {
        "mesh_id": sent.json()["id"],
        "preset": "paper",
        "iterations": (STATES - 1) * EVERY,
        "snapshots": f"every:{EVERY}",
    }
    page = _page(browser)  # an empty one: taking an older page down would count, and is the browser's
    browser.start_tracing(page=page, categories=CATEGORIES)
    job = str(http.post("/v1/jobs", json=order).raise_for_status().json()["id"])
    page.goto(f"{url}/?job={job}&up=z")
    deadline = time.monotonic() + WATCHED_S
    shown = set()
    while time.monotonic() < deadline:
        shown.add(page.evaluate(READ))
        record: dict[str, Any] = http.get(f"/v1/jobs/{job}").json()
        if record["done"] and page.evaluate(READ) == record["snapshots"]["available"][-1]:
            break
        page.wait_for_timeout(100)
    tasks = long_tasks(browser.stop_tracing())
    page.context.close()
    print(f"a run of {STATES} states watched live, 10,242 vertices: {len(shown)} positions seen")
    print(
        f"  tasks above 200 ms: {sum(one.ms > 200 for one in tasks)}, above 50 ms: {len(tasks)}; "
        f"most time of the processor in one: {max((one.processor_ms for one in tasks), default=0):.0f} ms"
    )
    for one in tasks[:5]:
        print(
            f"  {one.ms:5.0f} ms, the processor at it for {one.processor_ms:.0f}, "
            f"waiting for software drawing {one.waiting_ms:.0f}: {one.what}"
        )
    return job


def _scrubbed(browser: Browser, url: str, http: httpx.Client, job: str) -> None:
    """Go through every state with the arrow key, there and back, and look at the memory."""
    states: list[int] = http.get(f"/v1/jobs/{job}").json()["snapshots"]["available"]
    page = _page(browser)
    page.goto(f"{url}/?job={job}&up=z&it=0&color=curvature")
    page.wait_for_function(SETTLED)
    page.evaluate("seen.long.length = 0")
    began, memory = time.perf_counter(), [_memory(browser)]
    for keys, wanted in (("ArrowRight", states), ("ArrowLeft", states[::-1])):
        seen = [page.evaluate(READ)]
        for number, _ in enumerate(wanted[1:]):
            page.keyboard.press(keys)
            page.wait_for_function("!document.querySelector('.readout').textContent.includes('loading')")
            seen.append(page.evaluate(READ))
            if number % 100 == 99:
                memory.append(_memory(browser))
        if seen != wanted:
            raise AssertionError(f"{len(seen)} states were shown, of {len(wanted)}")
    seconds = time.perf_counter() - began
    page.wait_for_function(SETTLED)
    long = page.evaluate("seen.long.filter((one) => one > 200).length")
    page.context.close()
    print(
        f"{len(states)} states there and back with colours, a key each: all shown, in order, {seconds:.0f} s"
    )
    print(f"  tasks above 200 ms: {long}")
    print("  MB of the largest page's process, each hundred states:", *(f"{one:.0f}" for one in memory))


def _memory(browser: Browser) -> float:
    """Return the resident memory of the largest of the pages' processes, in MB: its workers are threads of it."""
    session = browser.new_browser_cdp_session()
    processes = session.send("SystemInfo.getProcessInfo")["processInfo"]
    session.detach()
    pages = [one["id"] for one in processes if one["type"] == "renderer"]
    sizes = [_resident(Path(f"/proc/{pid}/statm")) for pid in pages]
    return max(sizes, default=0) / 1e6


def _resident(statm: Path) -> int:
    return int(statm.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") if statm.exists() else 0
