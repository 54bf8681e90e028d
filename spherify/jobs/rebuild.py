"""Bring all records back after the server lost them; `spherify.jobs.restore` lists which file holds what.

First the deletions, then meshes, then the jobs that name them. Until the end is declared the server says of nothing
that it is not there, and no mesh is deleted. Several may be at it at once, or one begin where another was broken off:
what is recorded already is passed over.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from functools import partial
from typing import TypeVar

from spherify.jobs import layout
from spherify.jobs.errors import StoreUnavailableError
from spherify.jobs.restore import UNREADABLE, named, restore_deletion, restore_job, restore_mesh
from spherify.jobs.stock import Stock

T = TypeVar("T")
log = logging.getLogger(__name__)


def rebuild(stock: Stock, still: Callable[[], object] = lambda: None) -> bool:
    """Restore everything if the server lost its records; whether it had.

    May be done by several at a time, and again after it was broken off.

    Args:
        stock: what to look through.
        still: called again and again, by which the caller says that it still is at it.

    Raises:
        StoreUnavailableError: it is to be done again.

    """
    if stock.jobs.complete():
        return False
    began = time.monotonic()
    name = stock.jobs.begin_rebuild()
    for tombstone in stock.blobs.list(layout.tombstones()):
        still()
        _tried(tombstone.key, partial(restore_deletion, stock, tombstone))
    restored = {"meshes": 0, "jobs": 0}
    for kind, prefix, restore in (
        ("meshes", layout.meshes(), restore_mesh),
        ("jobs", layout.jobs(), partial(restore_job, still=still)),
    ):
        for found in stock.blobs.folders(prefix):
            still()
            restored[kind] += bool(_tried(found, partial(restore, stock, found)))
    complete = stock.jobs.end_rebuild(name)
    log.log(
        logging.WARNING if any(restored.values()) else logging.INFO,  # a new server has nothing to lose
        "records rebuilt: %d jobs and %d meshes in %.1f s%s",
        restored["jobs"],
        restored["meshes"],
        time.monotonic() - began,
        "" if complete else ", and lost again",
        extra={"action": "rebuild"},
    )
    return True


def _tried(name: str, restore: Callable[[], T]) -> T | None:
    """Restore one thing; its trouble is logged, and is not that of the others."""
    try:
        return restore()
    except StoreUnavailableError:  # everybody's trouble
        raise
    except UNREADABLE:
        log.exception("cannot be restored", extra=named(name.rpartition("/")[2], "rebuild"))
        return None
