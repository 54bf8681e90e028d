"""A real Chromium, and what is asked of every page that it shows."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

from playwright.sync_api import ConsoleMessage, Locator, Page, Worker, expect

from tests.architecture.source import ROOT

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
NONE = (
    "THE WEB PAGE IS NOT TESTED: no browser on PATH. Install one, on Debian with "
    "`apt-get install --no-install-recommends chromium`, and run `make test` again"
)
OPTIONS = [
    "--no-sandbox",
    "--use-angle=swiftshader",  # WebGL by software: the same picture on every machine
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--force-device-scale-factor=1",
]
PICTURES = Path(__file__).parent / "pictures"
LIMIT_MS = 60_000


def chromium() -> str | None:
    """Return the path of a browser, None if there is none."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


def built() -> bool:
    """Whether the page is built."""
    return (ROOT / "service" / "web" / "dist" / "index.html").exists()


class Complaints:
    """What the browser complains about: errors in scripts, and everything its content policy refuses."""

    def __init__(self) -> None:
        self.found: list[str] = []
        self.expected: list[str] = []

    def watch(self, page: Page) -> None:
        """Listen to a page."""
        page.on("pageerror", lambda error: self.found.append(f"error: {error}"))
        page.on("console", self._hear)

    def expect(self, pattern: str) -> None:
        """Take what fits a pattern as belonging to the test."""
        self.expected.append(pattern)

    def unexpected(self) -> list[str]:
        """Return what nobody expected."""
        return [one for one in self.found if not any(re.search(pattern, one) for pattern in self.expected)]

    def _hear(self, message: ConsoleMessage) -> None:
        if message.type == "error":
            self.found.append(f"console: {message.text}")


def settled(page: Page) -> None:
    """Wait until the picture is there and nothing is on its way."""
    expect(page.locator(".viewer canvas").first).to_be_visible(timeout=LIMIT_MS)
    expect(page.locator(".note", has_text="Loading")).to_have_count(0, timeout=LIMIT_MS)
    expect(page.locator(".expecting")).to_have_count(0, timeout=LIMIT_MS)
    expect(page.locator(".readout", has_text="loading")).to_have_count(0, timeout=LIMIT_MS)
    expect(page.locator(".viewer:not([data-drawn=yes])")).to_have_count(0, timeout=LIMIT_MS)


def worker(page: Page, name: str) -> Worker:
    """Return a worker of the page by its name: "reading" or "drawing"."""
    return next(one for one in page.workers if one.evaluate("self.name") == name)


def iteration(page: Page) -> int:
    """Return where the first timeline stands."""
    return int(page.get_by_role("slider", name="Iteration").first.get_attribute("aria-valuenow") or -1)


def address(page: Page) -> str:
    """Return the address now; `page.url` is as old as the last news from the browser."""
    return str(page.evaluate("location.href"))


def status(page: Page) -> Locator:
    """Return the job's state in a word."""
    return page.locator(".status .pill")
