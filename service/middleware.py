"""Around every request: its identifier, its log line, HEAD, and the guard that makes a document of any failure."""

from __future__ import annotations

import logging
import re
import time
from http import HTTPStatus
from typing import Final

from starlette.datastructures import Headers, MutableHeaders
from starlette.middleware.cors import CORSMiddleware
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from ulid import ULID

from service.answers import problem_answer
from service.problems import ProblemError, clipped, problem_of, problem_of_status
from spherify.jobs.errors import BlobNotFoundError
from spherify.logs import current_request

REQUEST_ID: Final = "X-Request-ID"
EXPOSED: Final = (
    "Location",
    "ETag",
    "Link",
    "Retry-After",
    "Content-Disposition",
    "Content-Range",
    "Accept-Ranges",
    "Allow",
    "Idempotent-Replayed",
    "Preference-Applied",
    REQUEST_ID,
)
_ID: Final = re.compile(r"[A-Za-z0-9._-]{1,64}")
access_log = logging.getLogger("service.access")
error_log = logging.getLogger("service.error")


class RequestContext:
    """Gives every request an identifier and a log line; HEAD is GET without its body (RFC 9110, 9.3.2)."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        given = Headers(scope=scope).get(REQUEST_ID, "")
        request_id = given if _ID.fullmatch(given) else f"req_{ULID()}"
        head = scope["method"] == "HEAD"
        inner = {**scope, "method": "GET", "head": True} if head else dict(scope)
        inner["state"] = {**scope.get("state", {}), "request_id": request_id, "body_read": False}
        current_request.set(request_id)
        began = time.perf_counter()
        status = 0

        async def answer(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                MutableHeaders(scope=message)[REQUEST_ID] = request_id
            elif head and message["type"] == "http.response.body":
                message = {**message, "body": b""}
            await send(message)

        async def listen() -> Message:
            message = await receive()
            inner["state"]["body_read"] = not message.get("more_body", False)
            return message

        try:
            await self._app(inner, listen, answer)
        finally:
            path = clipped(scope.get("raw_path", b"").decode("latin-1"))
            figures = {
                "method": scope["method"],
                "path": path,
                "status": status,
                "ms": round((time.perf_counter() - began) * 1000, 1),
            }
            access_log.info("%s %s %d", scope["method"], path, status, extra=figures)


class ErrorGuard:
    """Makes a problem document of whatever escapes the application, middleware included.

    A record may have come to name another file while the answer was made: a later attempt made a state again, and the
    earlier one's file went when the job ended; or a job or mesh was deleted. A GET that missed a file is therefore
    answered once more, by the record as it is now; only a file that is still named, and missing, is said to be.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        if (refusal := scope["state"].get("refusal")) is not None:  # by the server
            await problem_answer(Request(scope), refusal)(scope, receive, send)
            return
        started = False

        async def watch(message: Message) -> None:
            nonlocal started
            started = started or message["type"] == "http.response.start"
            await send(message)

        try:
            try:
                await self._app(dict(scope), receive, watch)
            except BlobNotFoundError:
                if started or scope["method"] != "GET":
                    raise
                await self._app(scope, receive, watch)
        except Exception as e:  # the last resort: everything is answered and logged here
            if started:
                raise  # the status is out: the connection must break, or half an answer passes for a whole one
            problem = problem_of(e)
            if problem is None:
                problem = ProblemError("internal-error", "the request could not be completed")
            if problem.type.is_failure:
                error_log.exception("a request failed")
            await problem_answer(Request(scope), problem)(scope, receive, send)


class Cors(CORSMiddleware):
    """CORS whose refusals are problem documents too."""

    def preflight_response(self, request_headers: Headers) -> Response:
        """Answer a preflight."""
        response = super().preflight_response(request_headers)
        if response.status_code == HTTPStatus.OK:
            return response
        detail = bytes(response.body).decode()
        headers = {name: value for name, value in response.headers.items() if not name.startswith("content-")}
        raise problem_of_status(response.status_code, detail, headers)
