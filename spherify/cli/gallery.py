"""The paper's shapes with a finished run each, made at the first start, so that the web page has something to show."""

from __future__ import annotations

import threading
from typing import Annotated, Any, Final, Self

import typer

from spherify.cli.console import REFUSED, err, fail
from spherify.cli.programs import Say
from spherify.client import Client, InvalidAddressError, ServiceError
from spherify.formats import write_mesh
from spherify.geometry.samples import SAMPLES

TAG: Final = "gallery"
VERTICES: Final = 2000
ORDER: Final = ("quadruped", "head", "sphere-bar", "stone", "cube", "cylinder", "non-convex-sphere")
FIELDS: Final[dict[str, str | list[str]]] = {"tags": TAG, "iterations": "600", "snapshots": "log:40"}
LOOK_S: Final = 0.5


def gallery(
    *,
    url: Annotated[
        str, typer.Option(metavar="URL", help="Address of the service.", envvar="SPHERIFY_URL")
    ] = "http://127.0.0.1:8000",
) -> None:
    """Give a running service's page its gallery: the paper's shapes with a finished run each, as `up` does by itself.

    Nothing is done on a service that has jobs but no gallery; a gallery that was begun is continued. Exit codes: 0 when
    the last run is submitted, 1 if the service fails, 2 for a wrong option.
    """
    try:
        with Client(url) as client:
            if not fill(client, threading.Event(), lambda _, words: err.print(words, markup=False)):
                err.print("no gallery: the service has jobs already")
    except InvalidAddressError as e:
        fail(f"--url: {e}", REFUSED)
    except ServiceError as e:
        fail(str(e))


class Gallery:
    """Makes the gallery in the background; a context manager."""

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
                fill(client, self._stop, self._say)
        except ServiceError as e:  # the service is needed more than its gallery
            self._say("gallery", f"not made: {e}")


def fill(client: Client, stop: threading.Event, say: Say) -> bool:
    """Submit one run after another, each when nobody else waits.

    It does so on a service that has no jobs at all, or goes on with a gallery that it began before: what is there
    by name is not made again. Returns whether it is there or begun.
    """
    there = {job["name"] for job in client.jobs(tag=TAG)}
    if not there and client.jobs():
        return False
    for name in ORDER:
        if name in there:
            continue
        if not _idle(client, stop):
            return True
        # Not by way of a file: a stop may end the process while the request waits for the service.
        content = write_mesh(SAMPLES[name].build(VERTICES), "obj")
        client.submit_content(f"{name}.obj", content, FIELDS | {"name": name})
        there.add(name)
    say("gallery", f"made: {len(there)} shapes")
    return True


def _idle(client: Client, stop: threading.Event) -> bool:
    """Wait until no job is waiting or running; return False if told to stop before that."""
    while not stop.is_set():
        counts: dict[str, Any] | None = client.info()["jobs"]  # None while the store does not answer
        if counts is not None and not any(map(counts.get, ("accepted", "running", "cancelling"))):
            return True
        stop.wait(LOOK_S)
    return False
