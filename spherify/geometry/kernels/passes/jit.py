"""How the passes are compiled, and where the machine code is kept.

Compiled code is kept beside the sources in ``__pycache__``, or, where that cannot be written, in numba's cache folder
of the user; ``NUMBA_CACHE_DIR`` names another place. Where none of them can be written, every process compiles anew.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import llvmlite.binding as llvm
from numba import config as _config
from numba import njit, typeof
from numba.core.caching import FunctionCache
from numba.core.compiler import Compiler
from numba.core.runtime.nrt import rtsys

GEOMETRY = Path(__file__).parents[2]
# Their constants are in the machine code.
CONSTANTS_OF = ("measures.py", "transformation.py", "unfolding.py", "ascent.py", "thinning.py")

config: Any = _config  # its attributes are made when it is imported
F = TypeVar("F", bound=Callable[..., Any])


def _suit_the_processor() -> None:
    """Let LLVM use 512-bit registers where there are some, and, on AMD's, load one by one what it would gather.

    It keeps to 256 bits on processors whose first models slowed down for wider ones; here, where nearly all is vector
    code, 512 are a third quicker. AMD's (Zen 4) take apart a gather of eight numbers into more than eight loads: when
    a step still gathered, it took an eighth to a sixth less without; the passes over faces do. Whoever names a
    processor or features (``NUMBA_CPU_NAME``, ``NUMBA_CPU_FEATURES``) is left alone. The same bits any way.
    """
    name, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features()
    if config.CPU_NAME is None and config.CPU_FEATURES is None and features.get("avx512f"):
        chosen = f"{features.flatten()},-prefer-256-bit"
        config.CPU_NAME = name
        config.CPU_FEATURES = f"{chosen},+prefer-no-gather" if name.startswith("znver") else chosen


_suit_the_processor()


class _Apart(Compiler):
    """Compiles functions whose array arguments never overlap, and says so to LLVM (``noalias``).

    Their code is left as it is: it is optimised once, within the entry it ends up in, and not again at each level of
    calls on the way, which takes several times as long.
    """

    def __init__(self, *arguments: object) -> None:
        super().__init__(*arguments)  # type: ignore[no-untyped-call] # numba has no types
        self.state.flags.noalias = True
        self.state.flags.no_cpython_wrapper = True
        self.state.flags.nrt = False  # nothing is allocated, so nobody need count who uses an array
        library = self.state.targetctx.codegen().create_library("pass")
        library._optimize_final_module = _leave
        self.state["library"] = library


def _leave() -> None:
    """Optimise nothing."""


class _Kept(FunctionCache):
    """The machine code of an entry in files, loaded without all that numba would compile with."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)  # type: ignore[no-untyped-call] # numba has no types
        # numba compares the file of the entry only with that of the kept code, not the files of what it calls.
        self._cache_file._source_stamp = _sources()

    def load_overload(self, sig: Any, target_context: Any) -> Any:  # noqa: ANN401 - as above
        """Return the code for arguments of some types, or None.

        numba's own imports its implementations of everything first, and scipy's linear algebra with them: a third of
        what a small mesh takes from beginning to end. Code that is finished needs numba's runtime, no more.
        """
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)  # type: ignore[no-untyped-call] # as above


_OPTIONS: dict[str, Any] = {"error_model": "numpy", "nogil": True}


def inner(function: F) -> F:
    """Compile a pass whose array arguments never overlap; it is kept within the entries that call it."""
    return cast(F, njit(pipeline_class=_Apart, forceinline=True, **_OPTIONS)(function))


def pasted(function: F) -> F:
    """Put a piece of code that reads or writes arrays into the pass that calls it, before that is compiled.

    What is compiled apart and put in later would not know that the arrays of the pass do not overlap.
    """
    return cast(F, njit(inline="always", **_OPTIONS)(function))


def entry(function: F) -> F:
    """Compile a function that Python calls, and keep its machine code for the next process."""
    compiled: Any = njit(**_OPTIONS)(function)
    # An error: there is no place to keep it, in a read-only installation by a user without a home.
    with suppress(RuntimeError):
        compiled._cache = _Kept(function)
    return cast(F, compiled)


def code_for(compiled: Callable[..., Any], *arguments: object) -> Callable[..., Any]:
    """Return the machine code of an entry for arguments of these types, made or loaded now.

    It must be given no others: numba's own call looks at the type of each argument first, which for the forty arrays
    of a step takes as long as a thousand vertices do.
    """
    dispatcher: Any = compiled
    types = tuple(map(typeof, arguments))
    dispatcher.compile(types)
    code: Callable[..., Any] = dispatcher.overloads[types].entry_point
    return code


def kept(compiled: Callable[..., Any]) -> bool:
    """Whether an entry has machine code, in this process or in a file, for this processor and these sources."""
    dispatcher: Any = compiled
    if dispatcher.signatures:
        return True
    processor = dispatcher.targetctx.codegen().magic_tuple()
    file = getattr(dispatcher._cache, "_cache_file", None)  # a NullCache has none
    return file is not None and any(key[1] == processor for key in file._load_index())


@cache
def _sources() -> str:
    digest = hashlib.sha256()
    for path in [*sorted(Path(__file__).parent.glob("*.py")), *(GEOMETRY / name for name in CONSTANTS_OF)]:
        digest.update(path.read_bytes())
    return digest.hexdigest()
