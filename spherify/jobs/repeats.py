"""A request that may be sent twice and is to be carried out once: what is kept under its Idempotency-Key.

    begin ─► busy ─► answered        the answer is kept, and given to whoever asks the same again
               │
               ├──► free             it is not known whether it took effect: the next one begins with the same identity
               └──► (forgotten)      it was refused, and had no effect

The identity is that of what the request makes. It is fixed before anything is made, so that a repetition after a
crash makes the same thing, not a second one. Should the server lose its records, name, fingerprint and identity come
back with the job, from its ``spec.json``: a repetition is then carried out once more, and finds the job. Of a deleted
one they come back from its tombstone: a repetition is told that it is gone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Protocol

KEPT_S: Final = 24 * 3600


@dataclass(frozen=True, slots=True)
class Beginning:
    """What `RepeatStore.begin` found.

    Attributes:
        identity: of what is to be made: the one given, or that of an earlier attempt at the same request.
        answer: what was answered before; None if the request is to be carried out.

    """

    identity: str
    answer: str | None = None


class RepeatStore(Protocol):
    """Requests by key; what is kept is forgotten after a day."""

    def begin(self, key: str, fingerprint: str, identity: str) -> Beginning:
        """Take a request up.

        Raises:
            KeyReusedError: the key came with another request before.
            RequestInProgressError: the same request is being carried out.
            StoreUnavailableError: nothing may be done: it could be done twice. So it is while records are being
                rebuilt, and the key may be among them.

        """
        ...

    def remember(self, key: str, fingerprint: str, identity: str, begun_at: float) -> bool:
        """Take up again what was lost: a request begun at a time (seconds since the epoch), without its answer.

        False, and nothing changes, if there is something under the key, or its day is over.
        """
        ...

    def answered(self, key: str, answer: str) -> None:
        """Keep the answer."""
        ...

    def free(self, key: str) -> None:
        """Let the next one with this key carry it out, under the same identity."""
        ...

    def forget(self, key: str) -> None:
        """Let the key be used for anything."""
        ...
