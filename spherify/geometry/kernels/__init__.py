"""Engines that compute T: one interface, chosen by name.

An engine prepares a `Kernel` for one mesh's connectivity and one configuration, and the flow calls it once an
iteration. `reference` is plain numpy, written to be read beside the paper, and what every other engine is held
against; a compiled engine takes its place beside it in ENGINES.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from spherify.geometry.errors import InvalidConfigError
from spherify.geometry.kernels.interface import Engine, Kernel
from spherify.geometry.kernels.reference import ReferenceEngine

ENGINES: Final[Mapping[str, Engine]] = {"reference": ReferenceEngine()}

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
