"""What only a store behind a network can do wrong: lost answers, uploads cut off, servers that are away or refuse."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import obstore
import pytest
from obstore.store import S3Store

from spherify.jobs import layout
from spherify.jobs.errors import (
    BlobExistsError,
    BlobNotFoundError,
    DamagedBlobError,
    StorageFullError,
    StoreUnavailableError,
)
from spherify.jobs.rows import ROWS, rows_to_array
from spherify.stores import s3_blobs
from spherify.stores.arrays import checksum_of, dump_arrays
from spherify.stores.s3_blobs import S3BlobStore
from spherify.stores.s3_client import S3Client
from spherify.stores.states import find_trail
from tests.faults.http_chaos import Fault, HttpChaos, first, now_and_then
from tests.s3 import BUCKET, S3Server, environment_for

pytestmark = pytest.mark.s3


@pytest.fixture
def blobs(s3_url: str, tmp_path: Path) -> S3BlobStore:
    """Directly, as others see it."""
    return S3BlobStore(s3_url, tmp_path / "scratch", patience_s=10)


@pytest.fixture
def chaos(s3_server: S3Server, s3_url: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[HttpChaos]:
    """The way of all stores that are made from now on."""
    with HttpChaos(s3_server.port) as proxy:
        monkeypatch.setenv("AWS_ENDPOINT_URL", environment_for(proxy.port)["AWS_ENDPOINT_URL"])
        yield proxy


@pytest.fixture
def shaky(chaos: HttpChaos, s3_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> S3BlobStore:
    """The same place through the proxy."""
    monkeypatch.setattr(s3_blobs, "SLOWEST", 1 << 30)
    return S3BlobStore(s3_url, tmp_path / "shaky", patience_s=10, request_s=1.5)


@pytest.mark.parametrize("fault", [Fault.REFUSE, Fault.LOSE, Fault.RESET, Fault.CUT, Fault.HANG])
@pytest.mark.parametrize("size", [0, 1, 5, 5_000_000])
def test_a_write_whose_answer_is_lost_is_not_refused_because_of_itself(
    blobs: S3BlobStore, shaky: S3BlobStore, chaos: HttpChaos, fault: Fault, size: int
) -> None:
    content = b"x" * size
    blobs.stat("nothing")  # connects before the endpoint is another
    chaos.plan = first("PUT", fault)
    assert shaky.create("a/b", content).size == size
    assert chaos.hits == {fault: 1}
    assert blobs.read("a/b") == content
    with pytest.raises(BlobExistsError):
        shaky.create("a/b", content)


def test_of_sixteen_writers_one_wins_whatever_answers_are_lost(shaky: S3BlobStore, chaos: HttpChaos) -> None:
    """Cut off before the first byte of its content, without a checksum, a request would be taken for a whole one."""
    chaos.plan = now_and_then(16, 0.3, (Fault.REFUSE, Fault.LOSE, Fault.RESET, Fault.CUT))
    for race in range(5):
        won: list[int] = []
        begin = threading.Barrier(16)

        def write(number: int, key: str = f"race/{race}", begin: threading.Barrier = begin) -> None:
            begin.wait()
            try:
                shaky.create(key, f"{number}".encode())
            except BlobExistsError:
                return
            won.append(number)  # noqa: B023 (the threads end before the next race)

        threads = [threading.Thread(target=write, args=(number,)) for number in range(16)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert [str(number).encode() for number in won] == [shaky.read(f"race/{race}")]
    assert sum(chaos.hits.values()) > 10


def test_a_request_that_ends_before_its_content_stores_nothing(
    blobs: S3BlobStore, chaos: HttpChaos, s3_url: str, tmp_path: Path
) -> None:
    hasty = S3BlobStore(s3_url, tmp_path / "hasty", patience_s=0)
    chaos.plan = first("PUT", Fault.CUT, 100)
    with pytest.raises(StoreUnavailableError):
        hasty.create("a/b", b"1")  # of which no byte arrives
    assert chaos.hits[Fault.CUT] >= 1
    chaos.plan = first("PUT", Fault.CUT, 0)
    assert blobs.stat("a/b") is None
    assert blobs.create("a/b", b"2").size == 1


def test_an_upload_that_is_cut_off_leaves_nothing(
    blobs: S3BlobStore, chaos: HttpChaos, s3_url: str, tmp_path: Path
) -> None:
    hasty = S3BlobStore(s3_url, tmp_path / "hasty", patience_s=0)
    chaos.plan = first("PUT", Fault.CUT, 100)
    path = hasty.scratch() / "upload"
    path.write_bytes(b"x" * 3_000_000)
    with pytest.raises(StoreUnavailableError):
        hasty.adopt("meshes/a", path)
    assert path.exists()  # it is not ours to throw away yet
    assert blobs.stat("meshes/a") is None
    assert list(blobs.list("")) == []
    chaos.plan = first("PUT", Fault.CUT, 0)
    assert hasty.adopt("meshes/a", path).size == 3_000_000


def test_everything_is_done_although_every_third_request_fails(shaky: S3BlobStore, chaos: HttpChaos) -> None:
    chaos.plan = now_and_then(3, 0.33, (Fault.REFUSE, Fault.LOSE, Fault.RESET, Fault.CUT))
    content = b"0123456789" * 100_000
    for number in range(10):
        shaky.create(f"jobs/{number}/file", [content])
    assert [stat.key for stat in shaky.list("jobs")] == [f"jobs/{number}/file" for number in range(10)]
    assert list(shaky.folders("jobs/")) == [str(number) for number in range(10)]
    with shaky.open("jobs/3/file") as file:
        file.seek(500_003)
        assert file.read(4) == b"3456"
    assert shaky.copy("jobs/4/file", "jobs/copy").size == len(content)
    assert shaky.read("jobs/copy") == content
    assert all(shaky.delete(stat.key) for stat in shaky.list("jobs"))
    assert list(shaky.list("")) == []
    assert sum(chaos.hits.values()) > 10


def test_a_full_store_is_named(shaky: S3BlobStore, chaos: HttpChaos) -> None:
    chaos.plan = lambda method, _path: Fault.FULL if method == "PUT" else None
    with pytest.raises(StorageFullError, match="no space left to store a/b"):
        shaky.create("a/b", b"")


@pytest.mark.parametrize(
    ("variable", "sentence"),
    [
        ("AWS_SECRET_ACCESS_KEY=wrong", "refuses our credentials"),
        ("AWS_ENDPOINT_URL=http://127.0.0.1:1", "does not answer"),
    ],
)
def test_a_store_that_cannot_be_used_says_why_and_tells_no_address(
    s3_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, variable: str, sentence: str
) -> None:
    monkeypatch.setenv(*variable.split("="))
    blobs = S3BlobStore(s3_url, tmp_path, patience_s=0)
    for use in (
        blobs.ping,
        lambda: blobs.create("a", b""),
        lambda: blobs.create("a", [b""]),
        lambda: blobs.read("a"),
        lambda: blobs.open("a"),
        lambda: blobs.stat("a"),
        lambda: list(blobs.list("")),
        lambda: list(blobs.folders("jobs/")),
        lambda: blobs.delete("a"),
    ):
        with pytest.raises(StoreUnavailableError, match=sentence) as caught:
            use()
        assert "127.0.0.1" not in str(caught.value)
        assert "wrong" not in str(caught.value)


def test_a_store_that_hangs_is_not_waited_for(shaky: S3BlobStore, chaos: HttpChaos, s3_url: str) -> None:
    hasty = S3BlobStore(s3_url, shaky.scratch(), patience_s=0, request_s=1)
    chaos.plan = lambda _method, _path: Fault.HANG
    for use in (hasty.ping, lambda: hasty.read("a"), lambda: hasty.create("a", b"1")):
        with pytest.raises(StoreUnavailableError):
            use()


def test_a_bucket_that_is_not_there_is_no_missing_blob(s3_url: str, tmp_path: Path) -> None:
    blobs = S3BlobStore("s3://no-such-bucket/x", tmp_path, patience_s=0)
    for use in (blobs.ping, lambda: blobs.read("a"), lambda: list(blobs.list(""))):
        with pytest.raises(StoreUnavailableError, match=r"no such bucket|NoSuchBucket"):
            use()


def test_a_blob_that_is_not_what_was_written_is_not_read(blobs: S3BlobStore, s3_url: str) -> None:
    blobs.create("a/b", b"content")
    direct = S3Store(BUCKET, prefix=s3_url.rpartition("/")[2], client_options={"allow_http": True})
    attributes = obstore.get(direct, "a/b").attributes
    obstore.put(direct, "a/b", b"c0ntent", attributes=attributes)  # as a disk or a hand may do it
    with pytest.raises(DamagedBlobError, match="a/b"):
        blobs.read("a/b")


def test_a_blob_that_is_made_anew_is_not_mixed_with_the_one_that_is_being_read(blobs: S3BlobStore) -> None:
    blobs.create("a/b", b"1" * 2_000_000)
    with blobs.open("a/b") as file:
        assert file.read(10) == b"1" * 10
        blobs.delete("a/b")
        blobs.create("a/b", b"2" * 2_000_000)
        with pytest.raises(BlobNotFoundError, match="another blob"):
            file.read()


def test_what_was_written_outlives_a_server_that_is_killed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with S3Server(tmp_path / "server") as server:
        for name, value in server.environment.items():
            monkeypatch.setenv(name, value)
        blobs = S3BlobStore(f"s3://{BUCKET}", tmp_path / "scratch", patience_s=60)
        hasty = S3BlobStore(f"s3://{BUCKET}", tmp_path / "scratch", patience_s=0)
        for number in range(20):
            blobs.create(f"a/{number}", str(number).encode() * 1000)
        server.stop()
        with pytest.raises(StoreUnavailableError, match="does not answer"):
            hasty.read("a/1")
        patient = threading.Thread(target=lambda: blobs.create("a/20", b"20" * 1000))
        patient.start()  # waits for the server
        server.start()
        patient.join()
        assert {stat.key: blobs.read(stat.key) for stat in blobs.list("a")} == {
            f"a/{number}": str(number).encode() * 1000 for number in range(21)
        }


BOUNDED = """
import resource, sys
from pathlib import Path
from spherify.stores.s3_blobs import S3BlobStore

blobs = S3BlobStore(sys.argv[1], Path(sys.argv[2]), patience_s=60)
blobs.create("small", b"x")
blobs.read("small")
status = Path("/proc/self/status").read_text()
used = 1024 * int(status.partition("VmData:")[2].split()[0])
resource.setrlimit(resource.RLIMIT_DATA, (used + (40 << 20),) * 2)
piece = bytes(1 << 20)
blobs.create("large", (piece for _ in range(96)))
blobs.copy("large", "other")
with blobs.open("other") as file:
    assert sum(len(piece) for piece in iter(lambda: file.read(1 << 18), b"")) == 96 << 20
"""


@pytest.mark.skipif(
    sys.platform != "linux", reason="NOT TRIED: only Linux limits what is not mapped from files"
)
def test_a_blob_of_96_mib_needs_no_memory_of_that_size(s3_url: str, tmp_path: Path) -> None:
    command = [sys.executable, "-c", BOUNDED, s3_url, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=110)
    assert done.returncode == 0, done.stderr


def test_of_the_states_of_a_job_their_ends_are_fetched_to_tell_what_is_there(
    blobs: S3BlobStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    arrays = {
        "vertices": np.zeros((100_000, 3)),
        "fingerprint": np.arange(4),
        "position": np.zeros((100_000, 3)),
    }
    for iteration in (0, 1):
        rows = rows_to_array([{"iteration": i, "sphericity": 0.5} for i in range(iteration + 1)])
        blobs.create(
            layout.numbered(layout.snapshots("job_a"), 1, iteration), dump_arrays({**arrays, ROWS: rows})
        )
    fetched: list[int] = []
    read_range = S3Client.read_range

    def counted(client: S3Client, key: str, start: int, end: int, etag: str | None) -> bytes:
        fetched.append(end - start)
        return read_range(client, key, start, end, etag)

    monkeypatch.setattr(S3Client, "read_range", counted)
    trail = find_trail(blobs, "job_a")
    assert [snapshot.metrics for snapshot in trail.snapshots] == [{"sphericity": 0.5}] * 2
    assert sum(fetched) < trail.snapshots[0].size / 4
    assert trail.snapshots[0].sha256 == checksum_of(blobs.read(trail.snapshots[0].key))
