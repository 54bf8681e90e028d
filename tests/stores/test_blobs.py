from __future__ import annotations

import errno
import os
import random
import resource
import threading
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from spherify.jobs.errors import (
    BlobExistsError,
    BlobNotFoundError,
    JobsError,
    StorageFullError,
    StoreUnavailableError,
)
from spherify.jobs.ports import BlobStore
from spherify.stores.blobs import FolderBlobStore
from spherify.stores.files import open_blobs
from spherify.stores.memory_blobs import MemoryBlobStore


@pytest.fixture(params=["memory", "folder", pytest.param("s3", marks=pytest.mark.s3)])
def blobs(request: pytest.FixtureRequest, tmp_path: Path) -> BlobStore:
    if request.param == "s3":
        return open_blobs(request.getfixturevalue("s3_url"), tmp_path)
    return MemoryBlobStore(tmp_path) if request.param == "memory" else open_blobs("folder", tmp_path)


def test_a_blob_is_read_as_it_was_written(blobs: BlobStore) -> None:
    stat = blobs.create("jobs/a/spec.json", [b"one ", b"two"])
    assert (stat.key, stat.size) == ("jobs/a/spec.json", 7)
    assert blobs.read("jobs/a/spec.json") == b"one two"
    assert blobs.stat("jobs/a/spec.json") == stat
    with blobs.open("jobs/a/spec.json") as file:
        file.seek(4)
        assert file.read() == b"two"


def test_a_key_is_written_once(blobs: BlobStore) -> None:
    blobs.create("a/b", b"first")
    with pytest.raises(BlobExistsError):
        blobs.create("a/b", b"second")
    assert blobs.read("a/b") == b"first"


def test_of_many_writers_one_wins(blobs: BlobStore) -> None:
    begin = threading.Barrier(16)
    won: list[int] = []

    def write(number: int) -> None:
        begin.wait()
        try:
            blobs.create("race/one", [str(number).encode()] * 1000)
        except BlobExistsError:
            return
        won.append(number)

    threads = [threading.Thread(target=write, args=(number,)) for number in range(16)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(won) == 1
    assert blobs.read("race/one") == str(won[0]).encode() * 1000


@pytest.mark.parametrize(
    "key",
    [
        "",
        "/etc/passwd",
        "../a",
        "a/../b",
        "a//b",
        "a/",
        ".scratch/x",
        "a/.b",
        "a\\b",
        "a\0b",
        "a\n",
        "é",
        129 * "a",
    ],
)
def test_a_key_cannot_leave_the_store(blobs: BlobStore, key: str) -> None:
    for use in (lambda: blobs.create(key, b""), lambda: blobs.open(key), lambda: blobs.stat(key)):
        with pytest.raises(ValueError, match="no blob key"):
            use()


def test_what_is_not_there(blobs: BlobStore) -> None:
    blobs.create("a/b/c", b"")
    for key in ("a/x", "a/b", "a/b/c/d"):
        assert blobs.stat(key) is None
        with pytest.raises(BlobNotFoundError):
            blobs.read(key)
        assert blobs.delete(key) is False
    assert list(blobs.list("nothing/")) == []


def test_listing_is_sorted_and_by_folder(blobs: BlobStore) -> None:
    for key in ("jobs/b/2", "jobs/b/10", "jobs/a/1", "jobs/bb/1", "x"):
        blobs.create(key, key.encode())
    assert [stat.key for stat in blobs.list("jobs/b/")] == ["jobs/b/10", "jobs/b/2"]
    assert [stat.key for stat in blobs.list("")] == ["jobs/a/1", "jobs/b/10", "jobs/b/2", "jobs/bb/1", "x"]


def test_folders_are_named_in_order(blobs: BlobStore) -> None:
    for key in ("jobs/b/2", "jobs/b/x/3", "jobs/a/1", "jobs/file", "meshes/c/1"):
        blobs.create(key, b"")
    assert list(blobs.folders("jobs/")) == ["a", "b"]
    assert list(blobs.folders("nothing/")) == []


def test_a_large_blob_is_read_in_parts_and_as_a_whole(blobs: BlobStore) -> None:
    content = random.Random(1).randbytes(9_000_001)
    path = blobs.scratch() / "upload"
    path.write_bytes(content)
    blobs.adopt("meshes/a/original.ply", path)
    assert blobs.read("meshes/a/original.ply") == content
    with blobs.open("meshes/a/original.ply") as file:
        pieces = iter(partial(file.read, 262_144), b"")
        assert b"".join(pieces) == content
        for start, size in ((8_999_000, 5000), (5, 10), (4_194_300, 10), (9_000_001, 1), (9_500_000, 1)):
            file.seek(start)
            assert file.read(size) == content[start : start + size]


def test_it_says_that_it_is_there(blobs: BlobStore) -> None:
    blobs.ping()


def test_a_deleted_key_may_be_written_again(blobs: BlobStore) -> None:
    blobs.create("a/b", b"1")
    assert blobs.delete("a/b") is True
    assert blobs.stat("a/b") is None
    blobs.create("a/b", b"2")
    assert blobs.read("a/b") == b"2"


def test_a_finished_scratch_file_is_adopted(blobs: BlobStore) -> None:
    path = blobs.scratch() / "upload"
    path.write_bytes(b"content")
    assert blobs.adopt("meshes/a", path).size == 7
    assert not path.exists()
    path.write_bytes(b"other")
    with pytest.raises(BlobExistsError):
        blobs.adopt("meshes/a", path)
    assert blobs.read("meshes/a") == b"content"


def test_a_writer_that_fails_leaves_nothing(blobs: BlobStore) -> None:
    def chunks() -> Iterator[bytes]:
        yield b"half"
        raise ConnectionResetError

    with pytest.raises(ConnectionResetError):
        blobs.create("a/b", chunks())
    assert blobs.stat("a/b") is None
    assert list(blobs.scratch().iterdir()) == []


def test_a_full_disk_is_named_and_leaves_nothing(tmp_path: Path) -> None:
    blobs = FolderBlobStore(tmp_path)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, before[1]))  # the kernel refuses to write beyond
    try:
        with pytest.raises(StorageFullError, match="no space left"):
            blobs.create("a/b", [b"x" * 4096, b"y" * 4096])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert blobs.stat("a/b") is None
    assert list(blobs.scratch().iterdir()) == []


def test_a_disk_that_takes_no_writes_is_away(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError(errno.EROFS, "Read-only file system")

    blobs = FolderBlobStore(tmp_path)
    monkeypatch.setattr(os, "link", refuse)
    with pytest.raises(StoreUnavailableError, match="takes no writes"):
        blobs.create("a/b", b"content")
    assert list(blobs.scratch().iterdir()) == []


def test_a_folder_that_cannot_be_read_is_not_empty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError(errno.EMFILE, "Too many open files")

    blobs = FolderBlobStore(tmp_path)
    blobs.create("a/b", b"content")
    monkeypatch.setattr(os, "scandir", refuse)
    with pytest.raises(OSError, match="Too many"):
        list(blobs.list("a"))


def test_deleting_and_creating_beside_each_other_do_not_disturb(tmp_path: Path) -> None:
    blobs = FolderBlobStore(tmp_path)
    failures: list[Exception] = []

    def churn(name: str) -> None:
        try:
            for _ in range(100):
                blobs.create(f"jobs/one/{name}", b"")
                blobs.delete(f"jobs/one/{name}")
        except (OSError, JobsError) as e:  # carried to the assertion below
            failures.append(e)

    threads = [threading.Thread(target=churn, args=(name,)) for name in "abc"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failures == []


def test_the_folder_shows_no_half_written_names(tmp_path: Path) -> None:
    blobs = FolderBlobStore(tmp_path)

    def chunks() -> Iterator[bytes]:
        yield b"half"
        assert blobs.stat("a/b") is None
        assert [name for _, _, names in os.walk(tmp_path / "a") for name in names] == []
        yield b"whole"

    blobs.create("a/b", chunks())
    assert blobs.read("a/b") == b"halfwhole"


@pytest.mark.parametrize("deleted", ["a/one", "b/two"])
def test_a_copy_may_lose_either_of_its_names_at_the_same_moment(tmp_path: Path, deleted: str) -> None:
    class Raced(FolderBlobStore):
        """Somebody deletes one of the two as soon as there are two."""

        def _link(self, path: Path, target: Path, key: str) -> None:
            super()._link(path, target, key)
            self.delete(deleted)

    blobs = FolderBlobStore(tmp_path)
    blobs.create("a/one", b"content")
    copied = Raced(tmp_path).copy("a/one", "b/two")
    (left,) = blobs.list("")
    assert left.key != deleted
    assert blobs.read(left.key) == b"content"
    assert copied == replace(left, key="b/two")


def test_a_copy_is_a_blob_of_its_own(blobs: BlobStore) -> None:
    blobs.create("a/one", b"content")
    assert blobs.copy("a/one", "b/two").size == 7
    with pytest.raises(BlobExistsError):
        blobs.copy("a/one", "b/two")
    with pytest.raises(BlobNotFoundError):
        blobs.copy("a/none", "b/three")
    blobs.delete("a/one")
    assert blobs.read("b/two") == b"content"
    assert [stat.key for stat in blobs.list("")] == ["b/two"]
