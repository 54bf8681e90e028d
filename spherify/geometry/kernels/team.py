"""Threads that work on one thing at once, in parts that do not overlap: the bytes do not depend on how many."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Part = TypeVar("Part")
Result = TypeVar("Result")


class Team:
    """A caller and ``threads - 1`` helpers, who wait without spinning, and go when the team does.

    Plain threads, for the compiled passes release the interpreter. Numba's own threading would be one for the whole
    process, which does not bear to be forked, nor, by its default layer, to be called by two threads at once.
    """

    def __init__(self, threads: int) -> None:
        self.threads = threads
        self._helpers = ThreadPoolExecutor(threads - 1, "kernel") if threads > 1 else None

    def each(self, work: Callable[[Part], Result], parts: Sequence[Part]) -> list[Result]:
        """Do all parts at once, the first one in the caller's thread; the results in the order of the parts."""
        if self._helpers is None:
            return [work(part) for part in parts]
        others = [self._helpers.submit(work, part) for part in parts[1:]]
        return [work(parts[0]), *(other.result() for other in others)]
