"""The record of one job in memory, and how it moves from one state to another."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final

from spherify.jobs.model import LEGAL_MOVES, Job, JobError, JobStatus, Outcome
from spherify.jobs.ports import Claim, ClaimOutcome, Kept

AT_WORK: Final = (JobStatus.RUNNING, JobStatus.CANCELLING)


@dataclass
class Entry:
    """A job with what its record holds beside; every move is checked against `LEGAL_MOVES`.

    Attributes:
        queued_at: when it was added, in seconds of the store's clock.
        rows: the time series by iteration.
        committed: token and outcome of the commit, for one that is repeated.
        sealed: whether a cancel comes too late.
        claimant: who may claim again and is told the same.
        claimed_at: since when the present attempt holds it.
        spent_s: how long all earlier attempts held it.

    """

    job: Job
    queued_at: float
    rows: dict[float, dict[str, float | int]] = field(default_factory=dict)
    committed: tuple[int, Outcome] | None = None
    sealed: bool = False
    claimant: str = ""
    claimed_at: float | None = None
    spent_s: float = 0.0

    @property
    def claimed(self) -> Claim:
        """What the present attempt is told."""
        job = self.job
        return Claim(ClaimOutcome.CLAIMED, job.token, self.spent_s, job.attempt, job.losses)

    def held(self, token: int) -> bool:
        """Whether the attempt of this token is the present one and still at work."""
        return self.job.status in AT_WORK and self.job.token == token

    def leased(self, now: float) -> bool:
        """Whether somebody holds it whose lease has not run out."""
        return self.job.lease_until is not None and self.job.lease_until > now

    def keep(self, kept: Kept) -> None:
        """Forget the snapshots and rows that are not among these."""
        snapshots = tuple(s for s in self.job.snapshots if s.iteration in kept.snapshots)
        self.job = replace(self.job, snapshots=snapshots)
        self.rows = {i: row for i, row in self.rows.items() if i in kept.rows}

    def hand_on(self, now: float) -> JobStatus:
        """Let it wait again, or end as cancelled if that was asked; returns the new state."""
        if self.job.status is JobStatus.CANCELLING:
            return self.move(JobStatus.CANCELLED, now, stop_reason="cancelled")
        return self.move(JobStatus.ACCEPTED, now)

    def lose(self, now: float, most: int) -> JobStatus:
        """Hand it on with a loss counted, or fail it when these are more than ``most``; returns the new state."""
        if self.job.status is JobStatus.CANCELLING:
            return self.hand_on(now)
        losses = self.job.losses + 1
        if losses > most:
            error = JobError("worker-lost", f"its worker was lost {losses} times")
            return self.move(JobStatus.FAILED, now, losses=losses, error=error)
        return self.move(JobStatus.ACCEPTED, now, losses=losses)

    def move(self, to: JobStatus, now: float, **changes: object) -> JobStatus:
        """Bring it to another state, and out of what the old one stood in; returns that state.

        Raises:
            AssertionError: there is no such arrow.

        """
        if to not in LEGAL_MOVES[self.job.status]:
            raise AssertionError(f"{self.job.status} → {to} is no legal move")
        if to.done:
            changes["finished_at"] = now
        if to not in AT_WORK:
            changes.update(lease_until=None, worker=None)
            self.sealed = False
            if self.claimed_at is not None:
                self.spent_s += now - self.claimed_at
                self.claimed_at = None
        self.job = replace(self.job, status=to, rev=self.job.rev + 1, **changes)  # type: ignore[arg-type] # fields of Job, checked by replace
        return to
