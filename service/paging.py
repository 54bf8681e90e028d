"""Listings: limits, cursors and the `Link` header (RFC 8288)."""

from __future__ import annotations

from typing import Annotated, Final
from urllib.parse import urlencode

from fastapi import Query
from starlette.requests import Request

DEFAULT_LIMIT: Final = 50
MAX_LIMIT: Final = 200

Limit = Annotated[int, Query(ge=1, le=MAX_LIMIT, description="Entries at most.")]
Cursor = Annotated[
    str | None,
    Query(
        min_length=1,
        max_length=200,
        description="`next_cursor` of the slice before; newest first without it.",
    ),
]


def links(request: Request, next_cursor: str | None) -> dict[str, str]:
    """Return the paths of this slice and the next."""
    asked = request.query_params.multi_items()
    found = {"self": _path(request, asked)}
    if next_cursor is not None:
        others = [(name, value) for name, value in asked if name != "cursor"]
        found["next"] = _path(request, [*others, ("cursor", next_cursor)])
    return found


def link_header(found: dict[str, str]) -> dict[str, str]:
    """Return the `Link` header, if there is a next slice."""
    return {"Link": f'<{found["next"]}>; rel="next"'} if "next" in found else {}


def _path(request: Request, query: list[tuple[str, str]]) -> str:
    return request.url.path + (f"?{urlencode(query)}" if query else "")
