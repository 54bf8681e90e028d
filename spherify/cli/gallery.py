"""The paper's shapes with a finished run each, made at the first start, so that the web page has something to show."""

from __future__ import annotations

import tempfile
import threading
from pathlib import Path
from typing import Any, Final, Self

from spherify.cli.programs import Say
from spherify.client import Client, ServiceError
from spherify.formats import write_mesh
from spherify.geometry.samples import SAMPLES

TAG: Final = "gallery"
VERTICES: Final = 2000
ORDER: Final = ("quadruped", "head", "sphere-bar", "stone", "cube", "cylinder", "non-convex-sphere")
FIELDS: Final[dict[str, str | list[str]]] = {"tags": TAG, "iterations": "600", "snapshots": "log:40"}
LOOK_S: Final = 0.5


class Gallery:
    """Submits one run after another in the background, each when nobody else waits; a context manager.

    It does so on a service that has no jobs at all, or goes on with a gallery that it began before: what is there
    by name is not made again.
    """

    def __init__(self, url: str, say: Say) -> None:
        self._url = url
        self._say = say
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="gallery", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join(5.0)

    def _run(self) -> None:
        try:
            with Client(self._url) as client:
                self._fill(client)
        except ServiceError as e:  # the service is needed more than its gallery
            self._say("gallery", f"not made: {e}")

    def _fill(self, client: Client) -> None:
        there = {job["name"] for job in client.jobs(tag=TAG)}
        if not there and client.jobs():
            return
        for name in ORDER:
            if name in there:
                continue
            if not self._idle(client):
                return
            with tempfile.TemporaryDirectory(prefix="spherify-gallery-") as folder:
                path = Path(folder) / f"{name}.obj"
                path.write_bytes(write_mesh(SAMPLES[name].build(VERTICES), "obj"))
                client.submit(path, FIELDS | {"name": name})
            there.add(name)
        self._say("gallery", f"made: {len(there)} shapes")

    def _idle(self, client: Client) -> bool:
        """Wait until no job is on its way; returns whether there is still somebody to wait for."""
        while not self._stop.is_set():
            counts: dict[str, Any] = client.info()["jobs"] or {}
            if not any(counts.get(status) for status in ("accepted", "running", "cancelling")):
                return True
            self._stop.wait(LOOK_S)
        return False
