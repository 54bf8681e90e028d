"""The OpenAPI description of an application: what FastAPI finds, and what only we know."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Final

from fastapi.openapi.utils import get_openapi
from pydantic.json_schema import models_json_schema

from service.extending import ExtendRequest
from service.requests import JobRequest
from service.schemas import ProblemOut

if TYPE_CHECKING:
    from fastapi import FastAPI

DESCRIPTION: Final = """A mesh goes in, a job morphs it by Vartziotis's curvature transformation (arXiv:1608.03898), \
snapshots come out while it runs.

Mesh, job, snapshot: each has its own life. Every answer carries `X-Request-ID`. Everything that goes wrong is \
`application/problem+json` (RFC 9457) with a `type` that leads to its description; branch on `type`, show `detail`. \
Times are RFC 3339 in UTC, links absolute paths, listings go by cursor. Every address that answers GET answers HEAD. \
What has an `ETag` heeds `If-None-Match` and `If-Match` (`precondition-failed`), also when it is to be deleted. New \
members may be added to answers at any time: ignore those you do not know. What pages of other sites have a browser \
send is refused (`cross-site`), and on a machine of one's own every name that is not its own (`unknown-host`).

A job is `accepted`, then `running`, and ends as `successful`, `failed` or `cancelled`; `cancelling` lies between. \
`done` is true for exactly the three ends. After the loss of a worker a job is `accepted` again, `attempt` rises, and \
it goes on from its last state. How the mathematics ended is another matter: `stop_reason`."""
TAGS: Final = [
    {"name": "Meshes", "description": "Upload, look at, download, delete. The same bytes are the same mesh."},
    {"name": "Jobs", "description": "Morph a mesh, follow, cancel, delete."},
    {"name": "Snapshots", "description": "Kept states of a job, in any format, also while it runs."},
    {
        "name": "Viewer",
        "description": "Bare arrays for drawing: triangles once, positions and fields of each state.",
    },
    {"name": "Metrics", "description": "Figures of a run over its iterations."},
    {"name": "Service", "description": "What it can do, and how it is."},
]
_REF: Final = "#/components/schemas/{model}"


def describe(app: FastAPI) -> dict[str, Any]:
    """Return the document of an application."""
    if app.openapi_schema is None:
        document = get_openapi(
            title=app.title,
            version=app.version,
            summary=app.summary,
            description=app.description,
            routes=app.routes,
            tags=TAGS,
            license_info={"name": "MIT", "identifier": "MIT"},
        )
        app.openapi_schema = _mended(document)
    return app.openapi_schema


def _mended(document: dict[str, Any]) -> dict[str, Any]:
    """Add the models that routes read or write themselves, and take out what FastAPI adds of its own accord."""
    _, models = models_json_schema(
        [(JobRequest, "validation"), (ExtendRequest, "validation"), (ProblemOut, "serialization")],
        ref_template=_REF,
    )
    schemas = document["components"]["schemas"] | models["$defs"]
    for name in ("HTTPValidationError", "ValidationError"):
        schemas.pop(name, None)
    document["components"]["schemas"] = dict(sorted(schemas.items()))
    for methods in document["paths"].values():
        for operation in methods.values():
            answers = operation["responses"]
            for status, answer in tuple(answers.items()):
                if "HTTPValidationError" in json.dumps(answer):
                    del answers[status]
            operation["responses"] = dict(sorted(answers.items()))
    return document
