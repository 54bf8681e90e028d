"""Requests under their Idempotency-Keys, in a Redis-protocol server: see `spherify.jobs.repeats`."""

from __future__ import annotations

import time
from typing import Final

import redis

from spherify.jobs.errors import KeyReusedError, RequestInProgressError, StoreUnavailableError
from spherify.jobs.repeats import KEPT_S, Beginning
from spherify.stores import keys
from spherify.stores.client import Scripts, reachable
from spherify.stores.epoch import REBUILDING

BUSY_S: Final = 10.0
"""After which whoever took a key up is dead, or slow: doing it twice under one identity is harmless."""


class RedisRepeatStore:
    """A `spherify.jobs.repeats.RepeatStore`."""

    def __init__(self, client: redis.Redis, *, busy_s: float = BUSY_S) -> None:
        self._client = client
        self._scripts = Scripts(client)
        self._busy_ms = round(busy_s * 1000)

    def begin(self, key: str, fingerprint: str, identity: str) -> Beginning:
        """Take a request up; raises `KeyReusedError`, `RequestInProgressError`."""
        args = [fingerprint, identity, self._busy_ms, KEPT_S]
        found, *content = self._scripts("begin", [keys.repeat(key), keys.EPOCH], args, common=False)
        if found == "incomplete":
            raise StoreUnavailableError(REBUILDING)
        if found == "reused":
            raise KeyReusedError
        if found == "busy":
            raise RequestInProgressError
        return Beginning(*content)

    def remember(self, key: str, fingerprint: str, identity: str, begun_at: float) -> bool:
        """Take up again what was lost, for the rest of its day; False if there is something under the key."""
        left = round(begun_at + KEPT_S - time.time())
        args = [fingerprint, identity, left]
        return left > 0 and bool(self._scripts("remember", [keys.repeat(key)], args, common=False))

    def answered(self, key: str, answer: str) -> None:
        """Keep the answer."""
        self._scripts("answered", [keys.repeat(key)], [answer], common=False)

    def free(self, key: str) -> None:
        """Let the next one with this key carry it out, under the same identity."""
        with reachable():
            self._client.hdel(keys.repeat(key), "busy_until")

    def forget(self, key: str) -> None:
        """Let the key be used for anything."""
        with reachable():
            self._client.delete(keys.repeat(key))
