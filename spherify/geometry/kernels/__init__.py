"""Engines that compute T: one interface, chosen by name.

An engine prepares a `Kernel` for one mesh's connectivity and one configuration, and the flow calls it once an
iteration. `reference` is plain numpy, written to be read beside the paper, and what every other engine is held
against; `compiled` is the same as machine code.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Final

from spherify.geometry.errors import InvalidConfigError
from spherify.geometry.kernels.interface import Engine, Kernel
from spherify.geometry.kernels.reference import ReferenceEngine


def _compiled() -> Engine:
    # Loads numba, which takes longer than a small mesh does: only when it is asked for.
    from spherify.geometry.kernels.compiled import CompiledEngine  # noqa: PLC0415

    return CompiledEngine()


class _Engines(Mapping[str, Engine]):
    """Engines by name, each made when it is first asked for."""

    def __init__(self, makers: Mapping[str, Callable[[], Engine]]) -> None:
        self._makers = dict(makers)
        self._made: dict[str, Engine] = {}

    def __getitem__(self, name: str) -> Engine:
        if name not in self._made:
            self._made[name] = self._makers[name]()
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._makers)

    def __len__(self) -> int:
        return len(self._makers)


ENGINES: Final[Mapping[str, Engine]] = _Engines({"reference": ReferenceEngine, "compiled": _compiled})

__all__ = ["ENGINES", "Engine", "Kernel", "get_engine"]


def get_engine(name: str) -> Engine:
    """Return the engine of that name.

    Raises:
        InvalidConfigError: there is none.

    """
    try:
        return ENGINES[name]
    except KeyError:
        raise InvalidConfigError(f"there is no engine {name!r}; there are {', '.join(ENGINES)}") from None
