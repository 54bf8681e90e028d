"""The twin in memory of `spherify.stores.repeats`, for tests of what uses it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from spherify.jobs.errors import KeyReusedError, RequestInProgressError
from spherify.jobs.repeats import KEPT_S, Beginning


@dataclass
class _Kept:
    fingerprint: str
    identity: str
    till: float
    busy: bool
    answer: str | None = None


class MemoryRepeatStore:
    """A `spherify.jobs.repeats.RepeatStore`; whoever took a key up holds it until it says how it went."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._kept: dict[str, _Kept] = {}

    def begin(self, key: str, fingerprint: str, identity: str) -> Beginning:
        """Take a request up; raises `KeyReusedError`, `RequestInProgressError`."""
        kept = self._get(key)
        if kept is None:
            self._kept[key] = _Kept(fingerprint, identity, self._clock() + KEPT_S, busy=True)
            return Beginning(identity)
        if kept.fingerprint != fingerprint:
            raise KeyReusedError
        if kept.answer is not None:
            return Beginning(kept.identity, kept.answer)
        if kept.busy:
            raise RequestInProgressError
        kept.busy = True
        return Beginning(kept.identity)

    def remember(self, key: str, fingerprint: str, identity: str, begun_at: float) -> bool:
        """Take up again what was lost, for the rest of its day; False if there is something under the key."""
        till = begun_at + KEPT_S
        if self._get(key) is not None or till <= self._clock():
            return False
        self._kept[key] = _Kept(fingerprint, identity, till, busy=False)
        return True

    def answered(self, key: str, answer: str) -> None:
        """Keep the answer."""
        if (kept := self._get(key)) is not None:
            kept.answer, kept.busy = answer, False

    def free(self, key: str) -> None:
        """Let the next one with this key carry it out, under the same identity."""
        if (kept := self._get(key)) is not None:
            kept.busy = False

    def forget(self, key: str) -> None:
        """Let the key be used for anything."""
        self._kept.pop(key, None)

    def _get(self, key: str) -> _Kept | None:
        kept = self._kept.get(key)
        return kept if kept is not None and kept.till > self._clock() else None
