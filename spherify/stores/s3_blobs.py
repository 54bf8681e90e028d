"""Blobs in an S3 bucket: the promises of the folder, for services and workers on several hosts.

A blob is one conditional ``PUT`` (``If-None-Match: *``): the server makes it whole or not at all, and of any number of
writers one wins. An answer can get lost when the blob was made. Each write therefore carries a name of its own among
the blob's attributes, and whoever is told "exists already" looks whose it is: a write that is repeated is never refused
because of itself. The sha-256 of the content goes along as the request's checksum, so that the server stores nothing
that was cut off, and is kept beside that name: `read` compares.

A blob is at most 5 GiB, which is what S3 takes in one request.
"""

from __future__ import annotations

import hashlib
import io
import mmap
import os
import time
import uuid
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import BinaryIO, Final

import obstore
from obstore.exceptions import AlreadyExistsError

from spherify.jobs.errors import (
    BlobExistsError,
    BlobNotFoundError,
    DamagedBlobError,
    StoreUnavailableError,
)
from spherify.jobs.ports import BlobStat
from spherify.jobs.reconcile import SCRATCH_S, sweep_scratch
from spherify.stores.blobs import KEY, check_key, naming_full
from spherify.stores.s3_client import REQUEST_S, WINDOW, S3Client

_FIRST: Final = 256 * 1024  # bytes of the first look into a blob; doubled while it is read on
SLOWEST: Final = 512 * 1024  # bytes/s: an upload may take as long as this would
_SHA256: Final = "sha256"
_WRITER: Final = "writer"


class S3BlobStore:
    """A `spherify.jobs.ports.BlobStore` in a bucket.

    Args:
        url: ``s3://bucket`` or ``s3://bucket/prefix``; the rest is in the environment, see `S3Client`.
        scratch: folder of this host for unfinished files, made when it is missing.
        patience_s: how long a call is repeated while the server does not answer.
        request_s: longest wait for one answer; larger blobs have more time.

    """

    def __init__(self, url: str, scratch: Path, *, patience_s: float, request_s: float = REQUEST_S) -> None:
        self._client = S3Client(url, patience_s=patience_s, request_s=request_s)
        self._scratch = scratch
        scratch.mkdir(parents=True, exist_ok=True)
        sweep_scratch(scratch.iterdir(), SCRATCH_S)  # the reconciler sweeps on the host where it runs

    def create(self, key: str, chunks: bytes | Iterable[bytes]) -> BlobStat:
        """Store under a new key; raises `BlobExistsError`, `StorageFullError`. Durable on return."""
        check_key(key)
        if isinstance(chunks, bytes):
            return self._put(key, memoryview(chunks))
        self._spare(key)
        path = self._scratch / f"{uuid.uuid4().hex}.part"
        try:
            with naming_full(key), path.open("xb") as file:
                for chunk in chunks:
                    file.write(chunk)
            return self._put(key, _mapped(path))
        finally:
            path.unlink(missing_ok=True)

    def copy(self, source: str, key: str) -> BlobStat:
        """Store what lies under one key under a new one as well; raises as `create` does, `BlobNotFoundError`.

        Through this host: the server's own copy carries no attributes, so that a lost answer could not be told from
        another's blob.
        """
        self._spare(key)
        with self.open(source) as file:
            return self.create(key, iter(partial(file.read, WINDOW), b""))

    def adopt(self, key: str, path: Path) -> BlobStat:
        """Move a finished file of `scratch` in under a new key; raises as `create` does."""
        self._spare(key)
        stat = self._put(key, _mapped(path))
        path.unlink()
        return stat

    def scratch(self) -> Path:
        """Return the folder for unfinished files, on this host; swept when they are old."""
        return self._scratch

    def open(self, key: str) -> BinaryIO:
        """Open for reading, seekable, a few megabytes at a time; raises `BlobNotFoundError`."""
        found = self._head(key)
        return io.BufferedReader(_Reader(self._client, key, found.meta["size"], found.meta["e_tag"]), _FIRST)

    def read(self, key: str) -> bytes:
        """Return the whole blob; raises `BlobNotFoundError`, `DamagedBlobError`."""
        check_key(key)

        def fetch() -> tuple[bytes | None, obstore.GetResult]:
            found = obstore.get(self._client.store, key)
            return bytes(found.bytes()) if found.meta["size"] <= WINDOW else None, found

        content, found = self._client.ask(fetch, key)
        if content is None:  # too much for one request
            with io.BufferedReader(
                _Reader(self._client, key, found.meta["size"], found.meta["e_tag"])
            ) as file:
                content = file.read()
        told = found.attributes.get(_SHA256)
        if told is not None and told != hashlib.sha256(content).hexdigest():
            raise DamagedBlobError(f"{key} is not what was written: its sha-256 is another")
        return content

    def stat(self, key: str) -> BlobStat | None:
        """Return what is known of a key, None if nothing is stored there."""
        try:
            return _stat(self._head(key).meta)
        except BlobNotFoundError:
            return None

    def list(self, prefix: str) -> Iterator[BlobStat]:
        """Yield every blob below a folder-like prefix, sorted by key."""
        folder = prefix.rstrip("/")
        if folder:
            check_key(folder)
        pages = self._client.ask(lambda: list(obstore.list(self._client.store, folder or None)), folder)
        stats = [_stat(meta) for page in pages for meta in page]
        yield from sorted((stat for stat in stats if KEY.fullmatch(stat.key)), key=lambda stat: stat.key)

    def delete(self, key: str) -> bool:
        """Remove one blob; whether it was there."""
        if self.stat(key) is None:
            return False
        self._client.ask(lambda: obstore.delete(self._client.store, key), key)
        return True

    def folders(self, prefix: str) -> Iterator[str]:
        """Yield the names of what looks like folders directly below a prefix, sorted."""
        folder = prefix.rstrip("/")
        check_key(folder)
        found = self._client.ask(lambda: obstore.list_with_delimiter(self._client.store, folder), folder)
        yield from sorted(name.rstrip("/").rpartition("/")[2] for name in found["common_prefixes"])

    def ping(self) -> None:
        """Raise `StoreUnavailableError` unless the server answers, soon, and has the bucket."""
        self._client.ping()

    def _put(self, key: str, content: memoryview) -> BlobStat:
        check_key(key)
        attributes = {_SHA256: hashlib.sha256(content).hexdigest(), _WRITER: uuid.uuid4().hex}
        store, patience_s = self._client.store, self._client.patience_s
        if len(content) > WINDOW:
            request_s = self._client.request_s + len(content) / SLOWEST
            store, patience_s = self._client.connected(request_s), patience_s + request_s

        def write() -> BlobStat:
            made = True
            try:
                obstore.put(store, key, content, mode="create", use_multipart=False, attributes=attributes)
            except AlreadyExistsError:
                made = False  # or by a request of ours whose answer was lost
            try:
                found = obstore.get(self._client.store, key, options={"head": True})
            except FileNotFoundError:
                if not made:
                    raise StoreUnavailableError(f"{key} was deleted at the same moment") from None
                return BlobStat(key, len(content), float(int(time.time())))
            if found.attributes.get(_WRITER) != attributes[_WRITER]:
                raise BlobExistsError(f"{key} is written already")
            if found.meta["size"] != len(content):  # a server that does not compare the checksum it was told
                obstore.delete(self._client.store, key)
                raise StoreUnavailableError(f"{key} was not stored whole")
            return _stat(found.meta)

        return self._client.ask(write, key, patience_s=patience_s)

    def _spare(self, key: str) -> None:
        """Raise `BlobExistsError` before a transfer that would be for nothing; the write itself decides."""
        if self.stat(key) is not None:
            raise BlobExistsError(f"{key} is written already")

    def _head(self, key: str) -> obstore.GetResult:
        check_key(key)
        return self._client.head(key)


class _Reader(io.RawIOBase):
    """A blob as a file; what is read on and on is fetched in ever larger pieces, up to `WINDOW`."""

    def __init__(self, client: S3Client, key: str, size: int, etag: str | None) -> None:
        self._client, self._key, self._size, self._etag = client, key, size, etag
        self._place = 0
        self._start = 0
        self._window = b""
        self._ahead = _FIRST // 2

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        base = {os.SEEK_SET: 0, os.SEEK_CUR: self._place, os.SEEK_END: self._size}[whence]
        self._place = max(base + offset, 0)
        return self._place

    def tell(self) -> int:
        return self._place

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override] # any writable buffer has these methods
        if self._place >= self._size:
            return 0
        end = self._start + len(self._window)
        if not self._start <= self._place < end:
            self._ahead = min(2 * self._ahead, WINDOW) if self._place == end else _FIRST
            till = min(self._place + self._ahead, self._size)
            self._window = self._client.read_range(self._key, self._place, till, self._etag)
            self._start = self._place
        piece = self._window[self._place - self._start :][: len(buffer)]
        buffer[: len(piece)] = piece
        self._place += len(piece)
        return len(piece)


def _mapped(path: Path) -> memoryview:
    """Return a file's content; it is read as it is sent, and needs no memory of ours."""
    with path.open("rb") as file:
        if os.fstat(file.fileno()).st_size == 0:
            return memoryview(b"")
        return memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))


def _stat(meta: obstore.ObjectMeta) -> BlobStat:
    """Return it with the time in whole seconds: listings tell it finer than answers about one blob do."""
    return BlobStat(meta["path"], meta["size"], float(int(meta["last_modified"].timestamp())))
