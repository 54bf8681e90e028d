"""What happens while records are rebuilt: another loss, another who rebuilds, deletions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import pytest
import redis

from spherify.jobs import layout
from spherify.jobs.delete import delete_job, delete_mesh
from spherify.jobs.errors import JobGoneError, MeshInUseError, StoreUnavailableError
from spherify.jobs.model import Job, JobStatus, Outcome
from spherify.jobs.rebuild import rebuild
from spherify.jobs.stock import Stock
from spherify.stores.blobs import FolderBlobStore
from spherify.stores.redis_jobs import RedisJobStore
from spherify.stores.redis_meshes import RedisMeshStore
from tests.jobs.examples import MESH_ID, job_spec
from tests.jobs.test_rebuild import ROWS, ended
from tests.jobs.world import submitted


@pytest.fixture
def lost(stock: Stock, lose: Callable[[], object]) -> list[str]:
    """Submit three jobs, and lose all records."""
    job_ids = [submitted(stock).id for _ in range(3)]
    lose()
    return job_ids


def in_the_midst(do: Callable[[], object]) -> Callable[[], object]:
    """Return what a rebuild is to call again and again, and does something the third time."""
    steps = count(1)

    def still() -> None:
        if next(steps) == 3:
            do()

    return still


def test_records_lost_once_more_during_the_rebuild_are_rebuilt_again(
    stock: Stock, lost: list[str], lose: Callable[[], object]
) -> None:
    assert rebuild(stock, in_the_midst(lose))
    assert not stock.jobs.complete()
    assert rebuild(stock)
    assert stock.jobs.complete()
    assert sorted(job.id for job in stock.jobs.find().items) == sorted(lost)


def test_two_who_rebuild_at_once_are_not_in_each_others_way(
    stock: Stock, lost: list[str], caplog: pytest.LogCaptureFixture
) -> None:
    other: list[bool] = []
    with caplog.at_level("INFO"):
        assert rebuild(stock, in_the_midst(lambda: other.append(rebuild(stock))))
    assert other == [True]
    assert stock.jobs.complete()
    assert sorted(stock.queue.pending()) == sorted(lost), "each is sent once"
    assert not [line for line in caplog.messages if "lost again" in line]


def test_no_mesh_is_deleted_while_a_job_that_names_it_may_come_back(
    stock: Stock, lose: Callable[[], object]
) -> None:
    spec = submitted(stock)
    lose()
    refused: list[str] = []

    def still() -> None:
        if not stock.meshes.unknown([MESH_ID]) and stock.jobs.unknown([spec.id]):
            with pytest.raises(StoreUnavailableError):
                delete_mesh(stock.meshes, stock.blobs, MESH_ID)
            refused.append(MESH_ID)

    rebuild(stock, still)
    assert refused
    assert stock.blobs.stat(layout.mesh_record(MESH_ID)) is not None
    assert stock.jobs.get(spec.id).status is JobStatus.ACCEPTED
    with pytest.raises(MeshInUseError):
        delete_mesh(stock.meshes, stock.blobs, MESH_ID)


def test_who_slept_over_a_deletion_and_a_further_loss_brings_no_job_back(
    stock: Stock, lose: Callable[[], object], tmp_path: Path
) -> None:
    class Sleepy(FolderBlobStore):
        """It read the spec, and slept until everything was rebuilt, and the job deleted, and everything lost again."""

        def read(self, key: str) -> bytes:
            content = super().read(key)
            if key == layout.spec(spec.id):
                assert rebuild(stock)
                delete_job(stock.jobs, stock.blobs, spec.id)
                lose()
            return content

    spec = ended(stock, Outcome(JobStatus.SUCCESSFUL))
    lose()
    rebuild(replace(stock, blobs=Sleepy(tmp_path / "blobs")))
    assert rebuild(stock)
    with pytest.raises(JobGoneError):
        stock.jobs.get(spec.id)


@pytest.mark.parametrize("step", ["zrevrangebylex", "register_script", "pipeline", "mget"])
def test_a_listing_in_the_midst_of_which_all_is_lost_does_not_end_too_early(
    stock: Stock, lose: Callable[[], object], client: redis.Redis, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    submitted(stock)
    jobs, meshes = RedisJobStore(client), RedisMeshStore(client)
    ask = getattr(client, step)

    def last(*args: Any, **more: Any) -> Any:
        lose()
        return ask(*args, **more)

    monkeypatch.setattr(client, step, last)
    with pytest.raises(StoreUnavailableError):
        _ = jobs.find() if step in {"zrevrangebylex", "register_script"} else meshes.find()


@pytest.mark.parametrize("what", ["job", "cancel", "mesh", "new job"])
def test_what_comes_back_the_moment_it_is_asked_for_is_not_said_to_be_missing(
    stock: Stock, lose: Callable[[], object], client: redis.Redis, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    """Whether a record is there, and whether it may come back, is one question: between two the last is restored."""
    spec, exists = ended(stock, Outcome(JobStatus.SUCCESSFUL)), client.exists
    jobs, meshes = RedisJobStore(client), RedisMeshStore(client)

    def late(*names: str) -> Any:
        rebuild(stock)
        return exists(*names)

    lose()
    monkeypatch.setattr(client, "exists", late)
    ask: dict[str, Callable[[], object]] = {
        "job": lambda: jobs.get(spec.id),
        "cancel": lambda: jobs.request_cancel(spec.id),
        "mesh": lambda: meshes.get(MESH_ID),
        "new job": lambda: jobs.add(job_spec()),
    }
    with pytest.raises(StoreUnavailableError):
        ask[what]()


def test_a_series_that_comes_back_the_moment_it_is_asked_for_is_whole(
    stock: Stock, lose: Callable[[], object], client: redis.Redis, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec, jobs = ended(stock, Outcome(JobStatus.SUCCESSFUL)), RedisJobStore(client)
    get = jobs.get

    def late(job_id: str) -> Job:
        rebuild(stock)
        return get(job_id)

    lose()
    monkeypatch.setattr(jobs, "get", late)
    assert jobs.metrics(spec.id) == ROWS


def test_a_listing_in_the_midst_of_which_all_is_lost_and_rebuilt_does_not_end_too_early(
    stock: Stock, lose: Callable[[], object], client: redis.Redis, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A page that was begun while records were missing may pass some over, though in the end they are all there."""
    submitted(stock)
    jobs, walk = RedisJobStore(client), client.zrevrangebylex

    def meanwhile(*args: Any) -> Any:
        lose()
        found = walk(*args)
        rebuild(stock)
        return found

    monkeypatch.setattr(client, "zrevrangebylex", meanwhile)
    with pytest.raises(StoreUnavailableError):
        jobs.find()
