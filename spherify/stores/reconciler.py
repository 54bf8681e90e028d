"""The reconciler's thread: in every API process, and in every worker whether or not it is consuming."""

from __future__ import annotations

import logging
import threading
import time
from typing import Final

from spherify.jobs.errors import StoreUnavailableError
from spherify.jobs.reconcile import Reconciler
from spherify.settings import Settings
from spherify.stores.connect import open_stores
from spherify.stores.leader import Leadership

OUTAGE_SHARE: Final = 0.5
"""Of the lease: when nothing was heard of the server for that long, workers may not have been able to renew theirs."""
log = logging.getLogger(__name__)


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
        pause = 0.0
        answered = time.monotonic()
        while not self._done.wait(pause):
            pause = period
            try:
                leads = leadership.acquire()
                if time.monotonic() - answered > OUTAGE_SHARE * self._settings.lease_s:
                    reconciler.after_outage()
                if leads:
                    reconciler.scan(still=leadership.acquire)
                answered = time.monotonic()
            except StoreUnavailableError as e:
                log.warning("the job store does not answer: %s", e, extra={"action": "reconcile"})
            except Exception:  # a scan that fails must not be the last one; the trace goes to the log
                log.exception("a scan failed", extra={"action": "reconcile"})
        try:
            leadership.resign()
        except StoreUnavailableError:
            log.info("not resigned: the post runs out by itself", extra={"action": "reconcile"})
        stores.close()
