"""One process at a time reconciles."""

from __future__ import annotations

import redis

from spherify.stores import keys
from spherify.stores.client import Scripts


class Leadership:
    """A lease on the post of the reconciler, kept by asking again before it runs out."""

    def __init__(self, client: redis.Redis, name: str, *, lease_s: float) -> None:
        self._scripts = Scripts(client)
        self._name = name
        self._lease_ms = round(lease_s * 1000)

    def acquire(self) -> bool:
        """Become or stay the leader; False while somebody else is. Raises `StoreUnavailableError`."""
        return bool(self._scripts("lead", [keys.LEADER], [self._name, self._lease_ms], common=False))

    def resign(self) -> None:
        """Step down, so that the next one need not wait. Raises `StoreUnavailableError`."""
        self._scripts("unlead", [keys.LEADER], [self._name], common=False)
