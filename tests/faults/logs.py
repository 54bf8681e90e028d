"""What the workers wrote, line by line: who began what, who ended it, who was told off."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path


@dataclass(frozen=True)
class Line:
    """One line about a job; `at` is seconds since the epoch."""

    at: float
    action: str
    job_id: str
    message: str


@dataclass
class Logs:
    """All ``worker-*.log`` of a stack, read on from where the last look ended."""

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

    def recovery_s(self, job_id: str, at: float) -> float | None:
        """Return how long after a moment a job was sent or begun again; None if it was not."""
        for line in self.lines():
            if line.job_id == job_id and line.at > at and line.action in {"reconcile-lost", "start"}:
                return line.at - at
        return None

    def _look(self) -> None:
        for path in self.folder.glob("worker-*.log"):
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
            datetime.fromisoformat(line["time"]).timestamp(), line["action"], line["job_id"], line["message"]
        )
    except (ValueError, KeyError, TypeError):  # of a program killed in the middle of it, or about no job
        return None
