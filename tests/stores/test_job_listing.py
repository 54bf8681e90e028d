"""Listings of jobs, of the twin in memory and the real server."""

from __future__ import annotations

import pytest

from spherify.jobs.errors import InvalidCursorError
from spherify.jobs.model import JobStatus
from spherify.jobs.ports import JobStore
from tests.jobs.examples import OTHER_MESH, job_spec


def test_pages_are_newest_first_and_complete(jobs: JobStore) -> None:
    specs = [job_spec(at=1_700_000_000.0 + i, tags=("odd",) if i % 2 else ("even",)) for i in range(7)]
    for spec in specs:
        jobs.add(spec)
    expected = [spec.id for spec in reversed(specs)]
    seen: list[str] = []
    cursor = None
    for _ in range(4):
        page = jobs.find(limit=2, cursor=cursor)
        seen += [job.id for job in page.items]
        cursor = page.next_cursor
    assert seen == expected
    assert cursor is None
    assert jobs.find(limit=7).next_cursor is None
    assert [job.id for job in jobs.find(tag="odd").items] == expected[1::2]


def test_listings_filter_by_everything_at_once(jobs: JobStore) -> None:
    old = job_spec(at=1_700_000_000.0, tags=("t",))
    new = job_spec(at=1_700_000_010.0, tags=("t", "u"))
    elsewhere = job_spec(at=1_700_000_020.0, tags=("t",), mesh_id=OTHER_MESH)
    for spec in (old, new, elsewhere):
        jobs.add(spec)
    jobs.request_cancel(old.id)

    def ids(**filters: object) -> list[str]:
        return [job.id for job in jobs.find(**filters).items]  # type: ignore[arg-type]

    assert ids(status=JobStatus.ACCEPTED) == [elsewhere.id, new.id]
    assert ids(status=JobStatus.CANCELLED) == [old.id]
    assert ids(mesh_id=OTHER_MESH) == [elsewhere.id]
    assert ids(tag="t", mesh_id=old.mesh_id) == [new.id, old.id]
    assert ids(tag="t", mesh_id=old.mesh_id, status=JobStatus.ACCEPTED) == [new.id]
    assert ids(created_after=1_700_000_000.0) == [elsewhere.id, new.id]
    assert ids(created_after=1_700_000_015.5) == [elsewhere.id]
    assert ids(tag="none") == []


@pytest.mark.parametrize("cursor", ["", "x", "job_", "mesh_1", "job_01K00000000000000000000000x"])
def test_a_cursor_must_be_one_of_ours(jobs: JobStore, cursor: str) -> None:
    with pytest.raises(InvalidCursorError):
        jobs.find(cursor=cursor)
