"""How an attempt leaves its job: ended, adopted, handed on or lost.

All of it is written under the attempt's fencing token only, and offered for a while to a server that does not answer.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Final, TypeVar

from spherify.jobs import layout
from spherify.jobs.errors import JobsError, StorageFullError, StoreUnavailableError
from spherify.jobs.finish import conclude, finish
from spherify.jobs.model import JobError, JobStatus, Outcome, Progress
from spherify.jobs.ports import BlobStore, JobQueue, JobStore, Renewal, Trail
from spherify.jobs.results import Result, publish_result, write_result
from spherify.jobs.settle import settle
from worker.outbox import Outbox

COMMIT_S: Final = 15.0  # how long the end of a job is offered to a server that does not answer
# The same by a worker that is to end: the server may only be restarted with it, and else the lease runs out.
STOP_S: Final = 4.0
_TICK_S: Final = 0.25
T = TypeVar("T")
log = logging.getLogger(__name__)


class Ending:
    """The ways out of a claimed job.

    Attributes:
        outbox: what the runner said and the record does not know yet; told before anything else.

    """

    def __init__(
        self,
        jobs: JobStore,
        blobs: BlobStore,
        queue: JobQueue,
        job_id: str,
        token: int,
        *,
        stopping: Callable[[], bool] = lambda: False,
    ) -> None:
        self._stopping = stopping
        self._jobs = jobs
        self._blobs = blobs
        self._queue = queue
        self._job_id = job_id
        self._token = token
        self.outbox = Outbox(jobs, job_id, token)

    def commit(self, outcome: Outcome, progress: Progress | None) -> None:
        """Make the end durable, then tell the record.

        Without a progress, that of the last state: the runner did not tell its end itself, but was told of.
        """
        if self._blobs.stat(layout.cancel(self._job_id)) is not None:  # the record may be an older copy
            self._insist(lambda: self._jobs.request_cancel(self._job_id))
        sealed = self._insist(lambda: self._jobs.seal(self._job_id, self._token))
        if sealed is None or sealed is Renewal.FENCED:
            self.say(logging.WARNING, "fenced", "it ended, but the job is not ours any more")
            self.settle()
            return
        if sealed is Renewal.CANCEL:
            outcome = Outcome(
                JobStatus.CANCELLED, stop_reason="cancelled", best_iteration=outcome.best_iteration
            )
        mine = self._result(outcome, progress)
        outcome = mine.outcome
        try:
            result = write_result(self._blobs, mine)
        except StorageFullError as e:  # the record alone must say it
            error = JobError("storage-full", f"{e}: delete jobs that are no longer needed")
            if outcome.status is not JobStatus.CANCELLED:
                outcome = replace(outcome, status=JobStatus.FAILED, error=error)
        else:
            if result is not mine:
                self.adopt(result)
                return
        self.outbox.send_end(mine.progress)
        ended = self._insist(lambda: self._jobs.commit(self._job_id, self._token, outcome, mine.kept))
        if ended:
            self._committed(outcome)
        elif ended is False and outcome is mine.outcome:
            self.adopt(mine)  # not ours any more, or an older copy of the record that lacks what was told

    def _result(self, outcome: Outcome, progress: Progress | None) -> Result:
        """Put together what the runner told and, if it did not tell its end itself, what the record knows besides."""
        job = self._insist(lambda: self._jobs.get(self._job_id))
        snapshots, rows = self.outbox.snapshots, self.outbox.rows
        if job is not None and progress is None:  # it may not even have come to name what it went on from
            snapshots = job.snapshots
            rows = tuple(self._insist(lambda: self._jobs.metrics(self._job_id)) or rows)
            outcome = replace(outcome, best_iteration=Trail(snapshots).best)
        return Result(
            self._job_id,
            self._token,
            outcome,
            progress or self.outbox.reached(None if job is None else job.progress),
            snapshots,
            rows,
            started_at=None if job is None else job.started_at,
            attempt=0 if job is None else job.attempt,
            losses=0 if job is None else job.losses,
            whole=progress is not None,
        )

    def adopt(self, result: Result) -> None:
        """Tell the record of an end that another attempt wrote and did not live to tell."""
        self.say(logging.INFO, "adopt", f"ended under token {result.token}")
        if self._insist(lambda: publish_result(self._jobs, self._token, result)):
            self._committed(result.outcome)

    def _committed(self, outcome: Outcome) -> None:
        why = outcome.stop_reason or (outcome.error.code if outcome.error is not None else "")
        self.say(logging.INFO, "commit", f"{outcome.status}: {why}")
        self.settle()

    def settle(self) -> None:
        """Bring the files of a job that has ended to their last state; no attempt of ours writes any more.

        Also when it is another's: our runner may have slept through the end of the job, and written since.
        """
        self._try("settle", lambda: settle(self._jobs, self._blobs, self._job_id))

    def hand_on(self, *, ahead: bool = True) -> None:
        """Let another worker go on, and count no loss.

        Ahead of what has not begun, unless the job may come back as fast: it is not to keep the others waiting.
        """
        waits = self._insist(lambda: self._jobs.release(self._job_id, self._token))
        if waits:
            self.say(logging.INFO, "hand-on", "left where it stands, for another worker")
        self._pass_on(waits, ahead=ahead)

    def lose(self, why: str) -> None:
        """Give the job up, and count a loss."""
        self.say(logging.WARNING, "lose", why)
        self._pass_on(self._insist(lambda: self._jobs.lose(self._job_id, self._token)), ahead=True)

    def conclude(self) -> None:
        """End a job that was claimed for nothing else."""
        self._try("conclude", lambda: conclude(self._jobs, self._blobs, self._job_id, self._token))
        self.settle()

    def _pass_on(self, waits: bool | None, *, ahead: bool) -> None:
        """Send a job that waits again, and end one that does not, if it is nobody else's; None is not known."""
        if waits:
            self._try("send", lambda: self._queue.send(self._job_id, ahead=ahead))
        elif waits is not None:
            self._try("finish", lambda: finish(self._jobs, self._blobs, self._job_id))
            self.settle()

    def _try(self, action: str, do: Callable[[], object]) -> None:
        try:
            do()
        except JobsError as e:
            self.say(logging.WARNING, action, f"not done, the reconciler will: {e}")

    def _insist(self, write: Callable[[], T]) -> T | None:
        """Write to the record, for a while even if the server does not answer; None if it never did."""

        def flush_and_write() -> T:
            self.outbox.flush()
            return write()

        try:
            return insist(flush_and_write, self._stopping)
        except StoreUnavailableError as e:
            self.say(logging.ERROR, "give-up", f"the job store does not answer: {e}")
            return None

    def say(self, level: int, action: str, sentence: str) -> None:
        """Write a log line about the job."""
        say(level, self._job_id, action, sentence)


def insist(call: Callable[[], T], stopping: Callable[[], bool] = lambda: False) -> T:
    """Call for a while until the server answers, a short one if this worker is to end.

    Raises:
        StoreUnavailableError: the last one.

    """
    began = time.monotonic()
    while True:
        try:
            return call()
        except StoreUnavailableError:
            if time.monotonic() - began > (STOP_S if stopping() else COMMIT_S):
                raise
            time.sleep(_TICK_S)


def say(level: int, job_id: str, action: str, sentence: str) -> None:
    """Write a log line about a job."""
    log.log(level, sentence, extra={"job_id": job_id, "action": action})
