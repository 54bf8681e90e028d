"""A sign of life, given by Celery's event loop to the server and to this process: it stops when the loop does."""

from __future__ import annotations

from typing import Any, Final

from celery import bootsteps

from spherify.jobs.errors import StoreUnavailableError
from spherify.settings import Settings
from spherify.stores import keys
from spherify.stores.client import connect, reachable

PERIOD_S: Final = 2.0
LIFE_S: Final = 15
_turns = [0]  # signs of life given by this process


class SignOfLife(bootsteps.StartStopStep):  # type: ignore[misc] # celery has no types
    """Writes the key of this worker, and counts, every other second while the consumer's timer runs."""

    requires = ("celery.worker.consumer.tasks:Tasks",)

    def __init__(self, parent: Any, **kwargs: Any) -> None:  # noqa: ANN401 (Celery's consumer)
        super().__init__(parent, **kwargs)
        self._client = connect(Settings().redis_url)
        self._entry: Any = None

    def start(self, parent: Any) -> None:  # noqa: ANN401 (as above)
        """Begin, each time the consumer has connected."""
        self._write(parent.hostname)
        self._entry = parent.timer.call_repeatedly(PERIOD_S, self._write, (parent.hostname,))

    def stop(self, parent: Any) -> None:  # noqa: ANN401 (as above; Celery calls it so)
        """Pause, each time the connection is lost."""
        if self._entry is not None:
            self._entry.cancel()
            self._entry = None

    def _write(self, hostname: str) -> None:
        _turns[0] += 1
        try:
            with reachable():
                self._client.set(keys.WORKER + hostname, "alive", ex=LIFE_S)
        except StoreUnavailableError:
            return  # the missing key says it


def turns() -> int:
    """Return how often this process's event loop has given a sign of life."""
    return _turns[0]


def is_alive(redis_url: str, hostname: str) -> bool:
    """Whether this worker's event loop runs; raises `StoreUnavailableError`."""
    with reachable():
        return bool(connect(redis_url).exists(keys.WORKER + hostname))
