"""One attempt at one job: claim it, watch over the runner, keep the lease, end the record.

The record is written under the attempt's fencing token only. When the token is no longer the present one, or no
heartbeat got through for most of the lease, the runner is killed and nothing more is written.
"""

from __future__ import annotations

import logging
import subprocess
import time
import uuid
from collections.abc import Callable
from enum import Enum
from typing import Any, Final

from spherify.jobs import layout
from spherify.jobs.accounts import write_account
from spherify.jobs.codec import load_outcome, load_progress
from spherify.jobs.errors import StorageFullError, StoreUnavailableError
from spherify.jobs.model import JobError, JobStatus, Outcome, Progress
from spherify.jobs.outcome import DEADLINE_ADVICE, internal_error
from spherify.jobs.ports import BlobStore, Claim, ClaimOutcome, JobQueue, JobStore, Renewal
from spherify.jobs.results import read_result
from spherify.jobs.run import limit_reached
from spherify.settings import Settings
from worker.ending import Ending, insist, say
from worker.orders import CANCEL_SIGNAL, HAND_ON_SIGNAL, Order
from worker.runners import Runner, Runners

LOOK_S: Final = 0.5  # a cancel is seen this soon, however rare the heartbeats are
FENCE_SHARE: Final = (
    0.8  # of the lease: a worker that cannot renew for this long gives up before others may begin
)
START_S: Final = (
    120.0  # a runner that is not ready by then never will be: the first one on a machine makes machine code
)
FAILED_STARTS: Final = (
    3  # in a row, after which the worker gives up: another one, or the next life of it, may do better
)
REST_S: Final = 1.0  # after a job whose files could not be reached: the next one's may be as far
_LEAST_S: Final = 3.0  # time for an attempt at a job whose limit is over, in which the runner tells so
_SPARE_S: Final = 0.5  # a brief job is not to share its processor with the start of a spare
TICK_S: Final = 0.25
log = logging.getLogger(__name__)


class Verdict(Enum):
    """How the watch over a runner ended."""

    ENDED = "ended"  # it said how
    DIED = "died"  # without a word
    STOPPED = "stopped"  # it was told to, for another worker
    CANCELLED = "cancelled"  # it was told to, and did not say how it ended
    OVERDUE = "overdue"  # it outran its limit, even after it was told to stop
    FENCED = "fenced"  # the job is somebody else's now, or may be
    UNBORN = "unborn"  # there never was one: this worker cannot start runners


class Supervisor:
    """Runs jobs one at a time."""

    def __init__(
        self,
        jobs: JobStore,
        blobs: BlobStore,
        queue: JobQueue,
        settings: Settings,
        runners: Runners,
        *,
        stopping: Callable[[], bool] = lambda: False,
        give_up: Callable[[], None] = lambda: None,
    ) -> None:
        """Take what is needed.

        Args:
            jobs: the records.
            blobs: the files.
            queue: the way to other workers.
            settings: limits and times.
            runners: the processes that compute.
            stopping: whether this worker is to end.
            give_up: called when it cannot start runners, and should end.

        """
        self.jobs = jobs
        self.blobs = blobs
        self.queue = queue
        self.settings = settings
        self.runners = runners
        self.stopping = stopping
        self._give_up = give_up
        self._failed_starts = 0

    def started(self, well: bool) -> None:
        """Count starts of runners that failed, and give up after some in a row."""
        self._failed_starts = 0 if well else self._failed_starts + 1
        if self._failed_starts >= FAILED_STARTS:
            self._give_up()

    def ending(self, job_id: str, token: int) -> Ending:
        """Return the ways out of a job that was claimed."""
        return Ending(self.jobs, self.blobs, self.queue, job_id, token, stopping=self.stopping)

    def run(self, job_id: str, worker: str, keep_delivery: Callable[[], None] = lambda: None) -> None:
        """Do one delivery; returns when the job has ended, was handed on, or is not ours.

        Args:
            job_id: what was delivered.
            worker: name for the record.
            keep_delivery: tells the queue, at every heartbeat, that the delivery is being worked on.

        Raises:
            StoreUnavailableError: it could not even be claimed; the reconciler will send it again.

        """
        claimant = uuid.uuid4().hex  # an answer that is lost on the way is given again
        claim = insist(lambda: self.jobs.claim(job_id, worker, claimant), self.stopping)
        if claim.outcome is ClaimOutcome.ENDING:
            self.ending(job_id, claim.token).conclude()
            return
        if claim.outcome is not ClaimOutcome.CLAIMED:
            say(logging.INFO, job_id, "drop", f"dropped: {claim.outcome}")
            return
        say(
            logging.INFO,
            job_id,
            "claim",
            f"token {claim.token}, after {claim.spent_s:.1f} s of earlier attempts",
        )
        attempt = _Attempt(self, job_id, claim, keep_delivery)
        try:
            attempt.go()
        except StoreUnavailableError as e:
            attempt.put_off(e)
        except Exception as e:
            log.exception("a fault of the supervisor", extra={"job_id": job_id, "action": "fault"})
            attempt.give_up(e)
            raise


class _Attempt:
    """A claimed job, from the claim to the end of the record."""

    def __init__(
        self, boss: Supervisor, job_id: str, claim: Claim, keep_delivery: Callable[[], None]
    ) -> None:
        self._boss = boss
        self._jobs = boss.jobs
        self._settings = boss.settings
        self._job_id = job_id
        self._token = claim.token
        self._claim = claim
        self._left_s = max(boss.settings.wall_limit_s - claim.spent_s, _LEAST_S)
        self._keep_delivery = keep_delivery
        self._ending = boss.ending(job_id, claim.token)
        now = time.monotonic()
        self._began = self._renewed_at = now
        self._look_at = now
        self._answered = True
        self._beat_at = now
        self._told: Verdict | None = None
        self._told_at = now
        self._killed = False
        self._ready_at: float | None = None
        self._last: dict[str, Any] | None = None

    def go(self) -> None:
        """Carry the attempt through."""
        earlier = read_result(self._boss.blobs, self._job_id)
        if earlier is not None:  # an attempt died between the file and the record
            self._ending.adopt(earlier)
            return
        if self._boss.blobs.stat(layout.cancel(self._job_id)) is not None:  # the record may be an older copy
            insist(lambda: self._jobs.request_cancel(self._job_id), self._boss.stopping)
        self._keep_account()
        try:
            runner = self._boss.runners.take()
        except OSError as e:  # no process, no pipe: this machine is at its end, and not the job
            self._never_began(repr(e))
            return
        try:
            runner.start(
                Order(
                    job_id=self._job_id,
                    token=self._token,
                    data_dir=str(self._settings.data_dir / "blobs"),
                    memory_bytes=self._settings.runner_memory_bytes,
                    deadline_s=self._left_s,
                    limit_s=self._settings.wall_limit_s,
                    checkpoint_s=self._settings.checkpoint_s,
                    engine=None if self._settings.engine == "auto" else self._settings.engine,
                    threads=self._settings.threads,
                    blobs=self._settings.blobs,
                )
            )
            verdict = self._watch(runner)
        except SystemExit:  # Celery's cold shutdown
            runner.kill()
            self._ending.hand_on()
            raise
        finally:
            exit_code = self._end_of(runner)
        self._conclude(verdict, exit_code)
        self._boss.runners.prepare()

    def _keep_account(self) -> None:
        """Write down what only the record knows otherwise; without it a rebuild begins to count anew."""
        try:
            write_account(self._boss.blobs, self._job_id, self._claim)
        except StorageFullError as e:
            self._ending.say(logging.WARNING, "account", f"what was spent is not written: {e}")

    def put_off(self, error: StoreUnavailableError) -> None:
        """Hand on because the files cannot be reached, which is neither a loss nor an end; then rest."""
        self._ending.say(logging.WARNING, "put-off", f"its files cannot be reached: {error}")
        self._ending.hand_on(ahead=False)
        till = time.monotonic() + REST_S
        while time.monotonic() < till and not self._boss.stopping():
            time.sleep(TICK_S)

    def give_up(self, error: Exception) -> None:
        """End after a fault of this process: one of the machine counts as a loss, one of the program as the end."""
        if isinstance(error, OSError):
            self._ending.lose(repr(error))
        else:
            ours = internal_error(self._job_id, f"{type(error).__name__}: {error}")
            self._ending.commit(
                Outcome(JobStatus.FAILED, best_iteration=self._ending.outbox.best, error=ours), None
            )

    def _end_of(self, runner: Runner) -> int:
        """See the process out and return its exit code; one that goes on in spite of its last word is killed."""
        try:
            return runner.wait(self._settings.cancel_grace_s)
        except subprocess.TimeoutExpired:
            runner.kill()
            return runner.wait()

    # Watching

    def _watch(self, runner: Runner) -> Verdict:
        while True:
            for event in runner.events(TICK_S):
                self._hear(event)
            now = time.monotonic()
            # A worker that is to end waits for no server that does not answer: the lease is long enough.
            due = now >= self._look_at and (self._answered or self._told is not Verdict.STOPPED)
            fenced = due and not self._look(now)
            if fenced or now - self._renewed_at > FENCE_SHARE * self._settings.lease_s:
                runner.kill()
                return Verdict.FENCED
            if self._ready_at is None and now - self._began > START_S:
                runner.kill()
                return self._verdict()
            if runner.ended or self._last is not None:
                return self._verdict()
            self._steer(runner, now)
            if now - self._began > _SPARE_S:
                self._boss.runners.prepare()

    def _hear(self, event: dict[str, Any]) -> None:
        if event["event"] == "ready":
            self._ready_at = time.monotonic()
            self._boss.started(True)
            self._ending.say(logging.INFO, "start", f"under token {self._token}, process {event['pid']}")
        elif event["event"] in {"anew", "snapshot", "report"}:
            self._ending.outbox.take_in(event)
            self._look_at = 0.0  # tell it at once
        else:
            self._last = event

    def _look(self, now: float) -> bool:
        """Renew the lease, see what is asked, tell what is new; False when the job is not ours any more."""
        self._look_at = now + min(LOOK_S, self._settings.heartbeat_s)
        try:
            self._answered = False
            renewal = self._jobs.renew(self._job_id, self._token)
            self._answered = True
            if renewal is Renewal.FENCED or not self._ending.outbox.flush():
                return False
            self._renewed_at = now
            if renewal is Renewal.CANCEL:
                self._tell(Verdict.CANCELLED, now)
            if now >= self._beat_at:
                self._beat_at = now + self._settings.heartbeat_s
                self._keep_delivery()
        except StoreUnavailableError as e:
            self._ending.say(logging.WARNING, "heartbeat", f"the job store does not answer: {e}")
        return True

    def _steer(self, runner: Runner, now: float) -> None:
        """Pass on what the runner is to be told, and end it when it does not listen."""
        grace = self._settings.cancel_grace_s
        if self._boss.stopping():
            self._tell(Verdict.STOPPED, now)
        computing_s = 0.0 if self._ready_at is None else now - self._ready_at  # a start may take its time
        overdue = computing_s > self._left_s + grace  # it looks at its limit itself
        deaf = self._told is not None and now - self._told_at > grace
        if overdue or deaf:
            if not self._killed:
                self._ending.say(logging.WARNING, "kill", f"the runner did not stop within {grace:g} s")
            self._told = self._told or Verdict.OVERDUE
            self._killed = True
            runner.kill()  # its last words are still in the pipe, and then its end
        elif self._told is not None and self._told_at == now:
            runner.tell(HAND_ON_SIGNAL if self._told is Verdict.STOPPED else CANCEL_SIGNAL)

    def _tell(self, why: Verdict, now: float) -> None:
        if self._told is None:
            self._told, self._told_at = why, now

    def _verdict(self) -> Verdict:
        if self._last is None:
            return self._told or (Verdict.UNBORN if self._ready_at is None else Verdict.DIED)
        return Verdict.ENDED if self._last["event"] != "handed-on" else self._told or Verdict.STOPPED

    # Concluding

    def _conclude(self, verdict: Verdict, exit_code: int) -> None:
        if verdict is Verdict.FENCED:
            self._ending.say(logging.WARNING, "fenced", "the job is not ours any more: the runner was killed")
            self._ending.hand_on()  # if it is, because nobody could take it: the server was away for all
            self._ending.settle()
        elif verdict is Verdict.STOPPED:
            self._ending.hand_on(ahead=self._told is not None)  # else it stopped because of its files
        elif verdict is Verdict.UNBORN:
            self._never_began(f"no runner was ready, exit code {exit_code}")
        elif verdict is Verdict.DIED and exit_code < 0:
            self._ending.lose(f"the runner ended without a word, exit code {exit_code}")
        else:
            self._ending.commit(*self._end(verdict, exit_code))

    def _end(self, verdict: Verdict, exit_code: int) -> tuple[Outcome, Progress | None]:
        """Return the end as the runner told it, or as it must be told for it."""
        told = self._last if verdict is Verdict.ENDED else None
        if told is not None and told["event"] == "end":
            self._ending.outbox.add_rows(told["rows"])
            outcome = load_outcome(told["outcome"])
            return outcome, load_progress(told["progress"])
        if told is not None:
            error = JobError(told["code"], told["detail"])
            return Outcome(JobStatus.FAILED, best_iteration=self._ending.outbox.best, error=error), None
        if verdict is Verdict.DIED:  # by itself, and not by a signal: it would again
            error = internal_error(self._job_id, f"the runner ended with exit code {exit_code}")
            return Outcome(JobStatus.FAILED, best_iteration=self._ending.outbox.best, error=error), None
        if verdict is Verdict.OVERDUE:
            reached = limit_reached(self._settings.wall_limit_s)
            error = JobError("deadline", f"{reached}, and the runner was stopped; {DEADLINE_ADVICE}")
            last, best = self._ending.outbox.latest, self._ending.outbox.best
            return Outcome(JobStatus.FAILED, "deadline", None, last, best, error), None
        return Outcome(JobStatus.CANCELLED, best_iteration=self._ending.outbox.best), None

    def _never_began(self, why: str) -> None:
        """Hand on a job that this worker could not even begin: it is not to blame, and no loss is counted."""
        self._ending.say(logging.ERROR, "unborn", why)
        self._ending.hand_on()
        self._boss.started(False)
