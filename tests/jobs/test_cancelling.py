"""What became of a cancel that was acknowledged, when the records are lost and files are damaged."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from spherify.jobs import layout
from spherify.jobs.cancel import cancel
from spherify.jobs.errors import StorageFullError, StoreUnavailableError
from spherify.jobs.finish import conclude, finish
from spherify.jobs.model import JobStatus, Outcome
from spherify.jobs.ports import BlobStat, CancelOutcome, ClaimOutcome, Renewal
from spherify.jobs.rebuild import rebuild
from spherify.jobs.restore import restore_job
from spherify.jobs.results import Result, publish_result, read_result, write_result
from spherify.jobs.stock import Stock
from spherify.stores.blobs import FolderBlobStore
from tests.jobs.test_rebuild import ended
from tests.jobs.world import submitted


def test_a_cancel_that_was_acknowledged_outlives_the_record(stock: Stock, lose: Callable[[], object]) -> None:
    waiting, running = submitted(stock), submitted(stock)
    stock.jobs.claim(running.id, "w")
    assert cancel(stock.jobs, stock.blobs, waiting.id) is CancelOutcome.CANCELLED
    assert cancel(stock.jobs, stock.blobs, running.id) is CancelOutcome.CANCELLING
    assert cancel(stock.jobs, stock.blobs, running.id) is CancelOutcome.CANCELLING
    lose()
    rebuild(stock)
    for spec in (waiting, running):
        job = stock.jobs.get(spec.id)
        assert (job.status, job.stop_reason) == (JobStatus.CANCELLED, "cancelled")
        assert stock.blobs.stat(layout.result(spec.id)) is not None
    assert stock.queue.pending() == []


def test_a_cancelled_job_comes_back_where_its_end_finds_no_space(
    stock: Stock, lose: Callable[[], object], tmp_path: Path
) -> None:
    class Full(FolderBlobStore):
        def create(self, key: str, chunks: bytes | Iterable[bytes]) -> BlobStat:
            raise StorageFullError(f"there is no space left to store {key}")

    spec = submitted(stock)
    stock.jobs.claim(spec.id, "w")
    cancel(stock.jobs, stock.blobs, spec.id)
    lose()
    assert restore_job(replace(stock, blobs=Full(tmp_path / "blobs")), spec.id)
    assert stock.jobs.get(spec.id).status is JobStatus.CANCELLED
    assert stock.jobs.unsettled() == [spec.id], "the reconciler writes its end"


def test_a_cancel_counts_though_whoever_made_the_record_anew_died_over_it(
    stock: Stock, lose: Callable[[], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    restore = stock.jobs.restore

    def unheard(*args: Any, **more: Any) -> bool:
        restore(*args, **more)
        raise StoreUnavailableError("the answer was lost on the way")

    spec = submitted(stock)
    stock.jobs.claim(spec.id, "w")
    assert cancel(stock.jobs, stock.blobs, spec.id) is CancelOutcome.CANCELLING
    lose()
    with monkeypatch.context() as patch:
        patch.setattr(stock.jobs, "restore", unheard)
        with pytest.raises(StoreUnavailableError):
            rebuild(stock)
    assert rebuild(stock)
    assert stock.jobs.get(spec.id).status is JobStatus.CANCELLED
    assert stock.jobs.claim(spec.id, "w").outcome is ClaimOutcome.DONE
    assert stock.jobs.unsettled() == [spec.id], "the reconciler writes its end"


def test_a_waiting_job_that_was_cancelled_never_runs_though_record_and_result_are_lost(
    stock: Stock, lose: Callable[[], object], tmp_path: Path
) -> None:
    spec = submitted(stock)
    assert cancel(stock.jobs, stock.blobs, spec.id) is CancelOutcome.CANCELLED
    (tmp_path / "blobs" / layout.result(spec.id)).write_bytes(b"{")
    lose()
    rebuild(stock)
    assert stock.jobs.get(spec.id).status is JobStatus.CANCELLED
    assert stock.jobs.claim(spec.id, "w").outcome is ClaimOutcome.DONE
    result = read_result(stock.blobs, spec.id)
    assert result is not None
    assert result.outcome.status is JobStatus.CANCELLED


@pytest.mark.parametrize("running", [False, True])
def test_a_cancel_counts_though_the_record_was_made_anew_before_a_file_said_so(
    stock: Stock, lose: Callable[[], object], tmp_path: Path, running: bool
) -> None:
    class Slow(FolderBlobStore):
        """Between record and file the server forgets everything, and the reconciler has it all back."""

        def create(self, key: str, chunks: bytes | Iterable[bytes]) -> BlobStat:
            if key == layout.cancel(spec.id):
                lose()
                assert rebuild(stock)
                assert stock.jobs.get(spec.id).status is JobStatus.ACCEPTED
            return super().create(key, chunks)

    spec = submitted(stock)
    if running:
        stock.jobs.claim(spec.id, "w")
    assert cancel(stock.jobs, Slow(tmp_path / "blobs"), spec.id) is CancelOutcome.CANCELLED
    assert stock.jobs.get(spec.id).status is JobStatus.CANCELLED
    lose()
    rebuild(stock)
    assert stock.jobs.get(spec.id).status is JobStatus.CANCELLED


def test_a_cancel_that_came_too_late_leaves_nothing_that_cancels_the_job_later(
    stock: Stock, lose: Callable[[], object], tmp_path: Path
) -> None:
    class Slower(FolderBlobStore):
        """Between record and file everything is forgotten and made anew, and an attempt is about to write its end."""

        def create(self, key: str, chunks: bytes | Iterable[bytes]) -> BlobStat:
            if key == layout.cancel(spec.id):
                lose()
                assert rebuild(stock)
                assert stock.jobs.seal(spec.id, stock.jobs.claim(spec.id, "w").token) is Renewal.HELD
            return super().create(key, chunks)

    spec = submitted(stock)
    assert cancel(stock.jobs, Slower(tmp_path / "blobs"), spec.id) is CancelOutcome.FINISHED
    lose()  # and the attempt died
    assert rebuild(stock)
    assert stock.jobs.get(spec.id).status is JobStatus.ACCEPTED


def test_a_job_that_came_back_and_ended_while_whoever_cancels_it_slept_is_not_said_to_be_cancelled(
    stock: Stock, lose: Callable[[], object], tmp_path: Path
) -> None:
    class Sleepy(FolderBlobStore):
        def read(self, key: str) -> bytes:
            if self.stat(key) is None:
                lose()
                assert rebuild(stock)
                token = stock.jobs.claim(spec.id, "w").token
                result = write_result(stock.blobs, Result(spec.id, token, Outcome(JobStatus.SUCCESSFUL)))
                assert publish_result(stock.jobs, token, result)
            return super().read(key)

    spec = submitted(stock)
    assert cancel(stock.jobs, Sleepy(tmp_path / "blobs"), spec.id) is CancelOutcome.FINISHED
    assert stock.jobs.get(spec.id).status is JobStatus.SUCCESSFUL


@pytest.mark.parametrize("told", [False, True], ids=["written", "told"])
def test_whoever_cancels_is_not_told_that_it_was_too_late_for_it(
    stock: Stock, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, told: bool
) -> None:
    """The worker is quicker than the answer, and may not have come to tell the record yet."""

    class Slow(FolderBlobStore):
        def read(self, key: str) -> bytes:
            with monkeypatch.context() as patch:
                if not told:
                    patch.setattr(stock.jobs, "commit", lambda *_: False)
                conclude(stock.jobs, stock.blobs, spec.id, token)
            return super().read(key)

    spec = submitted(stock)
    token = stock.jobs.claim(spec.id, "w").token
    outcome = CancelOutcome.CANCELLED if told else CancelOutcome.CANCELLING
    assert cancel(stock.jobs, Slow(tmp_path / "blobs"), spec.id) is outcome


def test_a_cancel_counts_though_an_older_copy_of_the_record_says_that_the_job_was_lost_too_often(
    stock: Stock,
) -> None:
    spec = submitted(stock)
    while stock.jobs.lose(spec.id, stock.jobs.claim(spec.id, "dies").token):
        pass
    stock.blobs.create(layout.cancel(spec.id), b"")
    assert finish(stock.jobs, stock.blobs, spec.id)
    job = stock.jobs.get(spec.id)
    assert (job.status, job.error) == (JobStatus.CANCELLED, None)


def test_a_job_that_has_ended_is_not_cancelled_though_an_older_copy_of_its_record_waits(
    stock: Stock, keep_copy: Callable[[], Callable[[], object]]
) -> None:
    put_back: list[Callable[[], object]] = []
    spec = ended(stock, Outcome(JobStatus.SUCCESSFUL), waiting=lambda: put_back.append(keep_copy()))
    before = stock.jobs.get(spec.id)
    put_back[0]()
    assert stock.jobs.get(spec.id).status is JobStatus.ACCEPTED
    assert cancel(stock.jobs, stock.blobs, spec.id) is CancelOutcome.FINISHED
    after = stock.jobs.get(spec.id)
    assert (after.status, after.snapshots) == (JobStatus.SUCCESSFUL, before.snapshots)
