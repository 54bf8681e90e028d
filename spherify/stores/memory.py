"""Twins of the adapters in memory, for tests of what stands on them; the same contract suite runs against both."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from spherify.jobs.errors import (
    InvalidCursorError,
    JobGoneError,
    JobNotFinishedError,
    JobNotFoundError,
    JobsError,
    MeshNotFoundError,
    NotFoundError,
)
from spherify.jobs.ids import is_job_id
from spherify.jobs.model import (
    Job,
    JobSpec,
    JobStatus,
    MeshRecord,
    Outcome,
    Progress,
    Snapshot,
)
from spherify.jobs.ports import CancelOutcome, Claim, ClaimOutcome, Kept, Page, Renewal
from spherify.stores.memory_entry import AT_WORK, Entry


class MemoryJobStore:
    """Job records in a dictionary under one lock."""

    def __init__(
        self, *, lease_s: float = 30.0, max_losses: int = 3, clock: Callable[[], float] = time.time
    ) -> None:
        self._entries: dict[str, Entry] = {}
        self._gone: set[str] = set()
        self._unsettled: set[str] = set()
        self.meshes: dict[str, MeshRecord] = {}
        self._complete = True
        self._lock = threading.RLock()
        self._lease_s = lease_s
        self._max_losses = max_losses
        self._clock = clock

    def add(self, spec: JobSpec) -> Job:
        """Record and queue a new job; again changes nothing. Raises `MeshNotFoundError`."""
        with self._lock:
            if spec.id not in self._entries and spec.id not in self._gone:
                if spec.mesh_id not in self.meshes:
                    raise MeshNotFoundError(f"there is no mesh {spec.mesh_id}")
                self._entries[spec.id] = Entry(Job(spec), self._clock())
            return self.get(spec.id)

    def get(self, job_id: str, known: Job | None = None) -> Job:
        """Return one job; raises `JobNotFoundError`, or `JobGoneError` after a delete."""
        with self._lock:
            entry = self._entries.get(job_id)
            if entry is None:
                gone = job_id in self._gone
                raise (
                    JobGoneError(f"{job_id} was deleted")
                    if gone
                    else JobNotFoundError(f"there is no job {job_id}")
                )
            job = entry.job
            if job.status is JobStatus.ACCEPTED:
                job = replace(job, queue_position=self.waiting(0).index(job_id))
            return known if known == job else job

    def get_all(self, known: Mapping[str, Job | None]) -> dict[str, Job | JobsError]:
        """Return these jobs, or why one is not there; each that is known and still the same as it was given."""
        found: dict[str, Job | JobsError] = {}
        with self._lock:
            for job_id, job in known.items():
                try:
                    found[job_id] = self.get(job_id, job)
                except NotFoundError as e:
                    found[job_id] = e
        return found

    def find(
        self,
        *,
        status: JobStatus | None = None,
        tag: str | None = None,
        mesh_id: str | None = None,
        created_after: float | None = None,
        limit: int = 50,
        cursor: str | None = None,
    ) -> Page[Job]:
        """Return a page of jobs, newest first; raises `InvalidCursorError`."""
        if cursor is not None and not is_job_id(cursor):
            raise InvalidCursorError(f"{cursor!r} is no cursor of this listing")
        with self._lock:
            jobs = [self.get(job_id) for job_id in sorted(self._entries, reverse=True)]
        found = [
            job
            for job in jobs
            if (cursor is None or job.id < cursor)
            and (status is None or job.status is status)
            and (tag is None or tag in job.spec.tags)
            and (mesh_id is None or job.spec.mesh_id == mesh_id)
            and (created_after is None or job.spec.created_at > created_after)
        ]
        return Page(tuple(found[:limit]), found[limit - 1].id if len(found) > limit else None)

    def metrics(self, job_id: str) -> list[dict[str, float | int]]:
        """Return the recorded time series, ascending by ``iteration``; raises as `get` does."""
        with self._lock:
            self.get(job_id)
            return [row for _, row in sorted(self._entries[job_id].rows.items())]

    def delete(self, job_id: str) -> None:
        """Forget a terminal job, leaving a tombstone; raises `JobNotFinishedError`, `JobNotFoundError`."""
        with self._lock:
            if not self.get(job_id).status.done:
                raise JobNotFinishedError(f"{job_id} is not finished: cancel it first")
            del self._entries[job_id]
            self._gone.add(job_id)
            self._unsettled.add(job_id)

    def request_cancel(self, job_id: str) -> CancelOutcome:
        """Cancel a job that nobody ever held at once, or flag any other."""
        with self._lock:
            entry = self._entries.get(job_id)
            if entry is None:
                return CancelOutcome.UNKNOWN
            if entry.job.status is JobStatus.ACCEPTED and entry.job.token == 0:
                self._move(entry, JobStatus.CANCELLED, stop_reason="cancelled")
            elif entry.job.status is JobStatus.ACCEPTED:
                token = entry.job.token + 1
                self._move(entry, JobStatus.CANCELLING, token=token, lease_until=self._clock())
            elif entry.job.status is JobStatus.RUNNING and not (entry.sealed and entry.leased(self._clock())):
                self._move(entry, JobStatus.CANCELLING)
            return {
                JobStatus.CANCELLED: CancelOutcome.CANCELLED,
                JobStatus.CANCELLING: CancelOutcome.CANCELLING,
            }.get(entry.job.status, CancelOutcome.FINISHED)

    def claim(self, job_id: str, worker: str, claimant: str = "", *, to_end: bool = False) -> Claim:
        """Take the lease and the next fencing token; the same ones again for a claimant who did not hear the answer."""
        with self._lock:
            entry, now, most = self._entries.get(job_id), self._clock(), self._max_losses
            if entry is None or entry.job.status.done:
                return Claim(ClaimOutcome.DONE)
            if entry.leased(now):
                if not claimant or entry.claimant != claimant:
                    return Claim(ClaimOutcome.LEASED)
                entry.job = replace(entry.job, lease_until=now + self._lease_s)
                return entry.claimed(most)
            if to_end and entry.job.status is JobStatus.ACCEPTED:
                return Claim(ClaimOutcome.DONE)
            if to_end and not entry.ending(most):
                return Claim(ClaimOutcome.LEASED)
            entry.take(worker, claimant, now, now + self._lease_s, most)
            return entry.claimed(most)

    def renew(self, job_id: str, token: int) -> Renewal:
        """Extend the lease, and learn whether to go on."""
        with self._lock:
            entry = self._held(job_id, token)
            if entry is None:
                return Renewal.FENCED
            entry.job = replace(entry.job, lease_until=self._clock() + self._lease_s)
            return Renewal.CANCEL if entry.job.status is JobStatus.CANCELLING else Renewal.HELD

    def report(
        self,
        job_id: str,
        token: int,
        progress: Progress,
        rows: Sequence[Mapping[str, float | int]] = (),
    ) -> bool:
        """Record progress and new rows of the time series (each with ``iteration``), idempotently."""
        with self._lock:
            entry = self._held(job_id, token)
            if entry is None:
                return False
            entry.rows.update({row["iteration"]: dict(row) for row in rows})
            newest = {k: v for k, v in rows[-1].items() if k != "iteration"} if rows else entry.job.metrics
            entry.job = replace(entry.job, progress=progress, metrics=newest, rev=entry.job.rev + 1)
            return True

    def add_snapshot(self, job_id: str, token: int, snapshot: Snapshot) -> bool:
        """Publish a snapshot whose file is durable."""
        with self._lock:
            entry = self._held(job_id, token)
            if entry is None:
                return False
            kept = {s.iteration: s for s in (*entry.job.snapshots, snapshot)}
            ascending = tuple(kept[i] for i in sorted(kept))
            entry.job = replace(entry.job, snapshots=ascending, rev=entry.job.rev + 1)
            return True

    def release(self, job_id: str, token: int) -> bool:
        """Hand a job on without counting a loss, next in the queue; whether it is to be sent again."""
        with self._lock:
            entry = self._held(job_id, token)
            return entry is not None and self._hand_on(entry, 0)

    def disown(self, job_id: str, token: int, kept: Kept) -> bool:
        """Forget what former attempts told but for this: the present one does not go on from the rest."""
        with self._lock:
            entry = self._held(job_id, token)
            if entry is None:
                return False
            entry.keep(kept)
            entry.job = replace(entry.job, rev=entry.job.rev + 1)
            return True

    def lose(self, job_id: str, token: int) -> bool:
        """Give a job up whose runner died, counting a loss; whether it is to be sent again."""
        with self._lock:
            entry = self._held(job_id, token)
            return entry is not None and self._hand_on(entry, 1)

    def seal(self, job_id: str, token: int) -> Renewal:
        """Learn a last time whether to end as cancelled; from then on a cancel comes too late."""
        with self._lock:
            entry = self._held(job_id, token)
            if entry is None:
                return Renewal.FENCED
            if entry.job.status is JobStatus.CANCELLING:
                return Renewal.CANCEL
            entry.sealed = True
            return Renewal.HELD

    def commit(self, job_id: str, token: int, outcome: Outcome, kept: Kept | None = None) -> bool:
        """End a job, once, with the snapshots and rows kept only; the same again is True and changes nothing."""
        with self._lock:
            entry = self._entries.get(job_id)
            if entry is not None and entry.committed == (token, outcome):
                return True
            entry = self._held(job_id, token)
            if entry is None or (kept is not None and not entry.told(kept)):
                return False
            entry.committed = (token, outcome)
            if kept is not None:
                entry.keep(kept)
            self._move(
                entry,
                outcome.status,
                stop_reason=outcome.stop_reason,
                stop_detail=outcome.stop_detail,
                error=outcome.error,
                result_iteration=outcome.result_iteration,
                best_iteration=outcome.best_iteration,
            )
            return True

    def lost(self, limit: int | None = None, *, counted: bool = True) -> list[str]:
        """Free jobs whose lease ran out, the longest first; returns those to be sent again.

        Each is a loss, unless no worker is to blame and none is counted. Those to be ended stay `overdue`.
        """
        with self._lock:
            overdue = self.overdue(limit)
            return [job_id for job_id in overdue if self._hand_on(self._entries[job_id], int(counted))]

    def overdue(self, limit: int | None = None) -> list[str]:
        """Return jobs whose lease ran out, the longest first."""
        with self._lock:
            overdue = [
                entry
                for entry in self._entries.values()
                if entry.job.status in AT_WORK and not entry.leased(self._clock())
            ]
            overdue.sort(key=lambda entry: entry.job.lease_until or 0.0)
            return [entry.job.id for entry in overdue[:limit]]

    def waiting(self, older_than_s: float, limit: int | None = None) -> list[str]:
        """Return accepted jobs queued for longer than that, oldest first."""
        with self._lock:
            till = self._clock() - older_than_s
            old = [
                (e.queued_at, i)
                for i, e in self._entries.items()
                if e.job.status is JobStatus.ACCEPTED and e.queued_at <= till
            ]
            return [job_id for _, job_id in sorted(old)][:limit]

    def unsettled(self, limit: int | None = None, *, after: str = "") -> list[str]:
        """Return ended and deleted jobs whose files are not in their last state yet, by id."""
        with self._lock:
            return sorted(job_id for job_id in self._unsettled if job_id > after)[:limit]

    def settled(self, job_id: str, *, deleted: bool) -> bool:
        """Take a job off `unsettled`, as a deleted or an ended one; False if it is not that any more."""
        with self._lock:
            if deleted is (job_id in self._entries):
                return False
            self._unsettled.discard(job_id)
            return True

    def counts(self) -> dict[JobStatus, int]:
        """Return how many jobs are in each state."""
        with self._lock:
            states = [entry.job.status for entry in self._entries.values()]
            return {status: states.count(status) for status in JobStatus}

    def ping(self) -> None:
        """Return: memory always answers."""

    def complete(self) -> bool:
        """Whether the records are all there."""
        return self._complete

    def begin_rebuild(self) -> str:
        """Return the name of the rebuild."""
        return "rebuild"

    def end_rebuild(self, name: str) -> bool:
        """Declare the records complete."""
        self._complete = name == "rebuild"
        return self._complete

    def era(self) -> str:
        """Return the name of the rebuild."""
        return "rebuild"

    def unknown(self, job_ids: Sequence[str]) -> list[str]:
        """Return those of which there is neither a record nor a tombstone."""
        with self._lock:
            return [i for i in job_ids if i not in self._entries and i not in self._gone]

    def restore(
        self, job: Job, rows: Sequence[Mapping[str, float | int]], *, spent_s: float = 0.0, era: str = ""
    ) -> bool:
        """Record a job again; token and revision begin beyond all earlier ones. False if it is known, or deleted."""
        with self._lock:
            if not self.unknown([job.id]) or era not in {"", self.era()}:
                return False
            fresh = max(round(self._clock() * 1000), job.token + 1)
            entry = Entry(replace(job, token=fresh, rev=fresh), job.spec.created_at)
            entry.rows.update({row["iteration"]: dict(row) for row in rows})
            entry.spent_s = spent_s
            self._entries[job.id] = entry
            if job.status.done:
                self._unsettled.add(job.id)
            return True

    def bury(self, job_id: str, seconds: float) -> None:
        """Leave the tombstone of a job that was deleted; here for good."""
        if seconds > 0:
            self._gone.add(job_id)

    def _held(self, job_id: str, token: int) -> Entry | None:
        entry = self._entries.get(job_id)
        return entry if entry is not None and entry.held(token) else None

    def _hand_on(self, entry: Entry, more: int) -> bool:
        return entry.hand_on(self._clock(), self._max_losses, more) is JobStatus.ACCEPTED

    def _move(self, entry: Entry, to: JobStatus, **changes: object) -> None:
        entry.move(to, self._clock(), **changes)
        if to.done:
            self._unsettled.add(entry.job.id)
