"""Requests that are to be answered only as long as something has, or has not, changed (RFC 9110, 13.1)."""

from __future__ import annotations

import re
from typing import Final

from starlette.requests import Request

from service.problems import ProblemError

_TAG: Final = re.compile(r'(W/)?("[^"]*")')


def matches(request: Request, etag: str) -> bool:
    """Whether `If-None-Match` names this tag, compared weakly."""
    return bool(_named(request, "if-none-match", etag, weakly=True))


def is_conditional(request: Request) -> bool:
    """Whether there is anything to heed."""
    return "if-match" in request.headers or "if-none-match" in request.headers


def heed(request: Request, etag: str) -> None:
    """Ask the conditions of a request about what has this tag now.

    A GET or HEAD of what `If-None-Match` names is answered with 304, which is for whoever answers it.

    Raises:
        ProblemError: precondition-failed: `If-Match` does not name the tag, compared strongly; or `If-None-Match` does,
            and this is to change something.

    """
    if _named(request, "if-match", etag, weakly=False) is False:
        raise ProblemError("precondition-failed", f"it is {etag} now, and `If-Match` does not name that")
    if request.method != "GET" and matches(request, etag):
        raise ProblemError("precondition-failed", f"it is {etag} now, which `If-None-Match` rules out")


def _named(request: Request, header: str, etag: str, *, weakly: bool) -> bool | None:
    """Whether a header names a tag, or anything that is there; None if it was not sent."""
    sent = request.headers.getlist(header)
    if not sent:
        return None
    weak, bare = etag.startswith("W/"), etag.removeprefix("W/")
    found = _TAG.findall(", ".join(sent))
    return any(one.strip() == "*" for one in sent) or any(
        tag == bare and (weakly or not (mark or weak)) for mark, tag in found
    )
