"""What tells whether jobs have changed: the twin in memory and the real server."""

from __future__ import annotations

import pytest

from spherify.jobs.errors import JobGoneError
from spherify.jobs.ids import new_job_id
from spherify.jobs.model import JobStatus, Outcome, Progress
from spherify.jobs.ports import JobStore, Revision
from tests.jobs.examples import job_spec


def test_revisions_are_those_of_the_jobs_in_the_order_asked(jobs: JobStore) -> None:
    first, second = jobs.add(job_spec()).id, jobs.add(job_spec()).id
    unknown, _ = new_job_id()
    assert jobs.revisions([second, unknown, first]) == [Revision(1, 1), None, Revision(1, 0)]
    assert jobs.revisions([]) == []


def test_every_change_is_another_revision_and_the_queue_moves_without_one(jobs: JobStore) -> None:
    first, second = jobs.add(job_spec()).id, jobs.add(job_spec()).id
    seen = jobs.revisions([first])
    token = jobs.claim(first, "w").token
    for change in (
        lambda: jobs.report(first, token, Progress(1, 3)),
        lambda: jobs.commit(first, token, Outcome(JobStatus.SUCCESSFUL)),
    ):
        seen += jobs.revisions([first])
        assert change()
    seen += jobs.revisions([first])
    assert len(set(seen)) == 4
    assert seen[-1] == Revision(jobs.get(first).rev, None)
    assert jobs.revisions([second]) == [Revision(1, 0)]


def test_many_at_once(jobs: JobStore) -> None:
    ids = [jobs.add(job_spec()).id for _ in range(300)]
    assert jobs.revisions(ids) == [Revision(1, place) for place in range(300)]


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
    assert jobs.get(first, known) is known
    assert jobs.report(first, token, Progress(1, 3))
    changed = jobs.get(first, known)
    assert changed == jobs.get(first) != known
    assert jobs.commit(first, token, Outcome(JobStatus.SUCCESSFUL))
    jobs.delete(first)
    with pytest.raises(JobGoneError):
        jobs.get(first, changed)
