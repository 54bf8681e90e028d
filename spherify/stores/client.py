"""One way to talk to the server: bounded waits, one reconnect, our errors, scripts by name.

A client may be shared by threads; a forked process gets connections of its own.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib.resources import files
from typing import Any, Final

import redis
from redis.backoff import NoBackoff
from redis.exceptions import ClusterDownError, MasterDownError, TryAgainError
from redis.retry import Retry

from spherify.jobs.errors import StoreUnavailableError

# Refusals that pass: no memory, a replica, a server without its primary.
_PASSING: Final = (
    redis.OutOfMemoryError,
    redis.ReadOnlyError,
    MasterDownError,
    ClusterDownError,
    TryAgainError,
)
# The same, of which the client knows no class: no disk, no replica, a script that runs on.
_PASSING_WORDS: Final = ("MISCONF", "NOREPLICAS", "BUSY")
_BREAK_AFTER: Final = 3  # calls in a row that were not answered in time
_BREAK_S: Final = 0.5  # then all fail at once for this long, and one more is tried


def connect(url: str, *, timeout_s: float = 0.5) -> redis.Redis:
    """Return a client; nothing is sent before its first use.

    Args:
        url: redis://, rediss:// or unix://.
        timeout_s: longest wait for a connection and for an answer.

    """
    return redis.Redis.from_url(
        url,
        decode_responses=True,
        socket_timeout=timeout_s,
        socket_connect_timeout=timeout_s,
        **({} if url.startswith("unix:") else {"socket_keepalive": True}),  # TCP only
        # A pooled connection may be dead since the server's restart: once more, but not after a time-out.
        retry=_Breaker(NoBackoff(), 1, supported_errors=(redis.ConnectionError,)),
    )


class _Breaker(Retry):
    """Tries once more after a broken connection; when nobody is answered, spares the next ones their wait.

    Threads are few: if each waited for a server that hangs, whoever stands in line behind them would wait for them all.
    One of these is shared by all connections of a client.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:  # noqa: ANN401 (redis')
        super().__init__(*args, **kwargs)
        self._unanswered = 0
        self._till = 0.0

    def __deepcopy__(self, memo: dict[int, Any]) -> _Breaker:
        return self

    def call_with_retry(self, *args: Any, **kwargs: Any) -> Any:  # noqa: ANN401 (redis')
        """Call, or raise `redis.TimeoutError` at once."""
        if self._unanswered >= _BREAK_AFTER and time.monotonic() < self._till:
            raise redis.TimeoutError("it did not answer a moment ago")
        try:
            answer = super().call_with_retry(*args, **kwargs)
        except redis.TimeoutError:
            self._unanswered += 1
            self._till = time.monotonic() + _BREAK_S
            raise
        self._unanswered = 0
        return answer


@contextmanager
def reachable() -> Iterator[None]:
    """Turn what the client raises about the server into `StoreUnavailableError`; mistakes of ours pass."""
    try:
        yield
    except (redis.ConnectionError, redis.TimeoutError, OSError) as e:
        raise StoreUnavailableError(f"the job store does not answer: {e}") from e
    except redis.ResponseError as e:
        if isinstance(e, _PASSING) or str(e).startswith(_PASSING_WORDS):
            raise StoreUnavailableError(f"the job store refuses: {e}") from e
        raise


class Scripts:
    """The scripts of ``scripts/``, sent to the server once and called by name."""

    def __init__(self, client: redis.Redis) -> None:
        self._client = client
        self._known: dict[str, Any] = {}

    def __call__(self, name: str, keys: list[str], args: list[Any], *, common: bool = True) -> Any:  # noqa: ANN401
        """Run one script and return its answer; `common` puts the functions of jobs before it."""
        script = self._known.get(name)
        if script is None:
            text = (source("_common") if common else "") + source(name)
            script = self._known[name] = self._client.register_script(text)
        with reachable():
            return script(keys=keys, args=args)


@cache
def source(name: str) -> str:
    """Return the text of a script."""
    return files("spherify.stores").joinpath("scripts", f"{name}.lua").read_text("utf-8")
