"""Start a program that ends with whoever started it, even when that one is killed with -9.

Run as ``python -I -S tether.py PARENT_PID PROGRAM ARGUMENT…``; standard library only, so that it starts in 15 ms.
On Linux the kernel does it: the parent-death signal is set, then the program takes this process's place.
Elsewhere this process stays, passes signals on, and looks twice a second whether its parent is still there.
"""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
from pathlib import Path
from types import FrameType
from typing import Final

PR_SET_PDEATHSIG: Final = 1  # linux/prctl.h
_LOOK_S: Final = 0.5


def tethered(command: list[str]) -> list[str]:
    """Return the command line that runs a program tethered to the calling process.

    On Linux the tether hangs on the calling *thread*: start it from one that lives as long as the program shall.
    """
    return [sys.executable, "-I", "-S", str(Path(__file__).resolve()), str(os.getpid()), *command]


def die_with_parent(parent: int, sig: int = signal.SIGKILL) -> bool:
    """Ask the kernel to send this process a signal when its parent ends; False where it cannot (not Linux).

    Raises:
        SystemExit: the parent has ended already.

    """
    if not sys.platform.startswith("linux"):
        return False
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(PR_SET_PDEATHSIG, int(sig), 0, 0, 0) != 0:
        raise OSError(ctypes.get_errno(), "prctl(PR_SET_PDEATHSIG)")
    if os.getppid() != parent:
        raise SystemExit("the parent process has ended")
    return True


def _watch(parent: int, command: list[str]) -> int:
    child = subprocess.Popen(command, close_fds=False)  # noqa: S603 (the caller's own command line and files)

    def pass_on(number: int, _frame: FrameType | None) -> None:
        child.send_signal(number)

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, pass_on)
    while True:
        try:
            return child.wait(_LOOK_S)
        except subprocess.TimeoutExpired:
            if os.getppid() != parent:
                child.kill()
                return child.wait()


if __name__ == "__main__":
    _parent, _command = int(sys.argv[1]), sys.argv[2:]
    if die_with_parent(_parent):
        os.execvp(_command[0], _command)  # noqa: S606 (no shell is what is wanted)
    sys.exit(_watch(_parent, _command))
