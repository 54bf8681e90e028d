"""The service through its HTTP interface, as a client has it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import httpx

from tests.stack import wait_for


class Api:
    """A client of a started service."""

    def __init__(self, url: str) -> None:
        self.http = httpx.Client(base_url=url, timeout=60, trust_env=False)

    def upload(self, path: Path, **query: str) -> httpx.Response:
        """Send a file as it is."""
        return self.http.put("/v1/meshes", params={"name": path.name, **query}, content=path.read_bytes())

    def submit(self, path: Path, **fields: str) -> dict[str, Any]:
        """Send a file as a form and return the job."""
        answer = self.http.post("/v1/jobs", files={"file": (path.name, path.read_bytes())}, data=fields)
        assert answer.status_code == 201, answer.text
        return dict(answer.json())

    def job(self, job_id: str) -> dict[str, Any]:
        """Return a job as it is now."""
        answer = self.http.get(f"/v1/jobs/{job_id}")
        assert answer.status_code == 200, answer.text
        return dict(answer.json())

    def finished(self, job_id: str, limit_s: float = 90.0) -> dict[str, Any]:
        """Wait for the end of a job."""
        wait_for(lambda: self.job(job_id)["done"], limit_s=limit_s, what=f"the end of {job_id}")
        return self.job(job_id)

    def download(self, job_id: str, name: str, folder: Path) -> Path:
        """Save a snapshot under the name the service gives it."""
        answer = self.http.get(f"/v1/jobs/{job_id}/snapshots/{name}")
        assert answer.status_code == 200, answer.text
        path = folder / answer.headers["content-disposition"].partition('filename="')[2].partition('"')[0]
        path.write_bytes(answer.content)
        return path
