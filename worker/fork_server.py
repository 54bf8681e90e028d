"""The process that runners are forked from: ``python -m worker.fork_server PARENT_PID``, a socket as standard input.

A Python that has numpy, numba and the machine code of the kernels takes a second of a processor to start, longer
than most meshes need. This one is started once for each pool process and gets all that ready; from then on every
runner is a copy of it, made in some milliseconds. Memory is shared until it is written to, and what a job does to
it ends with the job.

It may be forked because of what it is at that moment: one thread (libraries are kept to one, the kernels' own
threads are started by the runner for its job), no connection, no file but those below. `multiprocessing.forkserver`
would do the forking, but a runner would import the worker's main module and Celery with it, and each runner would have
to report its own exit code, which a killed process cannot do.

A request is one byte and three files: where the order comes from, where the events go, and a socket on which this
process tells the runner's fate: first its process id, with a handle on it that never comes to mean another process
(a pidfd), in the end its exit code. Should this process end, that socket does, and so does the runner: each is
tethered to the one above it.
"""

from __future__ import annotations

import gc
import os
import selectors
import signal
import socket
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from typing import Final, NoReturn

from spherify.stores.tether import die_with_parent
from worker.orders import CANCEL_SIGNAL, HAND_ON_SIGNAL

FILES: Final = 3  # of a request
_EVENTS: Final = 3  # a runner's file of events, the first after the standard ones


def serve(requests: socket.socket, obey: Callable[[int, int], NoReturn]) -> None:
    """Fork runners, and tell their ends, until the other end of the socket is closed.

    Args:
        requests: where they come from.
        obey: what a runner does, given its files of orders and of events.

    """
    selector = selectors.DefaultSelector()
    selector.register(requests, selectors.EVENT_READ)
    while True:
        for key, _ in selector.select():
            if key.data is None:
                request, files, _, _ = socket.recv_fds(requests, 1, FILES)
                if not request:
                    return
                pid, handle, fate = _fork(obey, *files)
                selector.register(handle, selectors.EVENT_READ, (pid, fate))
            else:
                selector.unregister(key.fd)
                os.close(key.fd)
                _end(*key.data)


def _fork(
    obey: Callable[[int, int], NoReturn], order: int, events: int, fate: int
) -> tuple[int, int, socket.socket]:
    """Fork a runner and tell its process id; returns that, the handle and the socket of its fate."""
    server = os.getpid()
    pid = os.fork()
    if pid == 0:
        _become_runner(server, obey, order, events)
    os.close(order)
    os.close(events)
    handle = os.pidfd_open(pid)
    told = socket.socket(fileno=fate)
    with suppress(BrokenPipeError):  # nobody wants it any more: its order ends before it begins
        socket.send_fds(told, [str(pid).encode()], [handle])
    return pid, handle, told


def _end(pid: int, fate: socket.socket) -> None:
    """Take leave of a runner that has ended, and tell how."""
    _, status = os.waitpid(pid, 0)
    with fate, suppress(BrokenPipeError):
        fate.send(str(os.waitstatus_to_exitcode(status)).encode())


def _become_runner(server: int, obey: Callable[[int, int], NoReturn], order: int, events: int) -> NoReturn:
    """Go on as a runner, with no file of the server's; never returns to what the server was doing."""
    try:
        die_with_parent(server)
        os.dup2(order, 0)
        os.dup2(events, _EVENTS)
        os.closerange(_EVENTS + 1, os.sysconf("SC_OPEN_MAX"))
        gc.enable()
        obey(0, _EVENTS)
    except Exception:  # noqa: BLE001 (nobody is there to catch it)
        traceback.print_exc()
    finally:
        os._exit(1)


if __name__ == "__main__":
    die_with_parent(int(sys.argv[1]))
    for _number in (signal.SIGINT, CANCEL_SIGNAL, HAND_ON_SIGNAL):  # for the worker, or for a runner
        signal.signal(_number, signal.SIG_IGN)
    os.dup2(2, 1)
    gc.disable()  # what it moves about would be copied for every runner

    from worker import runner

    runner.get_ready()
    gc.freeze()
    serve(socket.socket(fileno=os.dup(0)), runner.obey)
