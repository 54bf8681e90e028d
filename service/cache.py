"""Files made from what is stored: built once, handed out many times, thrown away when there are too many.

A file is named by what determines its bytes, and ends with the SHA-256 of the rest, which is its entity tag. It is
built under another name, flushed and renamed, so that of any number of processes on one folder each finds a whole
file or none. Everything here can be made again: the folder may be emptied at any time.
"""

from __future__ import annotations

import asyncio
import hashlib
import io
import os
import shutil
import time
import uuid
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Final, Self

from anyio import CapacityLimiter, to_thread

from spherify.jobs.errors import DamagedBlobError
from spherify.stores.blobs import FULL

MOST_FILES: Final = 20_000
_DIGEST: Final = 32
_BLOCK: Final = 4096  # what the smallest file takes
_SHARE: Final = 16  # the folder is looked through each time it may have grown by this part of its bound
_PART: Final = ".part"
_ABANDONED_S: Final = 24 * 3600.0  # a file that has been in the making for longer than that is nobody's

Build = Callable[[BinaryIO], object]


class CachedFile:
    """A finished file, opened: its entity tag, its size, and its bytes once, for whoever takes them."""

    def __init__(self, file: BinaryIO, size: int, digest: bytes, path: Path | None) -> None:
        self.size = size
        self.etag = f'"{digest.hex()[:32]}"'
        self._digest = digest
        self._path = path
        self._file: BinaryIO | None = file

    def take(self) -> BinaryIO:
        """Return the open file, which the caller closes; its last bytes, beyond ``size``, are not content."""
        assert self._file is not None  # once  # noqa: S101
        file, self._file = self._file, None
        return file

    def verify(self, digest: bytes) -> None:
        """Raise `DamagedBlobError`, and have it made anew for the next, unless this is the SHA-256 of its content."""
        if digest != self._digest:
            if self._path is not None:
                self._path.unlink(missing_ok=True)
            raise DamagedBlobError("a file of the cache is damaged: it is made anew")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._file is not None:
            self._file.close()


class FileCache:
    """A bounded folder of finished files, shared by the processes of the service.

    Args:
        folder: made when it is missing.
        max_bytes: what it holds at most, exceeded by a sixteenth until it is noticed.
        min_free_bytes: of the disk, which stay free for others.

    Attributes:
        folder: where they lie, on a disk that may be another than that of the blobs.

    """

    def __init__(self, folder: Path, max_bytes: int, min_free_bytes: int) -> None:
        self.folder = folder
        self._max_bytes = max_bytes
        self._min_free_bytes = min_free_bytes
        self._added: float = float("inf")  # since the folder was looked through
        self._building: dict[str, asyncio.Lock] = {}

    async def get(
        self, parts: object, build: Build, limiter: CapacityLimiter, *, small: bool = True
    ) -> CachedFile:
        """Return the file made of these parts; of several who ask at once one builds it.

        Args:
            parts: what determines the bytes; their `repr` tells them apart.
            build: writes the file, in a thread.
            limiter: how many are built at once.
            small: whether it may be held in memory, once, when the disk is full.

        Raises:
            OSError: the disk is full, and the file is not small; or what `build` raises.

        """
        key = _key(parts)
        found = await to_thread.run_sync(self._open, key)
        if found is not None:
            return found
        lock = self._building.setdefault(key, asyncio.Lock())
        try:
            async with lock:
                return await to_thread.run_sync(self._open_or_build, key, build, small, limiter=limiter)
        finally:
            if not lock.locked():
                self._building.pop(key, None)

    def read(self, parts: object, make: Callable[[], bytes]) -> bytes:
        """Return the content of the file made of these parts; of several who ask at once in threads each makes it."""
        with (
            self._open_or_build(_key(parts), lambda file: file.write(make()), True) as found,
            found.take() as file,
        ):
            file.seek(0)
            content = file.read(found.size)
            try:
                found.verify(hashlib.sha256(content).digest())
            except DamagedBlobError:
                return make()
            return content

    def _open(self, key: str) -> CachedFile | None:
        try:
            file = (self.folder / key).open("rb")
        except FileNotFoundError:
            return None
        size = os.fstat(file.fileno()).st_size - _DIGEST
        if size < 0:  # cut off by the disk, or by somebody
            file.close()
            return None
        file.seek(size)
        digest = file.read()
        with suppress(FileNotFoundError):  # thrown away just now: the open file stays
            os.utime(self.folder / key)  # used last, thrown away last
        return CachedFile(file, size, digest, self.folder / key)

    def _open_or_build(self, key: str, build: Build, small: bool) -> CachedFile:
        found = self._open(key)
        if found is not None:
            return found
        self.folder.mkdir(parents=True, exist_ok=True)
        part = self.folder / f"{uuid.uuid4().hex}{_PART}"
        try:
            return self._built(key, build, part)
        except OSError as e:
            if e.errno not in FULL:
                raise
            part.unlink(missing_ok=True)
            self._throw_away(0)
            return _in_memory(build) if small else self._built(key, build, part)
        finally:
            part.unlink(missing_ok=True)

    def _built(self, key: str, build: Build, part: Path) -> CachedFile:
        file = part.open("xb+")
        try:
            build(file)
            file.flush()
            file.seek(0)
            digest = hashlib.file_digest(file, "sha256").digest()
            size = file.tell()
            file.write(digest)
            file.flush()
            os.fsync(file.fileno())  # a name on the disk must not outlive its bytes
        except BaseException:
            file.close()
            raise
        part.rename(self.folder / key)
        self._added += max(size, _BLOCK)
        if self._added > self._max_bytes / _SHARE or self._free() < self._min_free_bytes:
            self._throw_away(min(self._max_bytes, self._used() + self._free() - self._min_free_bytes))
        return CachedFile(file, size, digest, self.folder / key)

    def _free(self) -> int:
        return shutil.disk_usage(self.folder).free

    def _used(self) -> int:
        return sum(size for _, size, _ in self._files())

    def _files(self) -> list[tuple[float, int, str]]:
        """Return time of the last use, size and path of every file."""
        found = []
        with os.scandir(self.folder) as entries:
            for entry in entries:
                with suppress(FileNotFoundError):  # thrown away by another process
                    stat = entry.stat()
                    found.append((stat.st_mtime, max(stat.st_size, _BLOCK), entry.path))
        return found

    def _throw_away(self, bound: int) -> None:
        """Remove what was not used for longest until the rest fits within a bound."""
        kept, old = 0, time.time() - _ABANDONED_S
        for number, (used_at, size, path) in enumerate(sorted(self._files(), reverse=True)):
            kept += size
            if used_at < old if path.endswith(_PART) else kept > bound or number >= MOST_FILES:
                Path(path).unlink(missing_ok=True)
        self._added = 0


def _key(parts: object) -> str:
    return hashlib.sha256(repr(parts).encode()).hexdigest()


def _in_memory(build: Build) -> CachedFile:
    file = io.BytesIO()
    build(file)
    return CachedFile(file, file.tell(), hashlib.sha256(file.getvalue()).digest(), None)
