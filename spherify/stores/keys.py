"""Every key in the server: what it holds, how long it lives, and what bounds its size.

All begin with ``spherify:``, so that a server may be shared. "Of a job" means: until the job is deleted.
One primary only: scripts build the names of index keys, which a Redis cluster does not allow (Celery's
transport does not work there either).
"""

from __future__ import annotations

from typing import Final

PREFIX: Final = "spherify:"

JOBS: Final = PREFIX + "jobs"
"""Sorted set of all job ids, score 0: ids sort by time. One entry a job."""

QUEUED: Final = PREFIX + "jobs:queued"
"""Sorted set: id → milliseconds at which it was queued. One entry an accepted job."""

LEASES: Final = PREFIX + "jobs:leases"
"""Sorted set: id → milliseconds at which the lease ends. One entry a running or cancelling job."""

UNSETTLED: Final = PREFIX + "jobs:unsettled"
"""Sorted set: ids of ended or deleted jobs whose files are not in their last state, score 0. Empty after a scan."""

BY_STATUS: Final = PREFIX + "jobs:status:"
"""+ status: sorted set of ids, score 0. Six keys, one entry a job altogether."""

BY_TAG: Final = PREFIX + "jobs:tag:"
"""+ tag: sorted set of ids, score 0. Of its last job."""

BY_MESH: Final = PREFIX + "jobs:mesh:"
"""+ mesh id: sorted set of the ids of jobs that name it, score 0. Of its last job."""

MESHES: Final = PREFIX + "meshes"
"""Sorted set: mesh id → seconds of creation. One entry a mesh."""

EPOCH: Final = PREFIX + "epoch"
"""Name of the rebuild after which all records were there. Missing: they were lost with the server, or it is new."""

REBUILD: Final = PREFIX + "rebuild"
"""Name of the rebuild under way; gone with the records, so that a second loss within it is noticed."""

LEADER: Final = PREFIX + "leader"
"""Name of the process that reconciles; lives three scans unless renewed."""

WORKER: Final = PREFIX + "worker:"
"""+ node name: sign of life of a worker, 15 s unless renewed."""

QUEUE: Final = "spherify.jobs"
"""List of Celery messages, written and read by kombu, of jobs that were begun before: taken first. Celery's name of
the queue. One entry a job that waits again."""

QUEUE_USUAL: Final = QUEUE + "\x06\x161"
"""The same of all others, named by kombu: separator, and priority 1. One entry a waiting job."""

UNACKED: Final = PREFIX + "unacked"
"""Hash of kombu: delivery tag → message that a worker holds. One entry a running job."""

UNACKED_INDEX: Final = PREFIX + "unacked_index"
"""Sorted set of kombu: delivery tag → seconds of delivery, from which the visibility timeout counts."""

UNACKED_MUTEX: Final = PREFIX + "unacked_mutex"
"""Lock of kombu's sweep."""


def job(job_id: str) -> str:
    """Hash: the record, see `spherify.stores.records`. Of a job; bounded by the size of its spec."""
    return f"{PREFIX}job:{job_id}"


def rows(job_id: str) -> str:
    """Hash: iteration → figures (JSON). Of a job; at most some 600 rows and one a snapshot."""
    return f"{PREFIX}job:{job_id}:rows"


def snapshots(job_id: str) -> str:
    """Hash: iteration → snapshot (JSON). Of a job; at most 1000 planned ones, the best, and the last."""
    return f"{PREFIX}job:{job_id}:snapshots"


def gone(job_id: str) -> str:
    """Tombstone of a deleted job, 30 days."""
    return f"{PREFIX}gone:{job_id}"


def mesh(mesh_id: str) -> str:
    """Record of a mesh (JSON). Until it is deleted; bounded by its report."""
    return f"{PREFIX}mesh:{mesh_id}"


def repeat(key: str) -> str:
    """Hash: what is kept of a request under its Idempotency-Key: fingerprint, identity, answer. One day."""
    return f"{PREFIX}repeat:{key}"
