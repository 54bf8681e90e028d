"""The composition root of the HTTP service: `python -m service`."""

from __future__ import annotations

import logging
import os
import socket
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

from anyio import to_thread
from fastapi import FastAPI
from fastapi.routing import iter_route_contexts
from starlette.middleware import Middleware
from starlette.routing import compile_path

from service.answers import add_handlers
from service.context import Services, Stores
from service.description import DESCRIPTION, TAGS, describe
from service.gate import Gate
from service.logs import set_up as set_up_logs
from service.middleware import EXPOSED, REQUEST_ID, Cors, ErrorGuard, RequestContext
from service.polls import Polls
from service.routes import arrays, continuations, events, jobs, meshes, pages, service, site, snapshots
from service.site import Site
from service.stopping import on_stop
from spherify import __version__
from spherify.settings import Settings, unknown_variables
from spherify.stores.connect import open_stores
from spherify.stores.reconciler import ReconcilerThread

log = logging.getLogger(__name__)


def create_app(
    settings: Settings | None = None, stores: Stores | None = None, *, loopback: str | None = None
) -> FastAPI:
    """Build the service.

    Args:
        settings: read from the environment by default.
        stores: opened as the settings say by default, and then looked after by a reconciler too; they are closed
            when the service stops.
        loopback: the name under which it listens, if only programs of this machine can reach it.

    """
    if settings is None:  # started as a program of its own
        set_up_logs()
        settings = Settings()
        for sentence in unknown_variables(os.environ):
            log.warning(sentence)
    reconciler = (
        None if stores else ReconcilerThread(settings, name=f"api@{socket.gethostname()}/{os.getpid()}")
    )
    stores = stores or open_stores(settings)
    services = Services.of(settings, stores)

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        if reconciler is not None:
            reconciler.start()
        with on_stop(services.watch.close):
            yield
        if reconciler is not None:
            reconciler.stop()
        await to_thread.run_sync(stores.close)

    app = FastAPI(
        title="Spherify",
        version=__version__,
        summary="Morphs triangle meshes into spheres by the curvature transformation.",
        description=DESCRIPTION,
        openapi_tags=TAGS,
        docs_url=None,  # the usual pages load from other hosts; ours is in routes/pages.py
        redoc_url=None,
        openapi_url=None,
        redirect_slashes=False,
        lifespan=lifespan,
        middleware=_middleware(settings, services, loopback),
    )
    app.state.site = Site()
    app.state.services = services
    for part in (jobs, continuations, events, snapshots, arrays, meshes, service, pages, site):
        app.include_router(part.router)
    app.state.methods_at = _methods_at(app)
    add_handlers(app)
    app.openapi = lambda: describe(app)  # type: ignore[method-assign] # FastAPI's documented way
    return app


def _middleware(settings: Settings, services: Services, loopback: str | None) -> list[Middleware]:
    """Outermost first: the identifier is on every answer, CORS on every failure but its own and the gate's."""
    cors = Middleware(
        Cors,
        allow_origins=settings.cors_origins,
        allow_methods=["GET", "HEAD", "POST", "PUT", "DELETE"],
        allow_headers=[
            "Content-Digest",
            "Content-Type",
            "Idempotency-Key",
            "If-Match",
            "If-None-Match",
            "If-Range",
            "Last-Event-ID",
            "Prefer",
            "Range",
            REQUEST_ID,
        ],
        expose_headers=EXPOSED,
    )
    guard = Middleware(ErrorGuard)
    polls = Middleware(Polls, services)
    gate = Middleware(Gate, settings, loopback)
    return [Middleware(RequestContext), guard, gate, *([cors, guard] if settings.cors_origins else []), polls]


def _methods_at(app: FastAPI) -> Callable[[str], set[str]]:
    """Return what tells the methods known at a path."""
    table: list[tuple[Any, set[str]]] = [
        (compile_path(context.path)[0], set(context.methods or ()))
        for context in iter_route_contexts(app.routes)
        if context.path is not None
    ]

    def methods_at(path: str) -> set[str]:
        return set().union(*(methods for pattern, methods in table if pattern.match(path)))

    return methods_at
