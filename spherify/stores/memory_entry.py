"""The record of one job in memory, and how it moves from one state to another."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final

from spherify.jobs.model import LEGAL_MOVES, Job, JobStatus, Outcome
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

    def claimed(self, most: int) -> Claim:
        """Return what whoever holds it is told."""
        job = self.job
        outcome = ClaimOutcome.ENDING if self.ending(most) else ClaimOutcome.CLAIMED
        return Claim(outcome, job.token, self.spent_s, job.attempt, job.losses)

    def ending(self, most: int) -> bool:
        """Whether it is not to be computed any more: to be cancelled, or lost more often than that."""
        return self.job.status is JobStatus.CANCELLING or self.job.losses > most

    def held(self, token: int) -> bool:
        """Whether the attempt of this token is the present one and still at work."""
        return self.job.status in AT_WORK and self.job.token == token

    def leased(self, now: float) -> bool:
        """Whether somebody holds it whose lease has not run out."""
        return self.job.lease_until is not None and self.job.lease_until > now

    def told(self, kept: Kept) -> bool:
        """Whether it knows all of these."""
        snapshots = {snapshot.iteration for snapshot in self.job.snapshots}
        return kept.snapshots <= snapshots and kept.rows <= self.rows.keys()

    def keep(self, kept: Kept) -> None:
        """Forget the snapshots and rows that are not among these."""
        snapshots = tuple(s for s in self.job.snapshots if s.iteration in kept.snapshots)
        self.job = replace(self.job, snapshots=snapshots)
        self.rows = {i: row for i, row in self.rows.items() if i in kept.rows}

    def take(self, worker: str, claimant: str, now: float, lease_until: float, most: int) -> None:
        """Give it to whoever claims it, with a loss counted if somebody held it; an attempt unless it is `ending`."""
        if self.job.status is JobStatus.RUNNING and not self.ending(most):
            self.job = replace(self.job, losses=self.job.losses + 1)
        self._let_go(now)
        job = self.job
        if not self.ending(most):
            job = replace(job, attempt=job.attempt + 1, started_at=job.started_at or now)
        to = JobStatus.CANCELLING if job.status is JobStatus.CANCELLING else JobStatus.RUNNING
        self.job = replace(
            job, status=to, rev=job.rev + 1, token=job.token + 1, worker=worker, lease_until=lease_until
        )
        self.claimant, self.claimed_at = claimant, now

    def hand_on(self, now: float, most: int, more: int) -> JobStatus:
        """Let it wait again, or, if it is `ending`, leave it without a lease; the new state.

        Args:
            now: by the store's clock.
            most: losses that it may have.
            more: how many this is: 1, or 0 if nobody is to blame.

        """
        if more > 0 and not self.ending(most):
            job = self.job  # whose worker may only have slept: it is fenced
            self.job = replace(job, losses=job.losses + more, token=job.token + 1, rev=job.rev + 1)
        if self.ending(most):
            self.job = replace(self.job, lease_until=now)
            return self.job.status
        return self.move(JobStatus.ACCEPTED, now)

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
            self._let_go(now)
        self.job = replace(self.job, status=to, rev=self.job.rev + 1, **changes)  # type: ignore[arg-type] # fields of Job, checked by replace
        return to

    def _let_go(self, now: float) -> None:
        self.job = replace(self.job, lease_until=None, worker=None)
        self.sealed = False
        if self.claimed_at is not None:
            self.spent_s += now - self.claimed_at
            self.claimed_at = None
