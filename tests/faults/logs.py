"""What workers and API wrote, line by line: who began what, who ended it, who was told off."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Final


@dataclass(frozen=True)
class Line:
    """One line about a job, or about all (no id); `at` is seconds since the epoch."""

    at: float
    action: str
    job_id: str
    message: str

    @property
    def says_rebuilt(self) -> bool:
        """Whether all records are back; not that one of them is not, nor that they were lost again meanwhile."""
        return self.message.startswith("records rebuilt") and not self.message.endswith("lost again")


FOUND: Final = {"reconcile-lost", "reconcile-orphan", "lose", "hand-on", "rebuild"}


@dataclass(frozen=True)
class Recovery:
    """What the time between the loss of a worker and the next one at work was made of, in seconds.

    Attributes:
        found: until the job was free again, and sent.
        queued: in the queue, behind those that were lost before it, for want of a free worker.
        begun: from the claim to the runner that computes.

    """

    found: float
    queued: float
    begun: float

    @property
    def ours(self) -> float:
        """Without the wait for a free worker, which more workers would shorten."""
        return self.found + self.begun


@dataclass
class Logs:
    """All ``worker-*.log`` and ``api*.log`` of a stack, read on from where the last look ended."""

    folder: Path
    _read: dict[Path, int] = field(default_factory=dict)
    _lines: dict[Path, list[Line]] = field(default_factory=dict)

    def lines(self) -> list[Line]:
        """Return everything about jobs so far, in order of time."""
        self._look()
        return sorted((line for lines in self._lines.values() for line in lines), key=lambda line: line.at)

    def count(self, action: str) -> int:
        """Return how often something happened."""
        return sum(line.action == action for line in self.lines())

    def runner_of(self, job_id: str) -> int | None:
        """Return the process that the last attempt at a job computes in."""
        starts = [line for line in self.lines() if (line.action, line.job_id) == ("start", job_id)]
        return int(starts[-1].message.rpartition(" ")[2]) if starts else None

    def own_ends(self) -> Iterator[str]:
        """Yield the job of every end that was committed by the attempt that computed it.

        One that an attempt found written already and only told the record (``adopt``) is not its own.
        """
        self._look()
        for lines in self._lines.values():
            adopted: set[str] = set()
            for line in lines:
                if line.action == "adopt":
                    adopted.add(line.job_id)
                elif line.action == "commit":
                    if line.job_id not in adopted:
                        yield line.job_id
                    adopted.discard(line.job_id)

    def recovery(self, job_id: str, at: float) -> Recovery | None:
        """Return how a job that lost its worker at a moment came to be computed again; None if it was not."""
        found = claimed = None
        for line in self.lines():
            if line.at <= at or line.job_id not in {job_id, ""}:
                continue
            if line.action in FOUND:
                found, claimed = found or line.at, None  # what was claimed before was lost as well
            elif line.action == "claim":
                claimed = line.at
            elif line.action == "start" and claimed is not None:
                found = min(found or claimed, claimed)
                return Recovery(found - at, claimed - found, line.at - claimed)
        return None

    def rebuilt(self, at: float) -> float | None:
        """Return how long after a moment the records were all back, in seconds; None if nobody said so."""
        return next((line.at - at for line in self.lines() if line.at > at and line.says_rebuilt), None)

    def _look(self) -> None:
        for path in [*self.folder.glob("worker-*.log"), *self.folder.glob("api*.log")]:
            with path.open("rb") as file:
                file.seek(self._read.get(path, 0))
                content = file.read()
            whole = content[: content.rfind(b"\n") + 1]
            self._read[path] = self._read.get(path, 0) + len(whole)
            self._lines.setdefault(path, []).extend(filter(None, map(_parsed, whole.splitlines())))


def _parsed(text: bytes) -> Line | None:
    try:
        line = json.loads(text)
        return Line(
            datetime.fromisoformat(line["time"]).timestamp(),
            line["action"],
            line.get("job_id", ""),
            line["message"],
        )
    except (ValueError, KeyError, TypeError):  # of a program killed in the middle of it, or about no job
        return None
