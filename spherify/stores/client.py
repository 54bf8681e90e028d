"""One way to talk to the server: bounded waits, one reconnect, our errors, scripts by name.

A client may be shared by threads; a forked process gets connections of its own.
"""

from __future__ import annotations

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
        retry=Retry(NoBackoff(), 1, supported_errors=(redis.ConnectionError,)),
    )


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
