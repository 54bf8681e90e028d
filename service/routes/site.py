"""The web page: `/`, `/embed`, and the files they load."""

from __future__ import annotations

from fastapi import APIRouter, Request
from starlette.responses import HTMLResponse, Response

from service import pages
from service.problems import ProblemError
from service.site import NOT_BUILT, Site

router = APIRouter(include_in_schema=False)


@router.get("/")
async def index(request: Request) -> Response:
    """Return the page, or, where it is not built, a page that says so and what else there is."""
    if not _site(request).built:
        return HTMLResponse(pages.landing(str(request.base_url), NOT_BUILT))
    return _file(request, "index.html")


@router.get("/embed")
async def embed(request: Request) -> Response:
    """Return the page for frames on other people's pages."""
    return _file(request, "embed.html")


@router.get("/spherify-viewer.js")
async def element(request: Request) -> Response:
    """Return the custom element `<spherify-viewer>`."""
    return _file(request, "spherify-viewer.js")


@router.get("/icon.svg")
async def icon(request: Request) -> Response:
    """Return the page's icon."""
    return _file(request, "icon.svg")


@router.get("/assets/{name}")
async def asset(request: Request, name: str) -> Response:
    """Return a file that the page loads; its name holds a hash of its content."""
    return _file(request, f"assets/{name}")


def _site(request: Request) -> Site:
    site: Site = request.app.state.site
    return site


def _file(request: Request, name: str) -> Response:
    site = _site(request)
    found = site.find(name)
    if found is None:
        raise ProblemError("not-found", f"there is no file {name[:80]!r}" if site.built else NOT_BUILT)
    return found.answer(request)
