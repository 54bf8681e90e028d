"""Queries hold to what is described: a misspelt filter must not list everything, nor a dry run make a job."""

from __future__ import annotations

from typing import get_origin

from fastapi import Depends, Request
from fastapi.routing import APIRoute

from service.problems import invalid


async def _known_query(request: Request) -> None:
    """Refuse parameters that the operation does not describe, or that say two things; async, to be spared a thread."""
    route = request.scope["route"]
    fields = route.dependant.query_params if isinstance(route, APIRoute) else []
    lists = {field.alias: get_origin(field.field_info.annotation) is list for field in fields}
    for name in request.query_params:
        if name not in lists:
            there = f"there are {', '.join(sorted(lists))}" if lists else "there are none"
            raise invalid(f"query/{name[:80]}", "unknown", f"this operation has no such parameter; {there}")
        if not lists[name] and len(request.query_params.getlist(name)) > 1:
            raise invalid(f"query/{name}", "repeated", "this parameter can be given once")


KNOWN_QUERY = Depends(_known_query)
