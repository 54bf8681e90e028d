"""The command line: `spherify up`, `demo`, `morph`, `submit`, `samples`; one file a command."""

from __future__ import annotations


def main() -> None:
    """Run the command line."""
    # Here, not above: the API's process is started as a module of this package and needs no command.
    from spherify.cli.commands import app  # noqa: PLC0415

    app()
