"""The application: every command, and the options that belong to none."""

from __future__ import annotations

from typing import Annotated, Final

import typer

from spherify import __version__
from spherify.cli.demo import demo
from spherify.cli.morph import morph
from spherify.cli.samples import samples
from spherify.cli.submit import submit
from spherify.cli.up import up

app: Final = typer.Typer(
    name="spherify",
    help="Morph triangle meshes into round spheres by Vartziotis's curvature transformation.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command in (up, demo, morph, submit, samples):
    app.command()(command)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"spherify {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and stop.")
    ] = False,
) -> None:
    """Take the options that belong to no command."""
