"""What the jobs need from the world, as protocols; `spherify.stores` implements them.

The contract suite in tests/stores runs against every implementation. Calls that cannot reach their server
raise `StoreUnavailableError`; nothing waits longer than the adapter's timeouts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import BinaryIO, Generic, Protocol, TypeAlias, TypeVar

from spherify.jobs.errors import JobsError
from spherify.jobs.model import Job, JobSpec, JobStatus, MeshRecord, Outcome, Progress, Snapshot

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class BlobStat:
    """Name and size of a stored blob, and when it was created (seconds since the epoch)."""

    key: str
    size: int
    created_at: float


class BlobStore(Protocol):
    """Files with create-only writes: a key is written once, whole and durable, or not at all.

    Any call raises `StoreUnavailableError` when it cannot reach its server; a write may then have happened or not.
    """

    def create(self, key: str, chunks: bytes | Iterable[bytes]) -> BlobStat:
        """Store under a new key; raises `BlobExistsError`, `StorageFullError`. Durable on return."""
        ...

    def copy(self, source: str, key: str) -> BlobStat:
        """Store what lies under one key under a new one as well; raises as `create` does, `BlobNotFoundError`."""
        ...

    def adopt(self, key: str, path: Path) -> BlobStat:
        """Move a finished file of `scratch` in under a new key; raises as `create` does."""
        ...

    def scratch(self) -> Path:
        """Return the folder of this host for unfinished files; swept when they are old."""
        ...

    def open(self, key: str) -> BinaryIO:
        """Open for reading, seekable; raises `BlobNotFoundError`."""
        ...

    def read(self, key: str) -> bytes:
        """Return the whole blob; raises `BlobNotFoundError`."""
        ...

    def stat(self, key: str) -> BlobStat | None:
        """Return what is known of a key, None if nothing is stored there."""
        ...

    def list(self, prefix: str) -> Iterator[BlobStat]:
        """Yield every blob below a folder-like prefix, sorted by key."""
        ...

    def delete(self, key: str) -> bool:
        """Remove one blob; whether it was there."""
        ...

    def folders(self, prefix: str) -> Iterator[str]:
        """Yield the names of what looks like folders directly below a prefix, sorted."""
        ...

    def ping(self) -> None:
        """Raise `StoreUnavailableError` unless blobs can be read and written just now; answers soon."""
        ...


class ClaimOutcome(StrEnum):
    """What a worker is told when it asks for a job."""

    CLAIMED = "claimed"
    LEASED = "leased"  # another worker holds it: drop this delivery
    DONE = "done"  # terminal or unknown: drop this delivery
    ENDING = "ending"  # to be cancelled, or lost too often: it is ours, to be ended and not to be computed


@dataclass(frozen=True, slots=True)
class Claim:
    """Answer to a claim.

    Attributes:
        token: fences every later write; 0 unless CLAIMED or ENDING.
        spent_s: how long earlier attempts held the job, by the server's clock.
        attempt: how many there are with this one, if it is one: CLAIMED.
        losses: how many of them lost their worker.

    """

    outcome: ClaimOutcome
    token: int = 0
    spent_s: float = field(default=0.0, compare=False)
    attempt: int = field(default=0, compare=False)
    losses: int = field(default=0, compare=False)


class Renewal(StrEnum):
    """Answer to a heartbeat."""

    HELD = "held"
    CANCEL = "cancel"  # held, and somebody asked to cancel
    FENCED = "fenced"  # not ours any more: stop without a trace


class CancelOutcome(StrEnum):
    """Answer to a cancel request."""

    CANCELLED = "cancelled"  # nobody ever held it, or it is cancelled already
    CANCELLING = "cancelling"  # a worker has been told, or whoever claims it ends it
    FINISHED = "finished"  # too late: it has ended, or its end is just being written
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class Page(Generic[T]):
    """A slice of a listing, newest first; ``next_cursor`` is None at the end."""

    items: tuple[T, ...]
    next_cursor: str | None


@dataclass(frozen=True, slots=True)
class Kept:
    """Iterations of the snapshots and rows that stay, of all that attempts told: those of the present one."""

    snapshots: frozenset[int]
    rows: frozenset[int]


@dataclass(frozen=True, slots=True)
class Trail:
    """What the files of a job's attempts hold of one run: snapshots and rows, by iteration, ascending."""

    snapshots: tuple[Snapshot, ...] = ()
    rows: tuple[dict[str, float | int], ...] = ()

    @property
    def best(self) -> int | None:
        """Iteration of the snapshot of the highest sphericity."""
        sphericity = {
            snapshot.iteration: snapshot.metrics.get("sphericity", 0.0) for snapshot in self.snapshots
        }
        return max(sphericity, key=sphericity.__getitem__, default=None)


TrailFinder: TypeAlias = Callable[[BlobStore, str, Callable[[], object]], Trail]
"""Reads what is left in the files of a job, given their store, its id, and what is to be called again and again:
`spherify.stores.states.find_trail`."""


class JobStore(Protocol):
    """The live record of every job; every change of several keys is one script or transaction."""

    def add(self, spec: JobSpec) -> Job:
        """Record and queue a new job, in one transaction; again changes nothing. Raises `MeshNotFoundError`."""
        ...

    def get(self, job_id: str, known: Job | None = None) -> Job:
        """Return one job, ``known`` itself if that is this job and nothing about it has changed.

        Its lease may have been renewed even so: that is no new revision.

        Raises:
            JobNotFoundError: there is none.
            JobGoneError: it was deleted.

        """
        ...

    def get_all(self, known: Mapping[str, Job | None]) -> dict[str, Job | JobsError]:
        """Return each of these jobs as `get` does, or what it raises; in one call however many they are.

        Args:
            known: by id, each job as it was last seen, or None.

        """
        ...

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
        ...

    def metrics(self, job_id: str) -> list[dict[str, float | int]]:
        """Return the recorded time series, ascending by ``iteration``."""
        ...

    def delete(self, job_id: str) -> None:
        """Forget a terminal job, leaving a tombstone; raises `JobNotFinishedError`, `JobNotFoundError`."""
        ...

    def request_cancel(self, job_id: str) -> CancelOutcome:
        """Cancel a job that nobody ever held at once, or flag any other."""
        ...

    # What a worker calls; each is refused (False, FENCED) when the token is not the present one.

    def claim(self, job_id: str, worker: str, claimant: str = "", *, to_end: bool = False) -> Claim:
        """Take the lease and the next fencing token; the same ones again for a claimant who did not hear the answer.

        Args:
            job_id: which job.
            worker: name for the record.
            claimant: one try at one delivery; an empty one is nobody twice.
            to_end: take nothing but what is to be ended: the outcome is not CLAIMED.

        """
        ...

    def renew(self, job_id: str, token: int) -> Renewal:
        """Extend the lease, and learn whether to go on."""
        ...

    def report(
        self,
        job_id: str,
        token: int,
        progress: Progress,
        rows: Sequence[Mapping[str, float | int]] = (),
    ) -> bool:
        """Record progress and new rows of the time series (each with ``iteration``), idempotently."""
        ...

    def add_snapshot(self, job_id: str, token: int, snapshot: Snapshot) -> bool:
        """Publish a snapshot whose file is durable."""
        ...

    def release(self, job_id: str, token: int) -> bool:
        """Hand a job on without counting a loss, next in the queue; whether it is to be sent again.

        If it is not, somebody else has it, or it is `overdue`: it is to be cancelled.
        """
        ...

    def disown(self, job_id: str, token: int, kept: Kept) -> bool:
        """Forget what former attempts told but for this: the present one does not go on from the rest."""
        ...

    def lose(self, job_id: str, token: int) -> bool:
        """Give a job up whose runner died, counting a loss; whether it is to be sent again.

        If it is not, somebody else has it, or it is `overdue`: it is to be cancelled, or was lost too often.
        """
        ...

    def seal(self, job_id: str, token: int) -> Renewal:
        """Learn a last time whether to end as cancelled; from then on a cancel comes too late."""
        ...

    def commit(self, job_id: str, token: int, outcome: Outcome, kept: Kept | None = None) -> bool:
        """End a job, once, with the snapshots and rows kept only; the same again is True and changes nothing.

        Refused also while one of these is not known: an older copy of the record was put back since it was told.
        """
        ...

    # What the reconciler calls.

    def lost(self, limit: int | None = None, *, counted: bool = True) -> list[str]:
        """Free jobs whose lease ran out, the longest first; returns those to be sent again.

        Each is a loss, unless no worker is to blame and none is counted. Those to be ended stay `overdue`.
        """
        ...

    def overdue(self, limit: int | None = None) -> list[str]:
        """Return jobs whose lease ran out, the longest first: after `lost`, those that are to be ended."""
        ...

    def waiting(self, older_than_s: float, limit: int | None = None) -> list[str]:
        """Return accepted jobs queued for longer than that, oldest first."""
        ...

    def unsettled(self, limit: int | None = None, *, after: str = "") -> list[str]:
        """Return ended and deleted jobs whose files are not in their last state yet, by id; see `settle`."""
        ...

    def settled(self, job_id: str, *, deleted: bool) -> bool:
        """Take a job off `unsettled`, as a deleted or an ended one; False if it is not that any more."""
        ...

    def counts(self) -> dict[JobStatus, int]:
        """Return how many jobs are in each state."""
        ...

    def ping(self) -> None:
        """Raise `StoreUnavailableError` unless the server answers, and the records are all there."""
        ...

    # What `spherify.jobs.rebuild` and `restore` call. A server that lost its records knows that it did: until they are
    # back, "there is no such job" is never said; `StoreUnavailableError` is.

    def complete(self) -> bool:
        """Whether the records are all there, as far as the server knows."""
        ...

    def begin_rebuild(self) -> str:
        """Return the name of the rebuild that is under way, a new one if none is."""
        ...

    def end_rebuild(self, name: str) -> bool:
        """Declare the records complete; False if they were lost once more since that rebuild began."""
        ...

    def unknown(self, job_ids: Sequence[str]) -> list[str]:
        """Return those of which there is neither a record nor a tombstone."""
        ...

    def era(self) -> str:
        """Return the name of the rebuild after which all records were there, or of the one under way; "" if none is."""
        ...

    def restore(
        self, job: Job, rows: Sequence[Mapping[str, float | int]], *, spent_s: float = 0.0, era: str = ""
    ) -> bool:
        """Record a job again; token and revision begin beyond all earlier ones. False if it is known, or deleted.

        Args:
            job: as it is to be.
            rows: of its time series.
            spent_s: how long its attempts held it, see `Claim`.
            era: in which its files were read; in another nothing is done, for it may have been deleted since.

        """
        ...

    def bury(self, job_id: str, seconds: float) -> None:
        """Leave the tombstone of a job that was deleted, for so long."""
        ...


class MeshStore(Protocol):
    """The records of accepted meshes, and which jobs hold them."""

    def add(self, record: MeshRecord) -> bool:
        """Record a mesh whose files are durable; False if it was known already (nothing changes)."""
        ...

    def get(self, mesh_id: str) -> MeshRecord:
        """Return one record; raises `MeshNotFoundError`."""
        ...

    def find(self, *, limit: int = 50, cursor: str | None = None) -> Page[MeshRecord]:
        """Return a page of meshes, newest first; raises `InvalidCursorError`."""
        ...

    def delete(self, mesh_id: str) -> None:
        """Forget a mesh; raises `MeshInUseError` while any job names it, `MeshNotFoundError`.

        While not all jobs are known, none is forgotten: `StoreUnavailableError`.
        """
        ...

    def unknown(self, mesh_ids: Sequence[str]) -> list[str]:
        """Return those of which there is no record."""
        ...


class JobQueue(Protocol):
    """Carries job ids to workers. A hint only: what it loses the reconciler sends again."""

    def send(self, job_id: str, *, ahead: bool = False) -> None:
        """Send one id, perhaps ahead of those that have not waited before.

        Raises `StoreUnavailableError` within 2 s when the broker does not answer.
        """
        ...

    def pending(self, start: int = 0, count: int = 1000) -> list[str]:
        """Return ids in the queue, the next one last, `count` at most from a place on; "" for a message of others."""
        ...

    def length(self) -> int:
        """Return how many messages wait to be delivered."""
        ...
