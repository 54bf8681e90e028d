"""Polls, answered before the router.

Most requests ask for one job and nothing else. To find their route among all others, and to resolve what it
depends on, takes longer than the answer; so they are recognised by their path. What is answered is the same.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from starlette.requests import Request
from starlette.types import ASGIApp, Receive, Scope, Send

from service.job_answers import job_answer
from spherify.jobs.ids import JOB_ID

if TYPE_CHECKING:
    from service.context import Services

_POLL: Final = re.compile(f"/v1/jobs/({JOB_ID.pattern})")


class Polls:
    """Answers ``GET /v1/jobs/{id}`` without a query, as its route does, and hands on everything else."""

    def __init__(self, app: ASGIApp, services: Services) -> None:
        self._app = app
        self._services = services

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        asked = None
        if scope["type"] == "http" and scope["method"] == "GET" and not scope["query_string"]:
            asked = _POLL.fullmatch(scope["path"])
        if asked is None:
            await self._app(scope, receive, send)
            return
        services = self._services
        job = await services.reader.get(asked[1])
        answer = job_answer(Request(scope), job, document=services.documents.document)
        await answer(scope, receive, send)
