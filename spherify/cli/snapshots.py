"""What the files are called that commands save snapshots as."""

from __future__ import annotations

import re
from typing import Final

_NAME: Final = re.compile(r"(?P<stem>.+)_it\d{5,}\.(?P<form>\w+)")


def snapshot_name(stem: str, iteration: int, form: str) -> str:
    """Return the name for a state of what is called ``stem``, such as ``puma_it00100.ply``."""
    return f"{stem}_it{iteration:05d}.{form}"


def stem_and_form(name: str) -> tuple[str, str] | None:
    """Return what `snapshot_name` made a name of, besides the iteration; None of any other name."""
    found = _NAME.fullmatch(name)
    return None if found is None else (found["stem"], found["form"])
