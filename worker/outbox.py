"""What the runner said and the record does not know yet: kept while the server does not answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from spherify.jobs.codec import load_progress, load_snapshot
from spherify.jobs.model import Progress, Snapshot
from spherify.jobs.ports import JobStore, Kept
from spherify.jobs.rows import Row


class Outbox:
    """Snapshots and rows of one attempt, and which of them are recorded."""

    def __init__(self, jobs: JobStore, job_id: str, token: int) -> None:
        self._jobs = jobs
        self._job_id = job_id
        self._token = token
        self._snapshots: dict[int, Snapshot] = {}
        self._rows: dict[int, Row] = {}
        self._unsent_kept: Kept | None = None
        self._unsent_snapshots: list[Snapshot] = []
        self._unsent_rows: list[Row] = []
        self._unsent_progress: Progress | None = None
        self._progress: Progress | None = None

    def take_in(self, event: Mapping[str, Any]) -> None:
        """Remember the content of a ``snapshot``, ``report`` or ``anew``."""
        if event["event"] == "anew":
            # The others are of an earlier attempt: known until they are made again, and not by the end if they are not.
            others = [load_snapshot(other) for other in event["others"]]
            stay = {*event["snapshots"], *(other.iteration for other in others)}
            self._unsent_kept = Kept(frozenset(stay), frozenset(event["rows"]))
            self._unsent_snapshots += others
        elif event["event"] == "snapshot":
            snapshot = load_snapshot(event["snapshot"])
            self._snapshots[snapshot.iteration] = snapshot
            self._unsent_snapshots.append(snapshot)
        else:
            self.add_rows(event["rows"])
            self._progress = self._unsent_progress = load_progress(event["progress"])

    def add_rows(self, rows: list[Row]) -> None:
        """Remember rows, to be sent with the next progress."""
        self._rows.update({int(row["iteration"]): row for row in rows})
        self._unsent_rows += rows

    def reached(self, before: Progress | None) -> Progress | None:
        """Return how far it came if the runner did not live to say so, from how far it was before.

        That is what it told last, or its last state: that may have been told later.
        """
        progress = self._progress or before
        if progress is not None and self.latest is not None and self.latest > progress.iteration:
            return replace(progress, iteration=self.latest)
        return progress

    def send_end(self, progress: Progress | None) -> None:
        """Let the next flush tell the last progress: not before the end is durable."""
        self._unsent_progress = progress or self._unsent_progress

    def flush(self) -> bool:
        """Record what is not yet; False if the attempt is not the present one. Raises `StoreUnavailableError`."""
        if self._unsent_kept is not None:  # before anything of our own
            if not self._jobs.disown(self._job_id, self._token, self._unsent_kept):
                return False
            self._unsent_kept = None
        if self._unsent_progress is not None:  # first: it is never behind the newest snapshot
            if not self._jobs.report(self._job_id, self._token, self._unsent_progress, self._unsent_rows):
                return False
            self._unsent_progress, self._unsent_rows = None, []
        while self._unsent_snapshots:
            if not self._jobs.add_snapshot(self._job_id, self._token, self._unsent_snapshots[0]):
                return False
            del self._unsent_snapshots[0]
        return True

    @property
    def snapshots(self) -> tuple[Snapshot, ...]:
        """All of this attempt, ascending."""
        return tuple(self._snapshots[i] for i in sorted(self._snapshots))

    @property
    def latest(self) -> int | None:
        """Iteration of the last snapshot."""
        return max(self._snapshots, default=None)

    @property
    def best(self) -> int | None:
        """Iteration of the snapshot of the highest sphericity."""
        return max(self._snapshots, key=lambda i: self._snapshots[i].metrics["sphericity"], default=None)

    @property
    def rows(self) -> tuple[Row, ...]:
        """All of this attempt, ascending."""
        return tuple(self._rows[i] for i in sorted(self._rows))
