from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

import anyio
import pytest
from anyio import CapacityLimiter

from service.cache import MOST_FILES, FileCache

MIB = 1024 * 1024


def content(cache: FileCache, name: str, build: Callable[[BinaryIO], None], **more: bool) -> bytes:
    async def get() -> bytes:
        with await cache.get(name, build, CapacityLimiter(4), **more) as found, found.take() as file:
            file.seek(0)
            return file.read(found.size)

    return anyio.run(get)


def writes(data: bytes, calls: list[bytes] | None = None) -> Callable[[BinaryIO], None]:
    def build(file: BinaryIO) -> None:
        if calls is not None:
            calls.append(data)
        file.write(data)

    return build


def never(file: BinaryIO) -> None:
    raise AssertionError("it is there already")


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_file_is_built_once_and_found_by_other_processes(tmp_path: Path) -> None:
    assert content(FileCache(tmp_path, MIB, 0), "a", writes(b"alpha")) == b"alpha"
    assert content(FileCache(tmp_path, MIB, 0), "a", never) == b"alpha"
    assert content(FileCache(tmp_path, MIB, 0), "b", writes(b"")) == b""


def test_what_a_disk_has_damaged_is_made_anew(tmp_path: Path) -> None:
    """Whoever reads it finds out, and the next does not meet it."""
    cache = FileCache(tmp_path, MIB, 0)
    content(cache, "a", writes(b"alpha"))
    (path,) = tmp_path.iterdir()
    whole = path.read_bytes()
    for damaged in (b"A" + whole[1:], whole[:20], b""):
        path.write_bytes(damaged)
        assert cache.read("a", lambda: b"alpha") == b"alpha"
        assert cache.read("a", lambda: b"alpha") == b"alpha"
        assert path.read_bytes() == whole


def test_of_several_who_ask_at_once_one_builds(tmp_path: Path) -> None:
    cache, calls = FileCache(tmp_path, MIB, 0), list[bytes]()
    etags = set()

    async def ask() -> None:
        with await cache.get("a", writes(b"x" * 1000, calls), CapacityLimiter(4)) as found:
            etags.add(found.etag)

    async def all_of_them() -> None:
        async with anyio.create_task_group() as tasks:
            for _ in range(20):
                tasks.start_soon(ask)

    anyio.run(all_of_them)
    assert len(calls) == 1
    assert len(etags) == 1


def test_what_was_not_used_for_longest_goes_first(tmp_path: Path) -> None:
    cache = FileCache(tmp_path, 10 * 4096, 0)
    for number in range(10):
        content(cache, str(number), writes(b"x"))
        os.utime(tmp_path / max(names(tmp_path), key=lambda n: (tmp_path / n).stat().st_mtime), (1, number))
    content(cache, "0", never)  # used again
    content(cache, "more", writes(b"y"))
    content(cache, "0", never)
    content(cache, "more", never)
    calls: list[bytes] = []
    content(cache, "1", writes(b"x", calls))
    assert calls, "thrown away"
    assert sum(max(path.stat().st_size, 4096) for path in tmp_path.iterdir()) <= 10 * 4096
    assert MOST_FILES > 1000


def test_a_file_that_is_too_large_is_handed_out_and_not_kept(tmp_path: Path) -> None:
    cache = FileCache(tmp_path, 4096, 0)
    assert content(cache, "a", writes(b"x" * 9000)) == b"x" * 9000
    assert names(tmp_path) == []


def test_a_reserve_of_the_disk_stays_free(tmp_path: Path) -> None:
    cache = FileCache(tmp_path, MIB, shutil.disk_usage(tmp_path).total)
    assert content(cache, "a", writes(b"alpha")) == b"alpha"
    assert names(tmp_path) == []


def test_on_a_full_disk_small_files_are_made_in_memory(tmp_path: Path) -> None:
    def build(file: BinaryIO) -> None:
        if hasattr(file, "fileno") and not hasattr(file, "getvalue"):
            raise OSError(errno.ENOSPC, "full")
        file.write(b"alpha")

    cache = FileCache(tmp_path, MIB, 0)
    assert content(cache, "a", build) == b"alpha"
    with pytest.raises(OSError, match="full"):
        content(cache, "b", build, small=False)
    assert names(tmp_path) == []


def test_a_failure_leaves_nothing_and_an_abandoned_file_is_swept(tmp_path: Path) -> None:
    def build(file: BinaryIO) -> None:
        file.write(b"half")
        raise ValueError("wrong")

    cache = FileCache(tmp_path, MIB, 0)
    with pytest.raises(ValueError, match="wrong"):
        content(cache, "a", build)
    assert names(tmp_path) == []
    for name, age in (("old.part", 1), ("new.part", None)):
        (tmp_path / name).write_bytes(b"half")
        if age is not None:
            os.utime(tmp_path / name, (age, age))
    content(cache, "a", writes(b"alpha"))
    assert "new.part" in names(tmp_path)
    assert "old.part" not in names(tmp_path)
    assert content(cache, "a", never) == b"alpha"
