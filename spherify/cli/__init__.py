"""The command line: `spherify up`, `demo`, `morph`, `submit`, `samples`, `gallery`; one file a command."""

from __future__ import annotations

import gc

from spherify.cli.commands import app


def main() -> None:
    """Run the command line."""
    # What is imported stays: to look through it at the default threshold is a tenth of a short run.
    gc.set_threshold(50_000)
    app()
