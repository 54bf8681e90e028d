"""Polls: many that ask at the same moment, and the way around the router."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Mapping

import httpx
import pytest

from service.job_answers import JobDocuments
from service.reading import JobReader
from spherify.jobs.errors import JobNotFoundError, JobsError, StoreUnavailableError
from spherify.jobs.ids import new_job_id
from spherify.jobs.model import Job, JobStatus
from spherify.stores.memory import MemoryJobStore
from tests.jobs.examples import MESH_ID, job_spec, mesh_record
from tests.service.conftest import Hand

Submit = Callable[..., Hand]


class GatedStore(MemoryJobStore):
    """Has read, and does not answer before it is let."""

    def __init__(self) -> None:
        super().__init__()
        self.meshes[MESH_ID] = mesh_record(MESH_ID)
        self.asked: list[list[str]] = []
        self.has_read = threading.Event()
        self.gate = threading.Event()

    def get_all(self, known: Mapping[str, Job | None]) -> dict[str, Job | JobsError]:
        self.asked.append(list(known))
        found = super().get_all(known)
        self.has_read.set()
        assert self.gate.wait(10)
        return found


async def reading(store: GatedStore, reader: JobReader, job_id: str) -> asyncio.Task[Job]:
    """Return a poll that the store has read for, and not answered."""
    first = asyncio.create_task(reader.get(job_id))
    assert await asyncio.to_thread(store.has_read.wait, 10)
    return first


def test_who_asks_while_the_store_is_read_shares_the_next_reading_and_sees_what_was_before_it() -> None:
    store = GatedStore()
    one, other = store.add(job_spec()).id, store.add(job_spec()).id

    async def ask() -> None:
        reader = JobReader(store, JobDocuments())
        first = await reading(store, reader, one)
        store.request_cancel(one)
        later = [asyncio.create_task(reader.get(job_id)) for job_id in (one, other, one, one)]
        await asyncio.sleep(0)
        store.gate.set()
        assert (await first).status is JobStatus.ACCEPTED
        assert [job.status for job in await asyncio.gather(*later)] == [
            JobStatus.CANCELLED,
            JobStatus.ACCEPTED,
            JobStatus.CANCELLED,
            JobStatus.CANCELLED,
        ]
        assert store.asked == [[one], [one, other]]

    asyncio.run(ask())


def test_more_jobs_than_are_kept_are_read_a_bounded_number_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """As for ten thousand pages on as many jobs: none is kept, each poll reads, and nobody waits for all."""
    monkeypatch.setattr("service.reading.MOST", 20)
    store = GatedStore()
    ids = [store.add(job_spec()).id for _ in range(50)]

    async def ask() -> None:
        documents = JobDocuments(most_bytes=10_000)
        reader = JobReader(store, documents)
        first = await reading(store, reader, ids[0])
        later = [asyncio.create_task(reader.get(job_id)) for job_id in ids + ids]
        await asyncio.sleep(0)
        store.gate.set()
        await first
        found = await asyncio.gather(*later)
        assert [job.id for job in found] == ids + ids
        assert [len(asked) for asked in store.asked] == [1, 20, 20, 20, 20, 20]
        assert all(documents.document(job) for job in found)
        assert 0 < sum(documents.job(job_id) is not None for job_id in ids) < 5

    asyncio.run(ask())


def test_one_that_leaves_and_one_that_is_not_there_cost_the_others_nothing() -> None:
    store = GatedStore()
    there, (missing, _) = store.add(job_spec()).id, new_job_id()

    async def ask() -> None:
        reader = JobReader(store, JobDocuments())
        first = await reading(store, reader, there)
        leaves, stays, fails, fails_too = (
            asyncio.create_task(reader.get(job_id)) for job_id in (there, there, missing, missing)
        )
        await asyncio.sleep(0)
        leaves.cancel()
        store.gate.set()
        assert (await first).id == (await stays).id == there
        errors = await asyncio.gather(fails, fails_too, return_exceptions=True)
        assert [type(error) for error in errors] == [JobNotFoundError] * 2
        assert errors[0] is not errors[1], "each gathers its own traceback"
        assert leaves.cancelled()

    asyncio.run(ask())


def test_a_store_that_fails_is_asked_again_by_the_next(monkeypatch: pytest.MonkeyPatch) -> None:
    store = MemoryJobStore()
    store.meshes[MESH_ID] = mesh_record(MESH_ID)
    job_id = store.add(job_spec()).id

    def away(_: Mapping[str, Job | None]) -> dict[str, Job | JobsError]:
        raise StoreUnavailableError

    async def ask() -> None:
        reader = JobReader(store, JobDocuments())
        with monkeypatch.context() as patch:
            patch.setattr(store, "get_all", away)
            with pytest.raises(StoreUnavailableError) as raised:
                await reader.get(job_id)
            assert raised.value.__cause__ is not None, "the log is to say where it failed"
            assert raised.value.__cause__.__traceback__ is not None
        assert (await reader.get(job_id)).id == job_id

    asyncio.run(ask())


@pytest.mark.parametrize("method", ["GET", "HEAD"])
def test_a_poll_is_answered_as_its_route_answers(
    client: httpx.Client, submitted: Submit, method: str
) -> None:
    """A query sends a poll on to the router, and one that changes nothing tells the two ways apart."""
    hand, deleted = submitted(), submitted()
    client.post(f"/v1/jobs/{deleted.job_id}/cancel")
    client.delete(f"/v1/jobs/{deleted.job_id}")
    etag = client.get(f"/v1/jobs/{hand.job_id}").headers["etag"]
    unknown, _ = new_job_id()
    for job_id in (hand.job_id, deleted.job_id, unknown, "job_0"):
        for condition in ({}, {"If-None-Match": etag}, {"If-None-Match": "*"}):
            headers = {"X-Request-ID": "the-same"} | condition
            poll, route = (
                client.request(method, f"/v1/jobs/{job_id}{query}", headers=headers)
                for query in ("", "?wait=0")
            )
            assert (poll.status_code, poll.text) == (route.status_code, route.text)
            told = [dict(answer.headers) | {"date": ""} for answer in (poll, route)]
            assert told[0] == told[1]
