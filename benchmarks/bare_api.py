"""The least FastAPI can do for a poll: one route that returns one document of the size of a job."""

from __future__ import annotations

import json
import os
from typing import Any, Final

from fastapi import FastAPI

DOCUMENT: Final = "SPHERIFY_BENCH_DOCUMENT"  # the JSON that the route returns


def create_app() -> FastAPI:
    """Return an application with the one route ``/v1/jobs/{job_id}``."""
    app = FastAPI()
    document = json.loads(os.environ[DOCUMENT])

    @app.get("/v1/jobs/{job_id}")
    async def get_job(job_id: str) -> dict[str, Any]:
        return dict(document)

    return app
