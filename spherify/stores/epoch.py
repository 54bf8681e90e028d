"""Whether the server still has all records: a key that is there unless everything was lost with it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import redis

from spherify.jobs.errors import StoreUnavailableError
from spherify.stores import keys
from spherify.stores.client import reachable

REBUILDING: Final = "the job records are being rebuilt from the files: try again in a moment"


def is_complete(client: redis.Redis) -> bool:
    """Return whether the records are all there, as far as the server knows."""
    with reachable():
        return bool(client.exists(keys.EPOCH))


@contextmanager
def complete_throughout(client: redis.Redis) -> Iterator[None]:
    """Raise `StoreUnavailableError` unless all records are there from the beginning to the end: none is missed."""
    with reachable():
        before = client.get(keys.EPOCH)
    if before is None:
        raise StoreUnavailableError(REBUILDING)
    yield
    with reachable():
        after = client.get(keys.EPOCH)
    if after != before:  # lost meanwhile, and perhaps rebuilt already
        raise StoreUnavailableError(REBUILDING)
