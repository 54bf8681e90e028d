"""The watchdog: ends a worker that consumes nothing although it could, so that it is started again.

Two signs that a worker is dead without knowing it, both only while the server answers:

- its event loop has not turned for a while (`worker.liveness` counts the turns);
- messages lie in the queue, a slot is free, and nothing is fetched: whoever waits at a queue that is not empty is
  served at once, so seconds of this mean that nobody waits.

The end is that of SIGTERM: running jobs are handed on. A loop that hangs cannot carry it out and is killed; its pool
and its runners end with it, and its jobs are found by their leases.
"""

from __future__ import annotations

import logging
import os
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from spherify.jobs.errors import StoreUnavailableError

LOOK_S: Final = 1.0
END_S: Final = 5.0  # after the grace time: how long an end in good order may take
log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Vitals:
    """What a worker looks like at one moment.

    Attributes:
        turns: signs of life of the event loop so far.
        fetched: messages taken so far.
        idle: whether a slot is free.
        queued: messages in the queue.

    """

    turns: int
    fetched: int
    idle: bool
    queued: int


class Patience:
    """Judges vitals that are taken again and again; time in which nobody looked counts as one look."""

    def __init__(self, limit_s: float) -> None:
        self._limit_s = limit_s
        self._before: Vitals | None = None
        self._still_s = self._hungry_s = 0.0

    def judge(self, now: Vitals, passed_s: float) -> str | None:
        """Return what is wrong for too long, None while there is hope."""
        before, self._before = self._before, now
        if before is None:
            return None
        passed_s = min(passed_s, 2 * LOOK_S)  # the whole process may have slept
        self._still_s = 0.0 if now.turns != before.turns else self._still_s + passed_s
        hungry = now.idle and now.queued and now.fetched == before.fetched
        self._hungry_s = self._hungry_s + passed_s if hungry else 0.0
        if self._still_s > self._limit_s:
            return f"its event loop has stood still for {self._still_s:.0f} s"
        if self._hungry_s > self._limit_s:
            return f"{now.queued} messages wait, a slot is free, and nothing was fetched for {self._hungry_s:.0f} s"
        return None

    def forgive(self) -> None:
        """Begin anew: the server did not answer, and without it nobody can do anything."""
        self._before = None
        self._still_s = self._hungry_s = 0.0


class Watchdog(threading.Thread):
    """Looks every second, and ends the process when patience is over."""

    def __init__(self, look: Callable[[], Vitals], *, limit_s: float, grace_s: float) -> None:
        """Take what looks (raising `StoreUnavailableError`), and for how long something may be wrong."""
        super().__init__(name="watchdog", daemon=True)
        self._look = look
        self._patience = Patience(limit_s)
        self._grace_s = grace_s
        self._done = threading.Event()

    def stop(self) -> None:
        """Look no more; does not wait."""
        self._done.set()

    def run(self) -> None:
        """Look until stopped, or until there is a reason to end the process."""
        before = time.monotonic()
        while not self._done.wait(LOOK_S):
            now = time.monotonic()
            try:
                reason = self._patience.judge(self._look(), now - before)
            except StoreUnavailableError:
                self._patience.forgive()
                reason = None
            before = now
            if reason is not None:
                self._end(reason)
                return

    def _end(self, reason: str) -> None:
        log.error("this worker ends, to be started again: %s", reason, extra={"action": "watchdog"})
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(self._grace_s + END_S)
        log.error("it does not end by itself: killed", extra={"action": "watchdog"})
        os.kill(os.getpid(), signal.SIGKILL)
