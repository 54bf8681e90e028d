"""The twin of the blob store in memory."""

from __future__ import annotations

import io
import threading
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO

from spherify.jobs.errors import BlobExistsError, BlobNotFoundError
from spherify.jobs.ports import BlobStat
from spherify.stores.blobs import check_key


class MemoryBlobStore:
    """Blobs in a dictionary; unfinished files are real ones, in a folder of the caller's."""

    def __init__(self, scratch: Path) -> None:
        self._blobs: dict[str, tuple[bytes, float]] = {}
        self._lock = threading.Lock()
        self._scratch = scratch

    def create(self, key: str, chunks: bytes | Iterable[bytes]) -> BlobStat:
        """Store under a new key; raises `BlobExistsError`."""
        check_key(key)
        content = chunks if isinstance(chunks, bytes) else b"".join(chunks)
        with self._lock:
            if key in self._blobs:
                raise BlobExistsError(f"{key} is written already")
            self._blobs[key] = (content, time.time())
            return BlobStat(key, len(content), self._blobs[key][1])

    def copy(self, source: str, key: str) -> BlobStat:
        """Store what lies under one key under a new one as well; raises as `create` does, `BlobNotFoundError`."""
        return self.create(key, self.read(source))

    def adopt(self, key: str, path: Path) -> BlobStat:
        """Move a finished file in under a new key; raises as `create` does."""
        stat = self.create(key, path.read_bytes())
        path.unlink()
        return stat

    def scratch(self) -> Path:
        """Return the folder for unfinished files."""
        return self._scratch

    def open(self, key: str) -> BinaryIO:
        """Open for reading, seekable; raises `BlobNotFoundError`."""
        return io.BytesIO(self.read(key))

    def read(self, key: str) -> bytes:
        """Return the whole blob; raises `BlobNotFoundError`."""
        check_key(key)
        if key not in self._blobs:
            raise BlobNotFoundError(f"there is no blob {key}")
        return self._blobs[key][0]

    def stat(self, key: str) -> BlobStat | None:
        """Return what is known of a key, None if nothing is stored there."""
        check_key(key)
        found = self._blobs.get(key)
        return None if found is None else BlobStat(key, len(found[0]), found[1])

    def list(self, prefix: str) -> Iterator[BlobStat]:
        """Yield every blob below a folder-like prefix, sorted by key."""
        folder = prefix.rstrip("/")
        for key in sorted(self._blobs):
            if (not folder or key.startswith(f"{folder}/")) and (stat := self.stat(key)) is not None:
                yield stat

    def delete(self, key: str) -> bool:
        """Remove one blob; whether it was there."""
        check_key(key)
        return self._blobs.pop(key, None) is not None

    def folders(self, prefix: str) -> Iterator[str]:
        """Yield the names of what looks like folders directly below a prefix, sorted."""
        with self._lock:
            below = [key.removeprefix(prefix) for key in self._blobs if key.startswith(prefix)]
        yield from sorted({name.partition("/")[0] for name in below if "/" in name})

    def ping(self) -> None:
        """Memory is there."""
