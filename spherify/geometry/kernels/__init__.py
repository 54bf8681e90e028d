"""Engines that compute T: one interface, chosen by name.

An engine prepares a `Kernel` for one mesh's connectivity and one configuration, and the flow calls it once an
iteration. `reference` is plain numpy, written to be read beside the paper, and what every other engine is held
against; `compiled` is the same as machine code, and the default where numba can be loaded.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from spherify.geometry.errors import InvalidConfigError
from spherify.geometry.kernels.interface import Engine, Kernel
from spherify.geometry.kernels.reference import ReferenceEngine

ENGINES: Final = ("reference", "compiled")

__all__ = ["ENGINES", "Engine", "Kernel", "default_engine", "get_engine"]


def get_engine(name: str, threads: int = 1) -> Engine:
    """Return the engine of that name.

    Args:
        name: one of ENGINES.
        threads: it computes with; the bytes do not depend on it.

    Raises:
        InvalidConfigError: there is no such engine, it cannot be loaded, or not with so many threads.

    """
    if name not in ENGINES:
        raise InvalidConfigError(f"there is no engine {name!r}; there are {', '.join(ENGINES)}")
    if name == "reference":
        if threads > 1:
            raise InvalidConfigError("the reference engine computes with one thread: leave --threads out")
        return ReferenceEngine()
    try:
        # Loads numba, which takes longer than a small mesh does: only when it is asked for.
        from spherify.geometry.kernels.compiled import CompiledEngine  # noqa: PLC0415
    except ImportError as e:
        raise InvalidConfigError(f"the compiled engine cannot be loaded: {e}") from e
    return CompiledEngine(threads)


def default_engine(threads: int = 1, say: Callable[[str], None] = lambda _: None) -> Engine:
    """Return the compiled engine; where it cannot be loaded the reference, which ``say`` is told in one line."""
    try:
        return get_engine("compiled", threads)
    except InvalidConfigError as e:
        say(f"{e}; the reference engine computes instead, at a tenth of the pace or less")
        return ReferenceEngine()
