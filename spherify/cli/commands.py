"""The application: every command, and the options that belong to none."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Annotated, Any, Final

import typer
from typer.core import TyperGroup

from spherify import __version__

COMMANDS: Final = ("up", "demo", "morph", "submit", "samples", "gallery")
_STYLE: Final[dict[str, Any]] = {
    "rich_markup_mode": None,
    "pretty_exceptions_enable": False,
    "context_settings": {"help_option_names": ["-h", "--help"]},
}


class _OnDemand(Mapping[str, Any]):
    """The commands by name; each file is imported when its command is asked for.

    What `up` and `demo` need of the service takes as long to import as all that `morph` does with a small mesh.
    """

    def __getitem__(self, name: str) -> Any:  # noqa: ANN401 - typer's own copy of click
        if name not in COMMANDS:
            raise KeyError(name)
        alone = typer.Typer(add_completion=False, **_STYLE)
        alone.command(name)(getattr(import_module(f"spherify.cli.{name}"), name))
        return typer.main.get_command(alone)

    def __iter__(self) -> Iterator[str]:
        return iter(COMMANDS)

    def __len__(self) -> int:
        return len(COMMANDS)


class _Group(TyperGroup):
    def __init__(self, **options: Any) -> None:  # noqa: ANN401 - as above
        super().__init__(**options)
        self.commands = _OnDemand()  # type: ignore[assignment] # it is only read


app: Final = typer.Typer(
    name="spherify",
    cls=_Group,
    help="Morph triangle meshes into round spheres by Vartziotis's curvature transformation.",
    no_args_is_help=True,
    **_STYLE,
)


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
