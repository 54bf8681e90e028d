"""What lives as long as a worker's processes: the supervisor of each pool process, the reconciler of the main one.

    main process          reads messages; watches itself, in a thread; on SIGTERM raises a flag its children share
    └── pool process      one supervisor; one delivery at a time; reconciles, in a thread
        └── fork server   has imported everything, and stays as it is
            └── runner    computes
Each ends with the one above it, even when that is killed.

SIGTERM is Celery's warm shutdown: no new messages, and an end as soon as the tasks return. They return within the
grace time, because a supervisor that sees the flag hands its job on. Where something does not answer, and the main
process has not ended a moment after that, it leaves as it is: what it held is found again by its lease.

The main process never touches files: it forks, and the client of an object store does not survive that.
"""

from __future__ import annotations

import logging
import mmap
import os
import signal
import socket
import tempfile
import threading
from multiprocessing import process
from typing import Any, Final, NoReturn

from celery import signals
from celery.worker import state

from spherify.settings import Settings, unknown_variables
from spherify.stores.connect import Stores, open_stores
from spherify.stores.reconciler import ReconcilerThread
from spherify.stores.tether import die_with_parent
from worker import logs
from worker.liveness import turns
from worker.runners import Runners
from worker.supervisor import Supervisor
from worker.watchdog import Vitals, Watchdog

log = logging.getLogger(__name__)

LEAVE_S: Final = 4.0  # after the grace time, or the usual one: then a worker that is to end does so
_USUAL_GRACE_S: Final = 5.0
_TIMEOUT_S = 2.0  # of the server's answers; a worker can wait longer than a request
# A byte shared with the pool's children by fork: without a lock that a killed child could leave taken, and without the
# folder for temporary files that `multiprocessing` makes for its shared values, and a killed worker leaves behind.
_stop = mmap.mmap(-1, 1)


class _Process:
    """What one process has, made when it is first needed: never before a fork."""

    settings: Settings
    main: int  # process id of the main one, which forks the others
    stores: Stores | None = None
    supervisor: Supervisor | None = None
    reconciler: ReconcilerThread | None = None
    watchdog: Watchdog | None = None


def connect(settings: Settings) -> None:
    """Hear Celery's signals."""
    _Process.settings = settings
    _Process.main = os.getpid()
    # The pool shares a counter with each child in a file that is unlinked at once, in a folder that is removed at the
    # end: after a kill it would stay. There is no other way to name the folder.
    process.current_process()._config["tempdir"] = tempfile.gettempdir()  # type: ignore[attr-defined]
    signals.setup_logging.connect(_set_up_logging)
    signals.worker_ready.connect(_begin)
    signals.worker_shutting_down.connect(_shut_down)
    signals.worker_process_init.connect(_begin_child)
    signals.worker_process_shutdown.connect(_end_child)


def stopping() -> bool:
    """Whether this worker is to end."""
    return _stop[0] != 0


def supervisor() -> Supervisor:
    """Return this process's supervisor."""
    if _Process.supervisor is None:
        settings = _Process.settings
        stores = _stores()
        _Process.supervisor = Supervisor(
            stores.jobs,
            stores.blobs,
            stores.queue,
            settings,
            Runners(),
            stopping=stopping,
            give_up=_end_worker,
        )
    return _Process.supervisor


def keep(delivery_tag: str) -> None:
    """Tell the queue that a delivery is being worked on."""
    _stores().queue.keep(delivery_tag)


def _end_worker() -> None:
    """End this worker as SIGTERM does, to be started again: it cannot do what it is for."""
    log.error("this worker ends, to be started again: it cannot start runners", extra={"action": "runners"})
    os.kill(_Process.main, signal.SIGTERM)  # not the parent, which is somebody else if nothing was forked


def _stores() -> Stores:
    if _Process.stores is None:
        _Process.stores = open_stores(_Process.settings, timeout_s=_TIMEOUT_S)
    return _Process.stores


def _set_up_logging(**_: Any) -> None:  # noqa: ANN401 (what Celery sends along)
    logs.set_up()
    for sentence in unknown_variables(os.environ):
        log.warning(sentence)


def _begin(sender: Any, **_: Any) -> None:  # noqa: ANN401 (Celery's consumer)
    settings = _Process.settings
    stores = open_stores(settings, timeout_s=_TIMEOUT_S)
    slots = sender.controller.concurrency  # with --concurrency; the configuration does not know of that
    _Process.watchdog = Watchdog(
        lambda: Vitals(
            turns=turns(),
            fetched=state.all_total_count[0],
            idle=len(state.reserved_requests) < slots,
            queued=stores.queue.length(),
        ),
        limit_s=settings.watchdog_s,
        grace_s=settings.cancel_grace_s,
    )
    _Process.watchdog.start()
    log.info("ready", extra={"action": "ready"})


def _shut_down(**_: Any) -> None:  # noqa: ANN401 (as above)
    _stop[0] = 1
    leave = threading.Timer(max(_Process.settings.cancel_grace_s, _USUAL_GRACE_S) + LEAVE_S, _leave)
    leave.daemon = True
    leave.start()
    if _Process.watchdog is not None:
        _Process.watchdog.stop()


def _leave() -> NoReturn:
    log.warning("something does not answer: this worker leaves as it is", extra={"action": "leave"})
    os._exit(0)  # as it was told; its children end with it


def _begin_child(**_: Any) -> None:  # noqa: ANN401 (as above)
    die_with_parent(os.getppid())
    supervisor().runners.prepare()
    _Process.reconciler = ReconcilerThread(
        _Process.settings, name=f"worker@{socket.gethostname()}/{os.getpid()}"
    )
    _Process.reconciler.start()


def _end_child(**_: Any) -> None:  # noqa: ANN401 (as above)
    if _Process.reconciler is not None:
        _Process.reconciler.stop()
    if _Process.supervisor is not None:
        _Process.supervisor.runners.close()
