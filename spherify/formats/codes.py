"""What can be wrong with a mesh, by the names the interface uses."""

from __future__ import annotations

from typing import Final, Literal, get_args

ProblemCode = Literal[
    "unsupported-mesh-format",
    "mesh-too-large",
    "mesh-not-parsable",
    "mesh-not-closed",
    "mesh-not-manifold",
    "mesh-not-oriented",
    "mesh-not-connected",
    "mesh-genus",
]
PROBLEM_CODES: Final[tuple[ProblemCode, ...]] = get_args(ProblemCode)


def problem_code(value: object) -> ProblemCode:
    """Return a value that is one of `PROBLEM_CODES`; raises ValueError for any other."""
    for code in PROBLEM_CODES:
        if code == value:
            return code
    raise ValueError(f"{value!r} is no problem code")
