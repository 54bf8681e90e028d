"""Request bodies: streamed, counted and timed, never held in memory whole.

A file goes to a scratch file of the blob store while it is hashed. Whatever ends the request (an answer, an
error, the client hanging up), the scratch file goes too, unless the blob store has adopted it.
"""

from __future__ import annotations

import asyncio
import base64
import binascii
import hashlib
import re
import shutil
import time
import uuid
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from anyio import to_thread
from fastapi import Depends, Header
from starlette.requests import Request

from service.problems import ProblemError, problem_of

if TYPE_CHECKING:
    from typing import BinaryIO

    from spherify.jobs.ports import BlobStore
    from spherify.settings import Settings

KIB: Final = 1024
FLUSH_BYTES: Final = KIB * KIB  # what is held before it is hashed and written, in a thread
_DIGEST: Final = re.compile(r"(?:^|,)\s*sha-256=:([^:]*):")
MIN_BYTES_PER_S: Final = KIB  # a body slower than this on average is dropped, however busy it looks


@dataclass(frozen=True, slots=True)
class Upload:
    """A whole file that has arrived: where it lies, its size in bytes, its sha256, and the name it came with."""

    path: Path
    name: str
    size: int
    sha256: str


class Scratch:
    """A file being received."""

    def __init__(self, folder: Path, min_free_bytes: int) -> None:
        self.path = folder / f"{uuid.uuid4().hex}.upload"
        self.size = 0
        self._folder = folder
        self._min_free_bytes = min_free_bytes
        self._digest = hashlib.sha256()
        self._held = bytearray()
        self._file: BinaryIO | None = None

    def feed(self, data: bytes | memoryview) -> None:
        """Take a piece; `flush_if_full` must follow before many more."""
        self._held += data
        self.size += len(data)

    async def flush_if_full(self) -> None:
        """Hash and write what is held once it is worth a thread."""
        if len(self._held) >= FLUSH_BYTES:
            await to_thread.run_sync(self._flush)

    async def finish(self, name: str) -> Upload:
        """Write the rest and return the file."""
        await to_thread.run_sync(self._flush)
        self._close()
        return Upload(self.path, name, self.size, self._digest.hexdigest())

    def discard(self) -> None:
        """Remove the file if nobody took it."""
        self._close()
        self.path.unlink(missing_ok=True)

    def _flush(self) -> None:
        if self._file is None:
            self._file = self.path.open("xb")
        check_space(self._folder, len(self._held), self._min_free_bytes)
        self._digest.update(self._held)
        self._file.write(self._held)
        self._held.clear()

    def _close(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None


def check_space(folder: Path, needed: int, min_free_bytes: int) -> None:
    """Raise `storage-full` unless so many bytes fit and the reserve stays."""
    free = shutil.disk_usage(folder).free
    if free < needed + min_free_bytes:
        what = f"{needed:,} bytes do not fit: " if needed else ""
        raise ProblemError(
            "storage-full",
            f"{what}{free:,} bytes are free in the data folder, of which {min_free_bytes:,} are kept in reserve: "
            "make room there, as by deleting jobs that are no longer needed",
        )


def check_length(request: Request, limit: int) -> int | None:
    """Return the announced length; raises `upload-too-large` before anything is read."""
    announced = request.headers.get("content-length")
    length = int(announced) if announced is not None and announced.isdecimal() else None
    if length is not None and length > limit:
        raise _too_large(limit, f"the body has {length} bytes")
    return length


async def body(request: Request, limit: int, idle_s: float) -> AsyncIterator[bytes]:
    """Yield the body piece by piece, cut off where it grows too large or too slow.

    Raises:
        ProblemError: unsupported-media-type (it is compressed), upload-too-large, request-timeout, digest-mismatch.
        starlette.requests.ClientDisconnect: the client hung up.

    """
    _check_coding(request)
    check_length(request, limit)
    announced = _announced_digest(request)
    digest = hashlib.sha256()
    began = time.monotonic()
    received = 0
    pieces = request.stream()
    while True:
        try:
            allowed_s = min(idle_s, idle_s + received / MIN_BYTES_PER_S - (time.monotonic() - began))
            async with asyncio.timeout(allowed_s):
                piece = await anext(pieces, None)
        except TimeoutError:
            raise ProblemError(
                "request-timeout",
                f"the body stalled after {received} bytes: nothing for {idle_s:g} s, or less than "
                f"{MIN_BYTES_PER_S} bytes/s",
            ) from None
        if piece is None:
            if announced is not None and announced != digest.digest():
                raise ProblemError(
                    "digest-mismatch",
                    f"the {received} bytes that arrived have another sha-256 than Content-Digest says",
                )
            return
        received += len(piece)
        if received > limit:
            raise _too_large(limit, f"the body has more than {limit} bytes")
        if announced is not None:
            digest.update(piece)
        yield piece


async def small_body(request: Request, limit: int, idle_s: float) -> bytes:
    """Return a body that is small by its nature (JSON)."""
    return b"".join([piece async for piece in body(request, limit, idle_s)])


@asynccontextmanager
async def scratch(request: Request, blobs: BlobStore, settings: Settings) -> AsyncIterator[Scratch]:
    """Open a scratch file that is gone afterwards unless it was adopted."""
    length = check_length(request, settings.max_upload_bytes)
    check_space(blobs.scratch(), length or 0, settings.min_free_bytes)
    file = Scratch(blobs.scratch(), settings.min_free_bytes)
    try:
        yield file
    except OSError as e:
        if (problem := problem_of(e)) is not None:
            raise problem from e
        raise
    finally:
        file.discard()


@asynccontextmanager
async def raw_upload(
    request: Request, name: str, blobs: BlobStore, settings: Settings
) -> AsyncIterator[Upload]:
    """Receive a body that is the file itself."""
    async with scratch(request, blobs, settings) as file:
        async for piece in body(request, settings.max_upload_bytes, settings.upload_timeout_s):
            file.feed(piece)
            await file.flush_if_full()
        yield await file.finish(name)


async def _described(
    content_digest: Annotated[
        str | None,
        Header(
            description="`sha-256=:…:` (RFC 9530): what arrives with another one is refused, and leaves nothing."
        ),
    ] = None,
) -> None:
    """Describe the header; `body` compares."""


DIGEST: Final = Depends(_described)


def _announced_digest(request: Request) -> bytes | None:
    """Return the sha-256 that the client announces for the body (RFC 9530), None if it announces none."""
    found = _DIGEST.search(request.headers.get("content-digest", ""))
    try:
        return None if found is None else base64.b64decode(found[1], validate=True)
    except binascii.Error:
        return b""  # of nothing: what is announced and cannot be read is wrong


def _check_coding(request: Request) -> None:
    coding = request.headers.get("content-encoding", "").strip().lower()
    if coding not in {"", "identity"}:
        raise ProblemError(
            "unsupported-media-type",
            f"the body is in the coding {coding[:40]!r}, and none is undone here: send it as it is",
            headers={"Accept-Encoding": "identity"},  # RFC 9110, 15.5.16
        )


def _too_large(limit: int, what: str) -> ProblemError:
    return ProblemError("upload-too-large", f"{what}; at most {limit} are taken")
