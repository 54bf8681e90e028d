"""Server-sent events as a client reads them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import httpx


@dataclass
class Event:
    """One event, or a comment."""

    name: str = ""
    data: Any = None
    id: str = ""
    comments: list[str] = field(default_factory=list)
    retry: int | None = None


def parse(lines: Iterator[str]) -> Iterator[Event]:
    """Read a stream as the HTML standard has it, comments included."""
    event = Event()
    for line in lines:
        if not line:
            yield event
            event = Event()
        elif line.startswith(":"):
            event.comments.append(line[1:].strip())
        else:
            name, _, value = line.partition(": ")
            if name == "data":
                event.data = json.loads(value)
            elif name == "retry":
                event.retry = int(value)
            else:
                assert name in {"event", "id"}, line
                setattr(event, "name" if name == "event" else "id", value)


@contextmanager
def events(client: httpx.Client, job_id: str, last: str | None = None) -> Iterator[Iterator[Event]]:
    """Open a stream; the first block, which names the time to come back after, is read."""
    headers = {} if last is None else {"Last-Event-ID": last}
    with client.stream("GET", f"/v1/jobs/{job_id}/events", headers=headers) as answer:
        assert answer.status_code == 200, answer.read()
        assert answer.headers["content-type"].startswith("text/event-stream")
        found = parse(answer.iter_lines())
        assert next(found).retry == 1000
        yield found


def until(found: Iterator[Event], name: str) -> list[Event]:
    """Read up to an event of this name, and return what was read."""
    read = []
    for event in found:
        read.append(event)
        if event.name == name:
            return read
    raise AssertionError(f"the stream ended without {name}: {[event.name for event in read]}")
