"""What Chromium's trace says about the long tasks of a page's own thread."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass
from typing import Any, Final

CATEGORIES: Final = ["devtools.timeline", "toplevel", "gpu"]
WAITING: Final = {"ImplementationBase::WaitForCmd", "CommandBufferProxyImpl::WaitForGetOffset"}
_OUTER: Final = {"RunTask", "ThreadControllerImpl::RunTask", "Receive mojo message", *WAITING}


@dataclass(frozen=True, slots=True)
class Task:
    """One task: how long it took, how long the processor was at it, how long it waited for the process that draws."""

    ms: float
    processor_ms: float
    waiting_ms: float
    what: str


def long_tasks(trace: bytes, least_ms: float = 50.0) -> list[Task]:
    """Return the long tasks of all pages' own threads, the longest first."""
    events: list[dict[str, Any]] = json.loads(trace)["traceEvents"]
    threads = {
        (one["pid"], one["tid"])
        for one in events
        if one["name"] == "thread_name" and one["args"]["name"] == "CrRendererMain"
    }
    found = []
    for thread in threads:
        spans = [
            one
            for one in events
            if one.get("ph") == "X" and (one["pid"], one["tid"]) == thread and one.get("dur")
        ]
        found += [
            _task(one, spans)
            for one in spans
            if one["name"].endswith("RunTask") and one["dur"] >= 1e3 * least_ms
        ]
    return sorted(found, key=lambda task: -task.ms)


def _task(task: dict[str, Any], spans: list[dict[str, Any]]) -> Task:
    begin, end = task["ts"], task["ts"] + task["dur"]
    inner = [one for one in spans if one is not task and begin <= one["ts"] and one["ts"] + one["dur"] <= end]
    waiting = sum(one["dur"] for one in inner if one["name"] == "ImplementationBase::WaitForCmd")
    did: Counter[str] = Counter()
    for one in inner:
        if one["name"] not in _OUTER:
            did[one["name"]] = max(did[one["name"]], one["dur"])
    what = ", ".join(f"{name} {dur / 1e3:.0f} ms" for name, dur in did.most_common(3))
    return Task(task["dur"] / 1e3, task.get("tdur", 0) / 1e3, waiting / 1e3, what or "the browser itself")
