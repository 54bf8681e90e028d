"""Reading jobs, one or many, known or not: the twin in memory and the real server."""

from __future__ import annotations

from collections.abc import Mapping

import pytest
import redis

from spherify.jobs.errors import JobGoneError, JobNotFoundError, JobsError, StoreUnavailableError
from spherify.jobs.ids import new_job_id
from spherify.jobs.model import Job, JobStatus, Outcome, Progress, Snapshot
from spherify.jobs.ports import JobStore
from spherify.stores import keys, redis_jobs
from tests.jobs.examples import job_spec


def test_many_are_read_in_the_order_asked_each_with_what_it_is(jobs: JobStore) -> None:
    first, second, deleted = (jobs.add(job_spec()).id for _ in range(3))
    jobs.request_cancel(deleted)
    jobs.delete(deleted)
    unknown, _ = new_job_id()
    found = jobs.get_all(dict.fromkeys([second, unknown, first, deleted]))
    assert list(found) == [second, unknown, first, deleted]
    assert (found[first], found[second]) == (jobs.get(first), jobs.get(second))
    assert isinstance(found[unknown], JobNotFoundError)
    assert isinstance(found[deleted], JobGoneError)
    assert jobs.get_all({}) == {}


def test_more_than_one_call_takes(jobs: JobStore) -> None:
    ids = [jobs.add(job_spec()).id for _ in range(300)]
    found = jobs.get_all(dict.fromkeys(ids))
    assert [job.queue_position for job in found.values() if isinstance(job, Job)] == list(range(300))


@pytest.mark.parametrize("make", ["redis"], indirect=True)
def test_no_call_reads_many_snapshots(
    client: redis.Redis, jobs: JobStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A hundred jobs of a thousand snapshots each would keep the server from everybody else."""
    monkeypatch.setattr(redis_jobs, "_SNAPSHOTS_A_CALL", 4)
    ids = [jobs.add(job_spec()).id for _ in range(9)]
    for job_id in ids[:6]:
        token = jobs.claim(job_id, "w").token
        for iteration in range(3):
            jobs.add_snapshot(job_id, token, Snapshot(iteration, "k", "s", 1, {"area": 1.5}, 1.0))
    found = jobs.get_all(dict.fromkeys(ids))
    assert found == {job_id: jobs.get(job_id) for job_id in ids}
    assert [len(job.snapshots) for job in found.values() if isinstance(job, Job)] == [3] * 6 + [0] * 3
    client.config_resetstat()
    jobs.get_all(dict.fromkeys(ids))
    stats = client.info("commandstats")
    assert (stats["cmdstat_evalsha"]["calls"], stats["cmdstat_hvals"]["calls"]) == (4, 9)  # type: ignore[index] # not async


def test_what_is_known_and_unchanged_is_not_read_again(jobs: JobStore) -> None:
    first, second = jobs.add(job_spec()).id, jobs.add(job_spec()).id
    known = jobs.get(second)
    assert jobs.get(second, known) is known
    assert jobs.get(first, known).id == first  # of the same revision
    token = jobs.claim(first, "w").token
    moved = jobs.get(second, known)
    assert (moved.rev, moved.queue_position) == (known.rev, 0)
    assert moved == jobs.get(second)
    known = jobs.get(first)
    assert jobs.get_all({first: known, second: None}) == {first: known, second: moved}
    assert jobs.get(first, known) is known
    assert jobs.report(first, token, Progress(1, 3))
    changed = jobs.get(first, known)
    assert changed == jobs.get(first) != known
    assert jobs.commit(first, token, Outcome(JobStatus.SUCCESSFUL))
    jobs.delete(first)
    with pytest.raises(JobGoneError):
        jobs.get(first, changed)


@pytest.mark.parametrize("make", ["redis"], indirect=True)
def test_a_page_reads_no_more_jobs_than_it_shows_and_one(
    jobs: JobStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The one tells that there are more; a filter that leaves some out reads on."""
    ids = [jobs.add(job_spec(tags=("even",) if i % 2 == 0 else ())).id for i in range(12)]
    for job_id in ids[-4:]:
        jobs.request_cancel(job_id)
    read: list[str] = []
    whole = jobs.get_all

    def get_all(known: Mapping[str, Job | None]) -> dict[str, Job | JobsError]:
        read.extend(known)
        return whole(known)

    monkeypatch.setattr(jobs, "get_all", get_all)
    assert [job.id for job in jobs.find(limit=3).items] == ids[:-4:-1]
    assert read == ids[:-5:-1]
    found = jobs.find(limit=3, tag="even", status=JobStatus.ACCEPTED)
    assert [job.id for job in found.items] == [ids[6], ids[4], ids[2]]
    assert found.next_cursor == ids[2]


@pytest.mark.parametrize("make", ["redis"], indirect=True)
def test_what_is_missing_may_come_back_while_records_are(jobs: JobStore, client: redis.Redis) -> None:
    """One that is there, and one of which nobody can say yet whether there ever was one."""
    there, (missing, _) = jobs.add(job_spec()).id, new_job_id()
    client.delete(keys.EPOCH)
    found = jobs.get_all(dict.fromkeys([there, missing]))
    assert isinstance(found[there], Job)
    assert isinstance(found[missing], StoreUnavailableError)
