"""``attempts/{token}.json``: what attempts at a job had cost when one more began, for the case that the record is lost.

How long that attempt itself lasted is read from the files it left: at least until the newest of them.
"""

from __future__ import annotations

import json
import logging
from dataclasses import dataclass, replace

from spherify.jobs import layout
from spherify.jobs.codec import dumps
from spherify.jobs.errors import (
    BlobExistsError,
    BlobNotFoundError,
    DamagedBlobError,
    StoreUnavailableError,
)
from spherify.jobs.ports import BlobStat, BlobStore, Claim

log = logging.getLogger(__name__)


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
    """Keep what a claim tells: once, by which it is known that no other attempt has this token.

    Raises:
        StorageFullError: it is not kept.
        StoreUnavailableError: or an older copy of the record gave the token out again; the next one is another.

    """
    document = {"attempt": claim.attempt, "losses": claim.losses, "spent_s": claim.spent_s}
    try:
        blobs.create(layout.account(job_id, claim.token), dumps(document).encode())
    except BlobExistsError as e:
        told = f"token {claim.token} was another attempt's, before an older copy of the record was put back"
        raise StoreUnavailableError(told) from e


def read_account(blobs: BlobStore, job_id: str) -> Account:
    """Return what is known from the files of a job that has not ended."""

    def numbered(prefix: str) -> list[BlobStat]:
        return list(layout.numbered_only(blobs.list(prefix)))

    kept = {layout.token_of(stat.key): stat for stat in numbered(layout.attempts(job_id))}
    states = numbered(layout.snapshots(job_id)) + numbered(layout.checkpoints(job_id))
    left = [(layout.numbers(stat.key)[0], stat.created_at) for stat in states]
    newest = max([*kept, *(token for token, _ in left)], default=0)
    for token, stat in sorted(kept.items(), reverse=True):
        if (account := _read(blobs, stat.key)) is not None:
            lived = max((at - stat.created_at for other, at in left if other == token), default=0.0)
            return replace(account, token=newest, spent_s=account.spent_s + max(lived, 0.0))
    return Account(newest)


def _read(blobs: BlobStore, key: str) -> Account | None:
    """Return what is written; None if it is damaged, for a job is worth more than the count of its attempts."""
    try:
        data = json.loads(blobs.read(key))
        return Account(0, int(data["attempt"]), int(data["losses"]), float(data["spent_s"]))
    except (BlobNotFoundError, DamagedBlobError, ValueError, LookupError, TypeError) as e:
        log.warning("%s is passed over: %s", key, e, extra={"action": "account"})
        return None
