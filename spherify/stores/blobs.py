"""Blobs in a folder: written once, whole and durable, or not at all.

A blob is written to a temporary name on the same file system, flushed to the disk, and then linked to its own
name, which fails when that is taken: of any number of writers one wins, and no reader ever sees half a file.
The folder must be on a file system with hard links (ext4, XFS, APFS, NFS: yes; FAT: no).
"""

from __future__ import annotations

import errno
import os
import re
import uuid
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from stat import S_ISREG
from typing import BinaryIO, Final

from spherify.jobs.errors import BlobExistsError, BlobNotFoundError, StorageFullError, StoreUnavailableError
from spherify.jobs.ports import BlobStat

KEY: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,127}(/[A-Za-z0-9_][A-Za-z0-9._-]{0,127}){0,7}")
_SCRATCH: Final = ".scratch"  # no key begins with a dot
FULL: Final = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})  # no space, as the system says it
_RACES: Final = 50  # a delete may remove the folder between our mkdir and our link


class FolderBlobStore:
    """A `spherify.jobs.ports.BlobStore` below one folder, which is made when it is missing."""

    def __init__(self, root: Path) -> None:
        self.root = root
        (root / _SCRATCH).mkdir(parents=True, exist_ok=True)

    def create(self, key: str, chunks: bytes | Iterable[bytes]) -> BlobStat:
        """Store under a new key; raises `BlobExistsError`, `StorageFullError`. Durable on return."""
        target = self._path(key)
        if target.exists():  # spares the writing; the link below decides
            raise BlobExistsError(f"{key} is written already")
        temporary = self.scratch() / f"{uuid.uuid4().hex}.part"
        try:
            with naming_full(key), temporary.open("xb") as file:
                for chunk in (chunks,) if isinstance(chunks, bytes) else chunks:
                    file.write(chunk)
            return self.adopt(key, temporary)
        finally:
            temporary.unlink(missing_ok=True)

    def copy(self, source: str, key: str) -> BlobStat:
        """Store what lies under one key under a new one as well, by a second link: blobs never change."""
        path, target = self._path(source), self._path(key)
        with naming_full(key):
            try:
                stat = _stat(
                    key, path
                )  # before the link: either of them may be deleted as soon as there are two
                self._link(path, target, key)
            except FileNotFoundError as e:
                raise BlobNotFoundError(f"there is no blob {source}") from e
            with suppress(FileNotFoundError):  # deleted already, and the folder with it
                _sync(target.parent)
        return stat

    def adopt(self, key: str, path: Path) -> BlobStat:
        """Move a finished file of `scratch` in under a new key; raises as `create` does."""
        target = self._path(key)
        with naming_full(key):
            _sync(path)
            self._link(path, target, key)
            with suppress(FileNotFoundError):  # deleted already, and the folder with it
                _sync(target.parent)
        stat = _stat(key, path)
        path.unlink()
        return stat

    def scratch(self) -> Path:
        """Return the folder for unfinished files, on the same file system; swept when they are old."""
        folder = self.root / _SCRATCH
        if not folder.is_dir():
            raise StoreUnavailableError("the data folder is not there: its disk may not be mounted")
        return folder

    def open(self, key: str) -> BinaryIO:
        """Open for reading, seekable; raises `BlobNotFoundError`."""
        try:
            return self._path(key).open("rb")
        except (FileNotFoundError, IsADirectoryError, NotADirectoryError) as e:
            self.scratch()  # where the disk is not mounted, nothing is there and nothing is gone
            raise BlobNotFoundError(f"there is no blob {key}") from e

    def read(self, key: str) -> bytes:
        """Return the whole blob; raises `BlobNotFoundError`."""
        with self.open(key) as file:
            return file.read()

    def stat(self, key: str) -> BlobStat | None:
        """Return what is known of a key, None if nothing is stored there."""
        path = self._path(key)
        try:
            found = path.stat()
        except (FileNotFoundError, NotADirectoryError):
            return None
        return BlobStat(key, found.st_size, found.st_mtime) if S_ISREG(found.st_mode) else None

    def list(self, prefix: str) -> Iterator[BlobStat]:
        """Yield every blob below a folder-like prefix, sorted by key."""
        folder = self._path(prefix.rstrip("/")) if prefix.rstrip("/") else self.root
        found = (
            Path(parent, name).relative_to(self.root)
            for parent, folders, names in os.walk(folder, onerror=_raise_unless_missing)
            if _visible(folders)
            for name in names
        )
        for key in sorted(filter(KEY.fullmatch, map(Path.as_posix, found))):  # and no .nfs…, no .DS_Store
            if (stat := self.stat(key)) is not None:
                yield stat

    def delete(self, key: str) -> bool:
        """Remove one blob; whether it was there."""
        path = self._path(key)
        try:
            path.unlink()
        except (FileNotFoundError, IsADirectoryError, NotADirectoryError):
            self.scratch()  # as above
            return False
        for folder in path.parents:
            if folder == self.root:
                break
            with suppress(OSError):  # not empty: it stays
                folder.rmdir()
        return True

    def folders(self, prefix: str) -> Iterator[str]:
        """Yield the names of the folders directly below a prefix, sorted."""
        folder = self._path(prefix.rstrip("/"))
        try:
            with os.scandir(folder) as entries:
                names = [entry.name for entry in entries if entry.is_dir()]
        except FileNotFoundError:
            self.scratch()  # as above
            return
        yield from sorted(names)

    def ping(self) -> None:
        """Raise `StoreUnavailableError` unless the folder is there and can be written to."""
        if not os.access(self.scratch(), os.W_OK | os.X_OK):
            raise StoreUnavailableError("the data folder cannot be written to")

    def _path(self, key: str) -> Path:
        check_key(key)
        return self.root / key

    def _link(self, path: Path, target: Path, key: str) -> None:
        for attempt in range(_RACES):
            try:
                _make(target.parent, self.root)
                os.link(path, target)
            except FileExistsError as e:
                raise BlobExistsError(f"{key} is written already") from e
            except FileNotFoundError:
                if attempt == _RACES - 1 or not path.exists():
                    raise
            else:
                return


def check_key(key: str) -> None:
    """Raise `ValueError` unless this may be the name of a blob."""
    if not KEY.fullmatch(key):
        raise ValueError(f"{key!r} is no blob key")


@contextmanager
def naming_full(key: str) -> Iterator[None]:
    """Turn what the system raises when there is no space into `StorageFullError`.

    And, when a disk takes no writes at all, mounted read-only after an error, into `StoreUnavailableError`.
    """
    try:
        yield
    except OSError as e:
        if e.errno in FULL:
            raise StorageFullError(f"there is no space left to store {key}") from e
        if e.errno == errno.EROFS:
            raise StoreUnavailableError(f"the disk takes no writes, {key} neither") from e
        raise


def _make(folder: Path, root: Path) -> None:
    """Make a folder and those above it durable: a new name lives in the folder above."""
    if folder == root or folder.is_dir():
        return
    _make(folder.parent, root)
    # Made by another: fine. Not exist_ok, which raises when a third removes it again in between.
    with suppress(FileExistsError):
        folder.mkdir()
    _sync(folder.parent)


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _stat(key: str, path: Path) -> BlobStat:
    stat = path.stat()
    return BlobStat(key, stat.st_size, stat.st_mtime)


def _raise_unless_missing(error: OSError) -> None:
    """Raise what kept a folder from being read, which is not to be taken for an empty one."""
    if not isinstance(error, FileNotFoundError | NotADirectoryError):
        raise error


def _visible(folders: list[str]) -> bool:
    """Keep `os.walk` out of the scratch folder, in place as it wants it; always true."""
    folders[:] = [name for name in folders if not name.startswith(".")]
    return True
