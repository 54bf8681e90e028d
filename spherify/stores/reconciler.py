"""The reconciler's thread: in every API process, and in every worker whether or not it is consuming."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from typing import Final

from spherify.jobs.errors import StoreUnavailableError
from spherify.jobs.reconcile import Reconciler
from spherify.settings import Settings
from spherify.stores.connect import open_stores
from spherify.stores.leader import Leadership

OUTAGE_SHARE: Final = 0.5
"""Of the lease: when the server did not answer for that long, workers may not have been able to renew theirs."""
log = logging.getLogger(__name__)


class Rounds:
    """Scans, once a period, and tells an outage of the server from the pause between two, and from other trouble.

    Args:
        reconciler: what scans.
        lead: becomes or stays the leader, which the server answers; raises `StoreUnavailableError`.
        lease_s: of the workers.
        period_s: the pause between two rounds, in which nothing is asked.
        clock: seconds.

    """

    def __init__(
        self,
        reconciler: Reconciler,
        lead: Callable[[], bool],
        *,
        lease_s: float,
        period_s: float,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._reconciler = reconciler
        self._lead = lead
        self._silence_s = period_s + OUTAGE_SHARE * lease_s
        self._clock = clock
        self._period_s = period_s
        self._heard_at = self._led_at = clock()

    def go(self) -> None:
        """Scan if this process leads; raises `StoreUnavailableError`."""
        leads = self._lead()
        self._led_at = self._clock()
        silent = self._clock() - self._heard_at > self._silence_s
        self._heard_at = self._clock()
        if not leads:
            return
        if silent:
            self._reconciler.after_outage()
        try:
            self._reconciler.scan(still=self._still)
        finally:  # of a scan that failed too: when only the files are away, leases run out as ever
            self._heard_at = self._clock()

    def _still(self) -> None:
        """Stay the leader; asked for each file of a rebuild, and does so once a period."""
        if self._clock() - self._led_at >= self._period_s:
            self._lead()
            self._led_at = self._clock()


class ReconcilerThread(threading.Thread):
    """Scans as often as the settings say, while this process is the leader; the first time at once."""

    def __init__(self, settings: Settings, *, name: str) -> None:
        super().__init__(name="reconciler", daemon=True)
        self._settings = settings
        self._owner = name
        self._done = threading.Event()

    def stop(self) -> None:
        """Let it end after the present scan; does not wait."""
        self._done.set()

    def run(self) -> None:
        """Scan until stopped."""
        stores = open_stores(self._settings)
        period = self._settings.reconcile_s
        leadership = Leadership(stores.client, self._owner, lease_s=3 * period)
        reconciler = Reconciler(stores.stock, orphan_s=self._settings.orphan_s)
        rounds = Rounds(reconciler, leadership.acquire, lease_s=self._settings.lease_s, period_s=period)
        pause = 0.0
        while not self._done.wait(pause):
            pause = period
            try:
                rounds.go()
            except StoreUnavailableError as e:
                log.warning("the job store does not answer: %s", e, extra={"action": "reconcile"})
            except Exception:  # a scan that fails must not be the last one; the trace goes to the log
                log.exception("a scan failed", extra={"action": "reconcile"})
        try:
            leadership.resign()
        except StoreUnavailableError:
            log.info("not resigned: the post runs out by itself", extra={"action": "reconcile"})
        stores.close()
