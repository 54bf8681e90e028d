"""From errors to answers: the handlers that FastAPI is given, and the document itself."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING
from urllib.parse import quote

from fastapi import FastAPI
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response

from service.problems import (
    MEDIA_TYPE,
    FieldError,
    ProblemError,
    invalid_many,
    problem_of,
    problem_of_status,
)
from spherify.formats import FormatError
from spherify.geometry.errors import GeometryError
from spherify.jobs.errors import JobsError

if TYPE_CHECKING:
    from collections.abc import Mapping


def problem_answer(request: Request, problem: ProblemError) -> Response:
    """Return the problem document as an answer to this request."""
    document = problem.document(quote(request.scope["path"], errors="replace"), request.state.request_id)
    body = json.dumps(document, ensure_ascii=False, allow_nan=False).encode("utf-8", "replace")
    headers = {"Cache-Control": "no-store", **problem.all_headers}
    return Response(body, problem.type.status, headers, MEDIA_TYPE)


def add_handlers(app: FastAPI) -> None:
    """Let every error that has a problem type be answered with it; all others go to the guard."""
    for kind in (ProblemError, JobsError, GeometryError, FormatError):
        app.add_exception_handler(kind, _ours)
    app.add_exception_handler(HTTPException, _framework)
    app.add_exception_handler(RequestValidationError, _validation)
    app.add_exception_handler(ClientDisconnect, _gone)


async def _ours(request: Request, error: Exception) -> Response:
    problem = problem_of(error)
    if problem is None:
        raise error
    return problem_answer(request, problem)


async def _framework(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)  # noqa: S101 (registered for it)
    headers: Mapping[str, str] = error.headers or {}
    if "Allow" in headers:
        allowed = sorted(_methods(request))
        detail = f"{request.method} is not known here; {', '.join(allowed)} are"
        return problem_answer(
            request, problem_of_status(error.status_code, detail, {"Allow": ", ".join(allowed)})
        )
    detail = error.detail if error.detail != "Not Found" else f"there is nothing at {request.url.path}"
    return problem_answer(request, problem_of_status(error.status_code, detail, headers))


async def _validation(request: Request, error: Exception) -> Response:
    """Path, query and header values; bodies are read by the routes."""
    assert isinstance(error, RequestValidationError)  # noqa: S101 (registered for it)
    errors = [
        FieldError("/".join(map(str, found["loc"])), found["type"], found["msg"]) for found in error.errors()
    ]
    return problem_answer(request, invalid_many(errors))


async def _gone(request: Request, _: Exception) -> Response:
    """Answer a client that hung up: nobody reads it, but the log line has its status."""
    return problem_answer(request, ProblemError("malformed-request", "the connection closed within the body"))


def _methods(request: Request) -> set[str]:
    """Every method that some route knows at this path; the router itself stops at the first."""
    methods: set[str] = request.app.state.methods_at(request.scope["path"])
    return methods | {"HEAD"} if "GET" in methods else methods
