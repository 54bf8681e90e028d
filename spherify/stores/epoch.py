"""Whether the server still has all records: a key that is there unless everything was lost with it."""

from __future__ import annotations

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


def require_complete(client: redis.Redis) -> None:
    """Raise `StoreUnavailableError` while records may be missing: what is not there may come back."""
    if not is_complete(client):
        raise StoreUnavailableError(REBUILDING)
