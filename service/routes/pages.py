"""Pages for people; not part of the API's description."""

from __future__ import annotations

from fastapi import APIRouter, Request
from starlette.responses import HTMLResponse, JSONResponse, Response

from service import pages
from service.problem_types import PROBLEMS
from service.problems import ProblemError

router = APIRouter(include_in_schema=False)


@router.get("/docs")
async def documentation(request: Request) -> Response:
    """Return the OpenAPI document as a page."""
    return HTMLResponse(pages.documentation(request.app.openapi()))


@router.get("/openapi.json")
async def openapi(request: Request) -> Response:
    """Return the OpenAPI document."""
    return JSONResponse(request.app.openapi())


@router.get("/problems")
async def problem_index() -> Response:
    """List every problem type."""
    return HTMLResponse(pages.problem_index())


@router.get("/problems/{slug}")
async def problem(slug: str) -> Response:
    """Describe one problem type."""
    if slug not in PROBLEMS:
        raise ProblemError("not-found", f"there is no problem type {slug[:80]!r}")
    return HTMLResponse(pages.problem_page(PROBLEMS[slug]))
