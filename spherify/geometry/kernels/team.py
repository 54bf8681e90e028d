"""Threads that work on one thing at once, in parts that do not overlap: the bytes do not depend on how many."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from functools import partial
from operator import call
from queue import SimpleQueue
from threading import Lock, Thread
from typing import Any, Generic, TypeAlias, TypeVar
from weakref import finalize

Part = TypeVar("Part")
Result = TypeVar("Result")


class Team:
    """A caller and ``threads - 1`` helpers, who wait without spinning, and go when the team does.

    Plain threads, for the compiled passes release the interpreter. Numba's own threading would be one for the whole
    process, which does not bear to be forked, nor, by its default layer, to be called by two threads at once. The
    standard library's executor takes several times as long to hand out a part, which counts: there are thousands a
    second.
    """

    def __init__(self, threads: int) -> None:
        self.threads = threads
        # None until there is something to do; a fork takes no threads along, and the other process has its own.
        self._handed_out: _Queue | None = None
        self._process = 0

    def each(self, work: Callable[[Part], Result], parts: Sequence[Part]) -> list[Result]:
        """Do all parts at once, the first one in the caller's thread; the results in the order of the parts.

        Parts may wait for each other, if ``work`` is not written in Python: what a signal's handler raises, as Ctrl+C
        does, then comes before the first is handed out or after the caller's own is done, never in between.

        Raises:
            BaseException: whatever the first part raises, else the next one; all are done with by then.

        """
        if self.threads == 1:
            return [work(part) for part in parts]
        if self._handed_out is None or self._process != os.getpid():
            self._process, self._handed_out = os.getpid(), self._gathered()
        others = [_Handed(work, part) for part in parts[1:]]
        to_do: list[Callable[[], Any]] = [partial(self._handed_out.put, other) for other in others]
        to_do.append(partial(work, parts[0]))
        doing = map(call, to_do)
        try:
            # One call to Python's eyes, and none before it: handlers of signals run between two.
            first: Result = list(doing)[-1]
        finally:
            for other in others:
                other.done.acquire()
        return [first, *(other.outcome() for other in others)]

    def _gathered(self) -> _Queue:
        """Begin the helpers, and let them go with the team; return what they take their work from."""
        handed_out: _Queue = SimpleQueue()
        for _ in range(self.threads - 1):
            # A daemon: nothing need be waited for at the end of the process, where no part is being done.
            Thread(target=_help, args=(handed_out,), name="kernel", daemon=True).start()
            finalize(self, handed_out.put, None)
        return handed_out


class _Handed(Generic[Part, Result]):
    """A part that somebody else does; what came of it is there when ``done`` can be had."""

    def __init__(self, work: Callable[[Part], Result], part: Part) -> None:
        self._work = work
        self._part = part
        self._result: Result
        self._error: BaseException | None = None
        self.done = Lock()
        self.done.acquire()

    def do(self) -> None:
        try:
            self._result = self._work(self._part)
        except BaseException as error:  # noqa: BLE001 - it is the caller's, who is told
            self._error = error
        finally:
            self.done.release()

    def outcome(self) -> Result:
        if self._error is not None:
            raise self._error
        return self._result


_Queue: TypeAlias = "SimpleQueue[_Handed[Any, Any] | None]"


def _help(handed_out: _Queue) -> None:
    """Do what is handed out until there is None, and keep nothing of it meanwhile."""
    while (handed := handed_out.get()) is not None:
        handed.do()
        del handed
