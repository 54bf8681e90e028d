"""How much of the server's memory a job takes: the bounds that `spherify.stores.keys` gives."""

from __future__ import annotations

import redis

from spherify.geometry.metrics import Metrics
from spherify.geometry.schedule import SnapshotPlan, recorded_iterations
from spherify.jobs import layout
from spherify.jobs.model import JobStatus, Outcome, Progress, Snapshot
from spherify.stores.redis_jobs import RedisJobStore
from spherify.stores.redis_meshes import RedisMeshStore
from tests.jobs.examples import job_spec, mesh_record


def taken(client: redis.Redis) -> int:
    """The bytes of all keys; not of the whole server, whose buffers and scripts come and go."""
    return sum(client.memory_usage(key, samples=0) or 0 for key in client.scan_iter())  # type: ignore[misc] # not async


def test_a_finished_job_takes_a_bounded_amount_of_the_servers_memory(client: redis.Redis) -> None:
    """The longest job there is: every row and snapshot that a plan allows, with figures as long as they get."""
    RedisMeshStore(client).add(mesh_record())
    jobs = RedisJobStore(client)
    figures = dict.fromkeys(Metrics.__dataclass_fields__, 1 / 3)
    before = taken(client)
    spec = job_spec(iterations=1_000_000, snapshots="every:1002", tags=("a", "b"))
    jobs.add(spec)
    token = jobs.claim(spec.id, "w").token
    recorded = recorded_iterations(1_000_000, SnapshotPlan(spec.snapshots_requested))
    rows = [{"iteration": iteration, **figures} for iteration in recorded]
    jobs.report(spec.id, token, Progress(1, 3), rows)
    for iteration in spec.snapshots_requested:
        key = layout.numbered(layout.snapshots(spec.id), token, iteration)
        jobs.add_snapshot(spec.id, token, Snapshot(iteration, key, "0" * 64, 10**9, figures, 1.0))
    jobs.commit(spec.id, token, Outcome(JobStatus.SUCCESSFUL, "iterations", None, 1, 1))
    assert taken(client) - before < 3_000_000
    jobs.delete(spec.id)
    assert taken(client) - before < 2_000
