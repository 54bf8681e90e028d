"""The processes of this machine, for tests that kill some and must see others end."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from tests.stack import wait_for


@dataclass(frozen=True)
class Seen:
    """A process, told apart from a later one of the same number by the moment it started."""

    pid: int
    parent: int
    started: str
    command: str

    def gone(self) -> bool:
        """Whether it has ended."""
        now = processes().get(self.pid)
        return now is None or now.started != self.started


def processes() -> dict[int, Seen]:
    """Return all processes that have not ended, by number."""
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            state, parent, *others = (folder / "stat").read_text().rpartition(")")[2].split()
            command = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
        except (FileNotFoundError, ProcessLookupError):
            continue  # it ended while we looked
        if state not in "ZX":
            found[int(folder.name)] = Seen(int(folder.name), int(parent), others[17], command)
    return found


def below(pid: int, containing: str = "") -> list[Seen]:
    """Return the children of a process whose command line has a text in it, their children, and so on."""
    everything = processes().values()
    found: list[Seen] = []
    parents = {pid}
    while parents:
        level = [seen for seen in everything if seen.parent in parents]
        found += level
        parents = {seen.pid for seen in level}
    return [seen for seen in found if containing in seen.command]


def working_in(folder: Path) -> list[Seen]:
    """Return the processes that were started to work in a data folder, orphans included; this one is left out."""
    found = []
    for seen in processes().values():
        try:
            environment = Path(f"/proc/{seen.pid}/environ").read_bytes()
        except (FileNotFoundError, ProcessLookupError, PermissionError):
            continue
        if seen.pid != os.getpid() and str(folder).encode() in environment:
            found.append(seen)
    return found


def await_gone(seen: list[Seen]) -> None:
    """Wait until all of these have ended."""
    wait_for(lambda: all(one.gone() for one in seen), what=f"the end of {seen}")
