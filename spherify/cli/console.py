"""What all commands say, how they say it, and the codes they end with."""

from __future__ import annotations

from typing import Any, Final, NoReturn

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn
from rich.table import Column
from rich.text import Text

FAILED: Final = 1  # it could not be done: no service, no port, no space
REFUSED: Final = 2  # a wrong option, or a mesh that cannot be morphed
COLLAPSED: Final = 3  # the run broke; its best state is written
INTERRUPTED: Final = 130  # Ctrl-C; what there was is written

COLOURS: Final = {"api": "36", "server": "35", "spherify": "1"}  # of programs, as terminals number them

err: Final = Console(stderr=True, highlight=False, soft_wrap=True)
out: Final = Console(highlight=False, soft_wrap=True)


def fail(sentence: str, code: int = FAILED) -> NoReturn:
    """Say why on standard error and end with that code."""
    err.print(f"spherify: {sentence}", markup=False)
    raise typer.Exit(code)


def code_of(job: dict[str, Any]) -> int:
    """Return what a finished job, as the API tells it, lets a command end with."""
    if job["status"] == "successful":
        return 0
    return COLLAPSED if job["stop_reason"] == "collapsed" else FAILED


def warn(sentence: str) -> None:
    """Say something on standard error and go on."""
    err.print(f"spherify: {sentence}", markup=False)


class Rate(ProgressColumn):
    """Iterations a second, and the seconds left if nothing ends the run before."""

    def render(self, task: Task) -> Text:
        """Return the column's text."""
        rate, eta = task.fields.get("rate"), task.fields.get("eta")
        if rate is None or task.finished:
            return Text("")
        left = "" if eta is None else f"  {clock(eta)} left at most"
        return Text(f"{rate:,.0f} it/s{left}", style="cyan")


def progress_bar() -> Progress:
    """Return a display of bars whose tasks have the fields ``rate``, ``eta`` and ``note``."""
    return Progress(
        TextColumn("{task.description}", markup=False, table_column=Column(no_wrap=True, max_width=40)),
        BarColumn(bar_width=28),
        TextColumn("{task.completed:.0f}/{task.total:.0f}", markup=False),
        TextColumn("{task.fields[note]}", markup=False),
        Rate(),
        console=err,
        refresh_per_second=5,
    )


def clock(seconds: float) -> str:
    """Return seconds as 0:42 or 1:02:03."""
    whole = max(round(seconds), 0)
    hours, minutes = divmod(whole // 60, 60)
    return f"{hours}:{minutes:02}:{whole % 60:02}" if hours else f"{minutes}:{whole % 60:02}"
