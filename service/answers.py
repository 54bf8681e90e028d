"""From errors to answers: the handlers that FastAPI is given, and the document itself."""

from __future__ import annotations

import asyncio
import json
from contextlib import suppress
from typing import TYPE_CHECKING, Final
from urllib.parse import quote

from fastapi import FastAPI
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from service.problems import (
    MEDIA_TYPE,
    FieldError,
    ProblemError,
    clipped,
    invalid_many,
    problem_of,
    problem_of_status,
)
from spherify.formats import FormatError
from spherify.geometry.errors import GeometryError
from spherify.jobs.errors import JobsError

if TYPE_CHECKING:
    from collections.abc import Mapping


LINGER_S: Final = 2.0


def problem_answer(request: Request, problem: ProblemError) -> Response:
    """Return the problem document as an answer to this request."""
    document = problem.document(instance(request.scope["path"]), request.state.request_id)
    body = json.dumps(document, ensure_ascii=False, allow_nan=False).encode("utf-8", "replace")
    headers = {"Cache-Control": "no-store", **problem.all_headers}
    if _body_is_coming(request):
        return LastAnswer(body, problem.type.status, headers | {"Connection": "close"}, MEDIA_TYPE)
    return Response(body, problem.type.status, headers, MEDIA_TYPE)


def instance(path: str) -> str:
    """Return a path as the `instance` of a document: a reference that is in order, whatever was asked for."""
    return quote(clipped(path), errors="replace")


class LastAnswer(Response):
    """An answer to a request whose body is still coming and not wanted any more.

    Closing with bytes unread makes the kernel reset the connection, and many a client then loses the answer. So the
    answer goes out whole, and what still comes is thrown away until the client has stopped or a moment is over.
    """

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the answer, then linger."""
        start = {"type": "http.response.start", "status": self.status_code, "headers": self.raw_headers}
        await send(start)
        await send({"type": "http.response.body", "body": self.body, "more_body": True})
        with suppress(TimeoutError):
            async with asyncio.timeout(LINGER_S):
                more = True
                while more:
                    more = (await receive()).get("more_body", False)
        await send({"type": "http.response.body", "body": b"", "more_body": False})


def add_handlers(app: FastAPI) -> None:
    """Let every error that has a problem type be answered with it; all others go to the guard."""
    for kind in (ProblemError, JobsError, GeometryError, FormatError):
        app.add_exception_handler(kind, _ours)
    app.add_exception_handler(HTTPException, _framework)
    app.add_exception_handler(RequestValidationError, _validation)
    app.add_exception_handler(ClientDisconnect, _gone)


def _body_is_coming(request: Request) -> bool:
    announced = request.headers.get("content-length", "0") != "0" or "transfer-encoding" in request.headers
    return announced and not request.state.body_read


async def _ours(request: Request, error: Exception) -> Response:
    problem = problem_of(error)
    if problem is None or problem.type.is_failure:
        raise error  # to the guard, which logs it
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
    detail = (
        error.detail if error.detail != "Not Found" else f"there is nothing at {clipped(request.url.path)}"
    )
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
