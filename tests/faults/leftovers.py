"""What must not grow: memory and descriptors of processes, keys of the server, files of jobs."""

from __future__ import annotations

import os
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from spherify.jobs import layout
from spherify.jobs.model import JobStatus
from spherify.stores import keys
from tests.stack import Stack, wait_for


@dataclass(frozen=True)
class Usage:
    """What a process holds: resident memory in bytes, and open files."""

    memory: int
    files: int

    def __str__(self) -> str:
        return f"{self.memory / 2**20:.1f} MiB, {self.files} files"


def usage(pid: int) -> Usage:
    """Look at a process."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return Usage(pages * os.sysconf("SC_PAGE_SIZE"), len(list(Path(f"/proc/{pid}/fd").iterdir())))


def assert_nothing_left(stack: Stack, job_ids: set[str], *, kills: int) -> None:
    """Check that nothing is kept but what these jobs, all of them done, have a right to.

    Each of the kills may have struck one process in the middle of a file, which is swept after a day.
    Messages that killed workers held come back after the visibility timeout of the queue, and are dropped.
    """
    client, blobs = stack.stores.client, stack.stores.blobs
    at_work = (
        keys.QUEUED,
        keys.LEASES,
        keys.UNSETTLED,
        keys.UNACKED,
        keys.UNACKED_INDEX,
        keys.QUEUE,
        keys.QUEUE_USUAL,
    )
    wait_for(lambda: not client.exists(*at_work), limit_s=300, what="queues and indexes to be empty")
    counts = Counter(_kind(key, job_ids) for key in client.scan_iter())
    for kind in ("job", "rows", "snapshots"):
        assert counts.pop(kind) == len(job_ids), kind
    assert counts.pop("repeat") <= len(job_ids)
    assert counts.total() < 40, counts  # indexes, meshes, the leader, signs of life, Celery's bindings
    for job_id in job_ids:
        job = stack.stores.jobs.get(job_id)
        assert job.status is JobStatus.SUCCESSFUL
        mine = {stat.key for stat in blobs.list(layout.job_folder(job_id))}
        named = {layout.spec(job_id), layout.result(job_id), *(s.key for s in job.snapshots)}
        assert (mine - named, named - mine) == (set(), set())
    struck = list(blobs.scratch().iterdir())
    assert len(struck) <= kills, struck


def _kind(key: str, job_ids: set[str]) -> str:
    for job_id in job_ids:
        if key == keys.job(job_id):
            return "job"
        if key == keys.rows(job_id):
            return "rows"
        if key == keys.snapshots(job_id):
            return "snapshots"
    return "repeat" if key.startswith(keys.repeat("")) else key
