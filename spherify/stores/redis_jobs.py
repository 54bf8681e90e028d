"""The live records of jobs in a Redis-protocol server; every change of several keys is one script."""

from __future__ import annotations

import json
import logging
import uuid
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import redis

from spherify.jobs.codec import dump_record, dumps
from spherify.jobs.errors import (
    InvalidCursorError,
    JobGoneError,
    JobNotFinishedError,
    JobNotFoundError,
    JobsError,
    MeshNotFoundError,
    StoreUnavailableError,
)
from spherify.jobs.ids import earliest_job_id, is_job_id
from spherify.jobs.layout import TOMBSTONE_S
from spherify.jobs.model import Job, JobSpec, JobStatus, Outcome, Progress, Snapshot
from spherify.jobs.ports import CancelOutcome, Claim, ClaimOutcome, Kept, Page, Renewal
from spherify.stores import keys
from spherify.stores.client import Scripts, reachable
from spherify.stores.epoch import REBUILDING, complete_throughout, is_complete
from spherify.stores.records import fields_of, hash_of, job_of

log = logging.getLogger(__name__)

_CHUNK: Final = 100  # jobs read at a time once a filter has left some out
_JOBS_A_CALL: Final = 100  # the server does nothing else meanwhile
_SNAPSHOTS_A_CALL: Final = (
    1000  # no further job is read after so many: a job alone has at most as many, and two
)
_ROWS_A_CALL: Final = 500  # far below the stack of Lua's unpack, and a call stays short


class RedisJobStore:
    """A `spherify.jobs.ports.JobStore`; time is the server's, never a worker's."""

    def __init__(self, client: redis.Redis, *, lease_s: float = 30.0, max_losses: int = 3) -> None:
        self._client = client
        self._scripts = Scripts(client)
        self._lease_ms = round(lease_s * 1000)
        self._max_losses = max_losses

    def add(self, spec: JobSpec) -> Job:
        """Record and queue a new job, in one transaction; again changes nothing. Raises `MeshNotFoundError`."""
        more_keys = [keys.gone(spec.id), keys.mesh(spec.mesh_id), keys.EPOCH]
        answer = self._run("add", spec.id, [dump_record(spec), *_indexes(spec)], more_keys=more_keys)
        if answer == "incomplete":
            raise StoreUnavailableError(REBUILDING)
        if answer == "no-mesh":
            raise MeshNotFoundError(f"there is no mesh {spec.mesh_id}")
        return self.get(spec.id)

    def get(self, job_id: str, known: Job | None = None) -> Job:
        """Return one job, ``known`` itself if it is still the same; raises `JobNotFoundError`, `JobGoneError`."""
        found = self.get_all({job_id: known})[job_id]
        if isinstance(found, JobsError):
            raise found
        return found

    def get_all(self, known: Mapping[str, Job | None]) -> dict[str, Job | JobsError]:
        """Return these jobs, or why one is not there; each that is known and still the same as it was given.

        One round trip for so many of them, and for so many snapshots; what is known already is neither sent nor read
        again.
        """
        found: dict[str, Job | JobsError] = {}
        left = list(known)
        while left:
            part = left[:_JOBS_A_CALL]
            names = [name for i in part for name in (keys.job(i), keys.snapshots(i), keys.gone(i))]
            args = [arg for i in part for arg in (i, _revision(known[i], i))]
            answers = self._scripts(
                "read", [keys.QUEUED, keys.EPOCH, *names], [_SNAPSHOTS_A_CALL, *args], common=False
            )
            found |= {i: _as_found(i, known[i], answer) for i, answer in zip(part, answers, strict=False)}
            left = left[len(answers) :]
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
        index = (
            keys.BY_MESH + mesh_id if mesh_id is not None
            else keys.BY_TAG + tag if tag is not None
            else keys.BY_STATUS + status if status is not None
            else keys.JOBS
        )  # fmt: skip
        since = "-" if created_after is None else f"[{earliest_job_id(created_after)}"
        found: list[Job] = []
        with complete_throughout(self._client):
            for job in self._walk(index, since, "+" if cursor is None else f"({cursor}", limit + 1):
                if (
                    (status is None or job.status is status)
                    and (tag is None or tag in job.spec.tags)
                    and (created_after is None or job.spec.created_at > created_after)
                ):
                    found.append(job)
                    if len(found) > limit:
                        return Page(tuple(found[:limit]), found[limit - 1].id)
            return Page(tuple(found), None)

    def metrics(self, job_id: str) -> list[dict[str, float | int]]:
        """Return the recorded time series, ascending by ``iteration``; raises as `get` does."""
        while True:
            with reachable(), self._client.pipeline(transaction=True) as pipe:
                pipe.exists(keys.job(job_id))
                pipe.hvals(keys.rows(job_id))
                known, rows = pipe.execute()
            if known:
                return sorted(map(_loads, rows), key=lambda row: row["iteration"])
            self.get(job_id)  # which says why it is not there, unless it has just come back

    def delete(self, job_id: str) -> None:
        """Forget a terminal job, leaving a tombstone; raises `JobNotFinishedError`, `JobNotFoundError`."""
        job = self.get(job_id)
        answer = self._run(
            "delete",
            job_id,
            [TOMBSTONE_S, *_indexes(job.spec)],
            more_keys=[keys.gone(job_id), keys.rows(job_id), keys.snapshots(job_id)],
        )
        if answer == "not-finished":
            raise JobNotFinishedError(f"{job_id} is not finished: cancel it first")

    def request_cancel(self, job_id: str) -> CancelOutcome:
        """Cancel a job that nobody ever held at once, or flag any other."""
        answer = self._run("cancel", job_id, [], more_keys=[keys.EPOCH])
        if answer == "incomplete":
            raise StoreUnavailableError(REBUILDING)
        return CancelOutcome(answer)

    def claim(self, job_id: str, worker: str, claimant: str = "", *, to_end: bool = False) -> Claim:
        """Take the lease and the next fencing token; the same ones again for a claimant who did not hear the answer."""
        outcome, token, spent_ms, attempt, losses = self._run(
            "claim", job_id, [worker, self._lease_ms, self._max_losses, claimant, int(to_end)]
        )
        return Claim(ClaimOutcome(outcome), int(token), int(spent_ms) / 1000, int(attempt), int(losses))

    def renew(self, job_id: str, token: int) -> Renewal:
        """Extend the lease, and learn whether to go on."""
        return Renewal(self._run("renew", job_id, [token, self._lease_ms]))

    def report(
        self,
        job_id: str,
        token: int,
        progress: Progress,
        rows: Sequence[Mapping[str, float | int]] = (),
    ) -> bool:
        """Record progress and new rows of the time series (each with ``iteration``), idempotently."""
        for start in range(0, max(len(rows), 1), _ROWS_A_CALL):
            part = rows[start : start + _ROWS_A_CALL]
            newest = {k: v for k, v in part[-1].items() if k != "iteration"} if part else None
            args = [token, dump_record(progress), "" if newest is None else dumps(newest)]
            for row in part:
                args += [row["iteration"], dumps(dict(row))]
            if not self._run("report", job_id, args, more_keys=[keys.rows(job_id)]):
                return False
        return True

    def add_snapshot(self, job_id: str, token: int, snapshot: Snapshot) -> bool:
        """Publish a snapshot whose file is durable."""
        args = [token, snapshot.iteration, dump_record(snapshot)]
        return bool(self._run("snapshot", job_id, args, more_keys=[keys.snapshots(job_id)]))

    def release(self, job_id: str, token: int) -> bool:
        """Hand a job on without counting a loss, next in the queue; whether it is to be sent again."""
        return bool(self._run("release", job_id, [token, self._max_losses]) == JobStatus.ACCEPTED)

    def disown(self, job_id: str, token: int, kept: Kept) -> bool:
        """Forget what former attempts told but for this: the present one does not go on from the rest."""
        more_keys = [keys.snapshots(job_id), keys.rows(job_id)]
        return bool(self._run("disown", job_id, [token, _named(kept)], more_keys=more_keys))

    def lose(self, job_id: str, token: int) -> bool:
        """Give a job up whose runner died, counting a loss; whether it is to be sent again."""
        return bool(self._run("lose", job_id, [token, self._max_losses, 1]) == JobStatus.ACCEPTED)

    def seal(self, job_id: str, token: int) -> Renewal:
        """Learn a last time whether to end as cancelled; from then on a cancel comes too late."""
        return Renewal(self._run("seal", job_id, [token]))

    def commit(self, job_id: str, token: int, outcome: Outcome, kept: Kept | None = None) -> bool:
        """End a job, once, with the snapshots and rows kept only; the same again is True and changes nothing."""
        stay = "" if kept is None else _named(kept)
        args = [token, outcome.status, dump_record(outcome), stay, *fields_of(outcome)]
        more_keys = [keys.snapshots(job_id), keys.rows(job_id)]
        return bool(self._run("commit", job_id, args, more_keys=more_keys))

    def lost(self, limit: int | None = None, *, counted: bool = True) -> list[str]:
        """Free jobs whose lease ran out, the longest first; returns those to be sent again.

        Each is a loss, unless no worker is to blame and none is counted. Those to be ended stay `overdue`.
        """
        lost = []
        for job_id in self._until(keys.LEASES, 0, limit):
            try:
                if self._run("lose", job_id, ["", self._max_losses, int(counted)]) == JobStatus.ACCEPTED:
                    lost.append(job_id)
            except redis.ResponseError:  # a record of another form: its trouble is not the others'
                log.exception("its record cannot be read", extra={"job_id": job_id, "action": "lost"})
        return lost

    def overdue(self, limit: int | None = None) -> list[str]:
        """Return jobs whose lease ran out, the longest first."""
        return self._until(keys.LEASES, 0, limit)

    def waiting(self, older_than_s: float, limit: int | None = None) -> list[str]:
        """Return accepted jobs queued for longer than that, oldest first."""
        return self._until(keys.QUEUED, older_than_s, limit)

    def unsettled(self, limit: int | None = None, *, after: str = "") -> list[str]:
        """Return ended and deleted jobs whose files are not in their last state yet, by id."""
        with reachable():
            return self._client.zrangebylex(keys.UNSETTLED, f"({after}", "+", 0, _count(limit))  # type: ignore[return-value] # client is not async

    def settled(self, job_id: str, *, deleted: bool) -> bool:
        """Take a job off `unsettled`, as a deleted or an ended one; False if it is not that any more."""
        return bool(self._run("settled", job_id, ["deleted" if deleted else "ended"]))

    def counts(self) -> dict[JobStatus, int]:
        """Return how many jobs are in each state."""
        with reachable(), self._client.pipeline(transaction=True) as pipe:
            for status in JobStatus:
                pipe.zcard(keys.BY_STATUS + status)
            return dict(zip(JobStatus, pipe.execute(), strict=True))

    def ping(self) -> None:
        """Raise `StoreUnavailableError` unless the server answers, and the records are all there."""
        if not self.complete():
            raise StoreUnavailableError(REBUILDING)

    def complete(self) -> bool:
        """Whether the records are all there, as far as the server knows."""
        return is_complete(self._client)

    def begin_rebuild(self) -> str:
        """Return the name of the rebuild that is under way, a new one if none is."""
        with reachable(), self._client.pipeline(transaction=True) as pipe:
            pipe.set(keys.REBUILD, uuid.uuid4().hex, nx=True)
            pipe.get(keys.REBUILD)
            return str(pipe.execute()[1])

    def end_rebuild(self, name: str) -> bool:
        """Declare the records complete; False if they were lost once more since that rebuild began."""
        return bool(self._scripts("rebuilt", [keys.REBUILD, keys.EPOCH], [name], common=False))

    def era(self) -> str:
        """Return the name of the rebuild after which all records were there, or of the one under way; "" if none is."""
        with reachable():
            ended, under_way = self._client.mget(keys.EPOCH, keys.REBUILD)
        return str(ended or under_way or "")

    def unknown(self, job_ids: Sequence[str]) -> list[str]:
        """Return those of which there is neither a record nor a tombstone."""
        with reachable(), self._client.pipeline(transaction=False) as pipe:
            for job_id in job_ids:
                pipe.exists(keys.job(job_id), keys.gone(job_id))
            return [job_id for job_id, found in zip(job_ids, pipe.execute(), strict=True) if not found]

    def restore(
        self, job: Job, rows: Sequence[Mapping[str, float | int]], *, spent_s: float = 0.0, era: str = ""
    ) -> bool:
        """Record a job again; token and revision begin beyond all earlier ones. False if it is known, or deleted."""
        args = [
            dumps(hash_of(job) | {"spent": str(round(spent_s * 1000))}),
            dumps({str(row["iteration"]): dumps(dict(row)) for row in rows}),
            dumps({str(snapshot.iteration): dump_record(snapshot) for snapshot in job.snapshots}),
            job.token + 1,
            era,
            *_indexes(job.spec),
        ]
        more_keys = [keys.gone(job.id), keys.rows(job.id), keys.snapshots(job.id), keys.REBUILD, keys.EPOCH]
        return bool(self._run("restore", job.id, args, more_keys=more_keys))

    def bury(self, job_id: str, seconds: float) -> None:
        """Leave the tombstone of a job that was deleted, for so long."""
        with reachable():
            self._client.set(keys.gone(job_id), "1", ex=max(round(seconds), 1))

    def _until(self, index: str, ago_s: float, limit: int | None) -> list[str]:
        """Return the ids of an index by time whose moment was that long ago, by the server's clock."""
        with reachable():
            seconds, microseconds = self._client.time()
            till = seconds * 1000 + microseconds // 1000 - round(ago_s * 1000)
            return self._client.zrangebyscore(index, "-inf", till, 0, _count(limit))  # type: ignore[return-value] # client is not async

    def _run(self, name: str, job_id: str, args: list[Any], *, more_keys: Sequence[str] = ()) -> Any:  # noqa: ANN401
        record = [keys.job(job_id), keys.QUEUED, keys.LEASES, keys.UNSETTLED, keys.BY_STATUS]
        return self._scripts(name, [*record, *more_keys], [job_id, *args])

    def _walk(self, index: str, since: str, before: str, at_first: int) -> Iterator[Job]:
        """Yield the jobs of an index, newest first; one that is deleted meanwhile is left out.

        So many are read ``at_first``, which is all if no filter leaves one out, and then more at a time.
        """
        at_once = at_first
        while True:
            with reachable():
                ids: list[str] = self._client.zrevrangebylex(index, before, since, 0, at_once)  # type: ignore[assignment] # client is not async
            for job in self.get_all(dict.fromkeys(ids)).values():
                if isinstance(job, Job):
                    yield job
                elif isinstance(job, StoreUnavailableError):
                    raise job
            if len(ids) < at_once:
                return
            before, at_once = f"({ids[-1]}", _CHUNK


def _named(kept: Kept) -> str:
    """Return the iterations that stay as the scripts read them."""
    return dumps([[str(i) for i in kept.snapshots], [str(i) for i in kept.rows]])


def _revision(known: Job | None, job_id: str) -> int | str:
    return known.rev if known is not None and known.id == job_id else ""


def _as_found(job_id: str, known: Job | None, answer: Any) -> Job | JobsError:  # noqa: ANN401 (the script's)
    """Return what the script found of one job."""
    if answer is None:
        return JobNotFoundError(f"there is no job {job_id}")
    if answer == 0:
        return StoreUnavailableError(REBUILDING)
    if answer == 1:
        return JobGoneError(f"{job_id} was deleted")
    _, position, *rest = answer
    if rest:
        fields, snapshots = rest
        return job_of(dict(zip(fields[::2], fields[1::2], strict=True)), snapshots, position)
    assert known is not None  # noqa: S101 (or its revision could not be the same)
    return known if known.queue_position == position else replace(known, queue_position=position)


def _count(limit: int | None) -> int:
    return -1 if limit is None else limit  # as the server counts


def _loads(row: str) -> dict[str, float | int]:
    loaded: dict[str, float | int] = json.loads(row)
    return loaded


def _indexes(spec: JobSpec) -> list[str]:
    return [keys.JOBS, keys.BY_MESH + spec.mesh_id, *(keys.BY_TAG + tag for tag in dict.fromkeys(spec.tags))]
