"""The command line: `spherify up`, `demo`, `morph`, `submit`, `samples`, `gallery`; one file a command."""

from __future__ import annotations

from spherify.cli.commands import app


def main() -> None:
    """Run the command line."""
    app()
