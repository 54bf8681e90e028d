"""Queries hold to what is described: a misspelt filter must not list everything, nor a dry run make a job."""

from __future__ import annotations

from fastapi import Depends, Request
from fastapi.routing import APIRoute

from service.problems import invalid


async def _known_query(request: Request) -> None:
    """Refuse query parameters that the operation does not describe; async, to be spared a thread."""
    route = request.scope["route"]
    known = {field.alias for field in route.dependant.query_params} if isinstance(route, APIRoute) else set()
    for name in request.query_params:
        if name not in known:
            there = f"there are {', '.join(sorted(known))}" if known else "there are none"
            raise invalid(f"query/{name[:80]}", "unknown", f"this operation has no such parameter; {there}")


KNOWN_QUERY = Depends(_known_query)
