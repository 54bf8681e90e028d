"""``attempts/{token}.json``: what attempts at a job had cost when one more began, for the case that the record is lost.

How long that one lasted tell the files it left: it lived at least until the newest of them.
"""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import dataclass

from spherify.jobs import layout
from spherify.jobs.codec import dumps
from spherify.jobs.errors import BlobExistsError
from spherify.jobs.ports import BlobStore, Claim


@dataclass(frozen=True, slots=True)
class Account:
    """What the attempts at a job have cost.

    Attributes:
        token: the greatest that is known to have been given out.
        attempt: how many attempts there were.
        losses: how many of them lost their worker.
        spent_s: how long they held the job.

    """

    token: int = 0
    attempt: int = 0
    losses: int = 0
    spent_s: float = 0.0


def write_account(blobs: BlobStore, job_id: str, claim: Claim) -> None:
    """Keep what a claim tells; raises `StorageFullError`, `StoreUnavailableError`."""
    document = {"attempt": claim.attempt, "losses": claim.losses, "spent_s": claim.spent_s}
    with suppress(BlobExistsError):  # the claim was answered twice
        blobs.create(layout.account(job_id, claim.token), dumps(document).encode())


def read_account(blobs: BlobStore, job_id: str) -> Account:
    """Return what is known from the files of a job that has not ended."""
    kept = {layout.token_of(stat.key): stat for stat in blobs.list(layout.attempts(job_id))}
    prefixes = (layout.snapshots(job_id), layout.checkpoints(job_id))
    left = [(layout.numbers(stat.key)[0], stat.created_at) for p in prefixes for stat in blobs.list(p)]
    newest = max([*kept, *(token for token, _ in left)], default=0)
    if not kept:
        return Account(newest)
    last = max(kept)
    began = kept[last].created_at
    lived = max([at - began for token, at in left if token == last], default=0.0)
    data = json.loads(blobs.read(kept[last].key))
    return Account(newest, data["attempt"], data["losses"], data["spent_s"] + max(lived, 0.0))
