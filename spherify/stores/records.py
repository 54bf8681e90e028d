"""Between a `Job` and the hash that holds it.

Fields: spec, progress, metrics, error (JSON); status, worker, stop_reason, stop_detail (text); rev, token,
attempt, losses, best_iteration, result_iteration (integers); queued_at, lease_until (milliseconds of the
server's clock); started_at, finished_at (seconds); sealed (1 once a cancel comes too late);
committed (the outcome, for a commit that is repeated); claimant (who may claim again), claimed_at and spent
(milliseconds: since when the present attempt, and how long all earlier ones held the job).
"""

from __future__ import annotations

import json
from collections.abc import Mapping

from spherify.jobs.codec import dump_record, dumps, load_error, load_progress, load_snapshot, load_spec
from spherify.jobs.model import Job, JobStatus, Outcome


def job_of(record: Mapping[str, str], snapshots: str, position: int | None) -> Job:
    """Return the job in a hash, with the JSON list of its snapshots and its place in the queue."""

    def integer(name: str) -> int | None:
        return int(record[name]) if name in record else None

    def seconds(name: str) -> float | None:
        return float(record[name]) if name in record else None

    lease = integer("lease_until")
    return Job(
        spec=load_spec(record["spec"]),
        status=JobStatus(record["status"]),
        rev=int(record["rev"]),
        token=int(record["token"]),
        attempt=int(record["attempt"]),
        losses=int(record["losses"]),
        worker=record.get("worker"),
        lease_until=None if lease is None else lease / 1000,
        progress=load_progress(record["progress"]) if "progress" in record else None,
        metrics=json.loads(record.get("metrics", "{}")),
        snapshots=tuple(sorted(map(load_snapshot, json.loads(snapshots)), key=lambda s: s.iteration)),
        best_iteration=integer("best_iteration"),
        result_iteration=integer("result_iteration"),
        stop_reason=record.get("stop_reason"),
        stop_detail=record.get("stop_detail"),
        error=load_error(record["error"]) if "error" in record else None,
        started_at=seconds("started_at"),
        finished_at=seconds("finished_at"),
        queue_position=position,
    )


def hash_of(job: Job) -> dict[str, str]:
    """Return the fields of a job as `job_of` reads them, but for revision and token, which the server gives."""
    texts = {
        "spec": dump_record(job.spec),
        "status": str(job.status),
        "attempt": str(job.attempt),
        "losses": str(job.losses),
        "queued_at": str(round(job.spec.created_at * 1000)),
        "metrics": dumps(job.metrics),
    }
    optional = {
        "progress": None if job.progress is None else dump_record(job.progress),
        "error": None if job.error is None else dump_record(job.error),
        "stop_reason": job.stop_reason,
        "stop_detail": job.stop_detail,
        "best_iteration": job.best_iteration,
        "result_iteration": job.result_iteration,
        "started_at": job.started_at,
        "finished_at": job.finished_at,
    }
    return texts | {name: str(value) for name, value in optional.items() if value is not None}


def fields_of(outcome: Outcome) -> list[str | int]:
    """Return field, value, field, value … of what an outcome says beside its status."""
    values = {
        "stop_reason": outcome.stop_reason,
        "stop_detail": outcome.stop_detail,
        "result_iteration": outcome.result_iteration,
        "best_iteration": outcome.best_iteration,
        "error": None if outcome.error is None else dump_record(outcome.error),
    }
    return [part for name, value in values.items() if value is not None for part in (name, value)]
