"""One bucket of an S3 server: requests that are repeated for a while, and errors in the words of the stores.

Nothing here survives a fork: the threads of the client stay behind, and a request of the child would never end. A
process that forks must leave the first request to its children; making the client sends nothing, and starts nothing.
"""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable
from datetime import timedelta
from threading import Lock
from typing import Final, TypeVar
from urllib.parse import urlsplit

import obstore
from obstore.exceptions import (
    BaseError,
    PermissionDeniedError,
    PreconditionError,
    UnauthenticatedError,
)
from obstore.store import S3Store

from spherify.jobs.errors import BlobNotFoundError, DamagedBlobError, StorageFullError, StoreUnavailableError

REQUEST_S: Final = 4.0  # one request of at most `WINDOW` bytes
WINDOW: Final = 2 * 1024 * 1024
_CONNECT_S: Final = 1.0
_PING_S: Final = 1.0
_PAUSE_S: Final = 0.25
_ENDPOINTS: Final = ("AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL", "AWS_ENDPOINT")
_FULL: Final = re.compile(r"code: 507 |<Code>(XMinioStorageFull|QuotaExceeded|InsufficientCapacity)<")
_REFUSED: Final = re.compile(r"code: 40[13] ")
_NO_BUCKET: Final = "<Code>NoSuchBucket<"
_REASONS: Final = (r"<Code>(\w+)<", r"status code: (\d+ [A-Z][\w ]+)", r"HTTP error: ([\w ]+)")
T = TypeVar("T")


class S3Client:
    """A bucket, or what lies below a prefix in it.

    The endpoint, the region and the credentials come from where AWS's own tools look for them: ``AWS_ENDPOINT_URL``,
    ``AWS_REGION``, ``AWS_ACCESS_KEY_ID`` and so on, a web identity, or the role of the machine.

    Args:
        url: ``s3://bucket`` or ``s3://bucket/prefix``.
        patience_s: how long a call is repeated while the server does not answer.
        request_s: longest wait for the answer to one request of at most `WINDOW` bytes.

    """

    def __init__(self, url: str, *, patience_s: float, request_s: float) -> None:
        parts = urlsplit(url)
        self._bucket, self._prefix = parts.netloc, parts.path.strip("/")
        self.patience_s = patience_s
        self.request_s = request_s
        self._lock = Lock()
        # By default a thread for each processor: far more than it needs, and each takes of a runner's address space.
        os.environ.setdefault("TOKIO_WORKER_THREADS", "2")
        self._store: S3Store | None = None

    @property
    def store(self) -> S3Store:
        """For requests of at most `WINDOW` bytes."""
        with self._lock:
            if self._store is None:
                self._store = self.connected(self.request_s)
            return self._store

    def connected(self, request_s: float, *, retries: int = 3) -> S3Store:
        """Return a store whose requests may take so long."""
        plain = any(os.environ.get(name, "").startswith("http://") for name in _ENDPOINTS)
        return S3Store(
            self._bucket,
            prefix=self._prefix or None,
            config={
                "disable_bulk_delete": True,  # one request a blob either way, and every server knows this one
                # The server is told what is to come and compares. One that only counts on the length may take a
                # request cut off before its content for a whole, empty one (SeaweedFS does).
                "checksum_algorithm": "SHA256",
            },
            client_options={
                "timeout": timedelta(seconds=request_s),
                "connect_timeout": timedelta(seconds=min(_CONNECT_S, request_s)),
                **({"allow_http": True} if plain else {}),
            },
            retry_config={  # what is over in a moment; the rest is for `ask`
                "max_retries": retries,
                "retry_timeout": timedelta(seconds=3),
                "backoff": {
                    "init_backoff": timedelta(seconds=0.1),
                    "max_backoff": timedelta(seconds=1),
                    "base": 2,
                },
            },
        )

    def head(self, key: str) -> obstore.GetResult:
        """Return what is known of a blob, without its content; raises `BlobNotFoundError`."""
        return self.ask(lambda: obstore.get(self.store, key, options={"head": True}), key)

    def read_range(self, key: str, start: int, end: int, etag: str | None) -> bytes:
        """Return some bytes of a blob; raises `BlobNotFoundError` if it is not the one with that tag any more."""

        def fetch() -> bytes:
            found = obstore.get(self.store, key, options={"range": (start, end), "if_match": etag})
            return bytes(found.bytes())

        content = self.ask(fetch, key)
        if len(content) != end - start:
            raise DamagedBlobError(f"{key} ends before byte {end}")
        return content

    def ping(self) -> None:
        """Raise `StoreUnavailableError` unless the server answers, within a second or so, and has the bucket."""
        store = self.connected(_PING_S, retries=0)
        self.ask(lambda: list(obstore.list(store, "ping")), "ping", patience_s=0)

    def ask(self, call: Callable[[], T], key: str, *, patience_s: float | None = None) -> T:
        """Call, again and again while the server does not answer, and translate its errors."""
        till = time.monotonic() + (self.patience_s if patience_s is None else patience_s)
        while True:
            try:
                return _translated(call, key)
            except StoreUnavailableError:
                if time.monotonic() + _PAUSE_S > till:
                    raise
                time.sleep(_PAUSE_S)


def _translated(call: Callable[[], T], key: str) -> T:
    try:
        return call()
    except FileNotFoundError as e:
        if _NO_BUCKET in str(e):
            raise StoreUnavailableError("the object store has no such bucket") from e
        raise BlobNotFoundError(f"there is no blob {key}") from e
    except PreconditionError as e:
        raise BlobNotFoundError(f"{key} was deleted, and is another blob now") from e
    except BaseError as e:
        if _FULL.search(str(e)):
            raise StorageFullError(f"there is no space left to store {key}") from e
        if isinstance(e, PermissionDeniedError | UnauthenticatedError) or _REFUSED.search(str(e)):
            raise StoreUnavailableError(f"the object store refuses our credentials{_reason(e)}") from e
        raise StoreUnavailableError(f"the object store does not answer as it should{_reason(e)}") from e


def _reason(error: BaseError) -> str:
    """Return what the server said, without addresses: it may be told to clients."""
    found = next(filter(None, (re.search(reason, str(error)) for reason in _REASONS)), None)
    return "" if found is None else f": {found[1].strip()}"
