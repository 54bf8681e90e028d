"""The command line: `spherify up`, `demo`, `morph`, `submit`, `samples`, `gallery`; one file a command."""

from __future__ import annotations

import gc
import os
import sys
from contextlib import suppress

from spherify.cli.commands import app
from spherify.cli.console import FAILED, warn


def main() -> None:
    """Run the command line."""
    # What is imported stays: to look through it at the default threshold is a tenth of a short run.
    gc.set_threshold(50_000)
    try:
        app()
    except OSError as e:
        if e.filename is not None:
            raise
        with suppress(OSError):
            warn(f"what there is to say cannot be written: {e.strerror}")
        # What is still held would be tried again at the very end, and be lost again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(FAILED)
