"""`spherify up`: the whole service on this machine until Ctrl-C."""

from __future__ import annotations

import sys
import threading
import time
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Final

import typer

from spherify import __version__
from spherify.cli.console import COLOURS, fail
from spherify.cli.gallery import Gallery
from spherify.cli.inputs import read_settings
from spherify.cli.interruption import interruptible
from spherify.cli.stack import DEFAULT, LOOK_S, Address, Stack, StackError
from spherify.stores.embedded import EmbeddedServerError

BANNER: Final = """
Spherify {version} is ready.

  web page       {url}
  API            {url}/v1
  documentation  {url}/docs
  data           {data} (kept between runs)
  job records    {records}

  spherify samples -o samples
  curl -F file=@samples/quadruped.obj -F iterations=1000 -F snapshots=10,50,100 {url}/v1/jobs
  curl {url}/v1/jobs/JOB_ID
  curl -OJ {url}/v1/jobs/JOB_ID/snapshots/final.ply

Ctrl-C stops everything; jobs that are not done go on at the next start.
"""
OPEN_DOOR: Final = "Everybody who reaches port {port} of this machine may use it: there are no keys.\n"
FULL: Final = (
    "The data folder is full: uploads are refused until jobs that are no longer needed are deleted, or\n"
    "SPHERIFY_MIN_FREE_BYTES keeps less in reserve.\n"
)

_saying = threading.Lock()


def up(
    host: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Address to listen on; 0.0.0.0 is every one.")
    ] = DEFAULT.host,
    port: Annotated[
        int, typer.Option(min=0, max=65535, metavar="PORT", help="Port to listen on; 0 is any free one.")
    ] = DEFAULT.port,
    data: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder for everything that is kept; by default SPHERIFY_DATA_DIR."),
    ] = None,
    workers: Annotated[
        int, typer.Option(min=1, max=256, metavar="N", help="Number of jobs computed at the same time.")
    ] = 1,
    gallery: Annotated[
        bool, typer.Option(help="Make a run of each sample shape at the first start, for the web page.")
    ] = True,
) -> None:
    """Run the service on this machine until Ctrl-C: API, workers, and a server of its own unless REDIS_URL is set."""
    settings = read_settings()
    folder = data or settings.data_dir
    shared = "redis_url" in settings.model_fields_set and bool(settings.redis_url)
    redis_url = settings.redis_url if shared else None
    with interruptible() as stopping:
        try:
            with Stack(Address(host, port), folder, workers, say, redis_url=redis_url) as stack:
                stack.start(leave=lambda: bool(stopping))
                if not stopping:
                    records = (
                        settings.url_without_password if shared else "a server of its own, in the data folder"
                    )
                    print_plain(
                        BANNER.format(
                            version=__version__, url=stack.url, data=stack.data_dir, records=records
                        )
                    )
                    if not stack.on_loopback:
                        print_plain(OPEN_DOOR.format(port=stack.port))
                    if stack.is_full:
                        print_plain(FULL)
                shows = gallery and not stopping and not stack.is_full
                with Gallery(stack.url, say) if shows else nullcontext():
                    while not stopping:
                        stack.tend()
                        time.sleep(LOOK_S)
                say("spherify", "stopping …")
        except (StackError, EmbeddedServerError) as e:
            fail(str(e))
        except OSError as e:
            fail(f"{e.filename or folder}: {e.strerror or e}")
    say("spherify", "stopped")


def say(program: str, line: str) -> None:
    """Print a line of a program under its name; may be called from any thread."""
    name = f"{program:<9}│ "
    if sys.stderr.isatty():
        colour = COLOURS.get(program, "32")
        name = f"\x1b[{colour}m{name}\x1b[0m"
    print_plain(f"{name}{line}\n")


def print_plain(text: str) -> None:
    """Write text as it is: what programs say is no markup, and is not to be wrapped."""
    with _saying:
        sys.stderr.write(text)
        sys.stderr.flush()
