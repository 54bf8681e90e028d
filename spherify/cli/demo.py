"""`spherify demo`: the real stack, one mesh through it over HTTP, snapshots and a picture of them."""

from __future__ import annotations

import errno
import os
import tempfile
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from rich.table import Table

from spherify.cli.console import INTERRUPTED, REFUSED, code_of, err, fail, out, progress_bar
from spherify.cli.inputs import SAMPLE as SAMPLE_PREFIX
from spherify.cli.inputs import MethodOption, PresetOption, read_settings, sample
from spherify.cli.interruption import interruptible
from spherify.cli.snapshots import snapshot_name
from spherify.cli.stack import DEFAULT, Address, Stack, StackError
from spherify.cli.submit import show
from spherify.client import Client, RefusedError, ServiceError, UnreachableError
from spherify.formats import ReadLimits, write_mesh
from spherify.formats.acceptance import read
from spherify.geometry.mesh import TriangleMesh
from spherify.stores.embedded import EmbeddedServerError

SAMPLE: Final = "quadruped"
SAMPLE_VERTICES: Final = 2000
SNAPSHOTS: Final = "5,15,30,60"
ITERATIONS: Final = 300
PANELS: Final = 6
FORMATS: Final = ("obj", "ply")
LOG_LINES: Final = 20  # of the programs, shown if one of them fails


def demo(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="[FILE]", help="A mesh, or a sample such as sample:head; by default an animal."
        ),
    ] = None,
    *,
    folder: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the snapshots and the picture.")
    ] = Path("demo-output"),
    method: MethodOption = None,
    preset: PresetOption = None,
    iterations: Annotated[
        int, typer.Option(min=1, metavar="N", help="Maximum number of iterations.")
    ] = ITERATIONS,
    up_axis: Annotated[
        str, typer.Option("--up", metavar="AXIS", help="Axis that stands upright in the picture: x, y or z.")
    ] = "z",
) -> None:
    """Start the whole service, morph a mesh through it over HTTP, save snapshots and a picture, stop it again."""
    if up_axis not in {"x", "y", "z"}:
        fail(f"--up must be x, y or z, not {up_axis!r}", REFUSED)
    read_settings()  # before anything is started
    with interruptible() as stopping:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(prefix="spherify-demo-") as scratch:
                mesh = _mesh(file, Path(scratch))
                fields = {"iterations": str(iterations), "snapshots": _plan(iterations)}
                fields |= {k: v for k, v in (("method", method), ("preset", preset)) if v is not None}
                job, figures = _through_the_stack(mesh, fields, folder, Path(scratch) / "data", stopping)
        except InterruptedError:
            fail("interrupted; everything is stopped", INTERRUPTED)
        except RefusedError as e:
            fail(f"{mesh.name}: {e}", REFUSED)
        except (ServiceError, StackError, EmbeddedServerError) as e:
            fail(str(e))
        except OSError as e:
            fail(f"{e.filename}: {e.strerror}", REFUSED)
    picture = _picture(folder, mesh.stem, figures, up_axis)
    _tell(job, figures, folder, picture)
    if job["status"] != "successful":
        fail(job["error"]["detail"] if job["error"] else job["status"], code_of(job))


def _mesh(file: Path | None, scratch: Path) -> Path:
    """Return the mesh's file, of a sample a new one in ``scratch``; ends the program if there is none."""
    text = f"{SAMPLE_PREFIX}{SAMPLE}:{SAMPLE_VERTICES}" if file is None else str(file)
    if text.startswith(SAMPLE_PREFIX):
        name = text.removeprefix(SAMPLE_PREFIX)
        path = scratch / f"{name.partition(':')[0]}.obj"
        path.write_bytes(write_mesh(sample(name), "obj"))
        return path
    path = Path(text)
    if not path.exists():  # before anything is started
        fail(f"{path}: {os.strerror(errno.ENOENT)}", REFUSED)
    return path


def _plan(iterations: int) -> str:
    """Return the early states that show most, as far as the run goes."""
    return ",".join(n for n in SNAPSHOTS.split(",") if int(n) <= iterations)


def _through_the_stack(
    mesh: Path, fields: dict[str, str], folder: Path, data: Path, stopping: list[int]
) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Start everything, morph one mesh, stop everything; returns the job and its snapshots."""
    log: deque[str] = deque(maxlen=LOG_LINES)
    with Stack(
        Address(DEFAULT.host, 0), data, 1, lambda name, line: log.append(f"  {name}: {line}"), redis_url=None
    ) as stack:

        def meanwhile() -> None:
            if stopping:
                raise InterruptedError
            stack.tend()

        err.print("Starting a server, the API and a worker …")
        stack.start(leave=lambda: bool(stopping))
        meanwhile()
        err.print(f"The API is at {stack.url}; uploading {mesh.name}.", markup=False)
        try:
            job, figures = _journey(stack.url, mesh, fields, folder, meanwhile)
        except UnreachableError as e:
            raise ServiceError("\n".join([str(e), *log])) from e
        err.print("Stopping them …")
    return job, figures


def _journey(
    url: str, mesh: Path, fields: dict[str, str], folder: Path, meanwhile: Callable[[], None]
) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Upload, follow and download; returns the job and its snapshots."""
    with Client(url) as client, progress_bar() as bars:
        task = bars.add_task(mesh.name, total=1, note="uploading", rate=None, eta=None)
        job = client.submit(mesh, dict(fields))
        saved: set[int] = set()
        for job in client.follow(job["id"], meanwhile=meanwhile):  # noqa: B020 (the newest is what counts)
            show(bars, task, job)
            for iteration in (i for i in job["snapshots"]["available"] if i not in saved):
                for form in FORMATS:
                    client.download(
                        job["id"], iteration, form, folder / snapshot_name(mesh.stem, iteration, form)
                    )
                saved.add(iteration)
        return job, client.snapshots(job["id"])


def _picture(folder: Path, stem: str, figures: list[dict[str, Any]], up_axis: str) -> Path:
    """Draw the snapshots that were saved, the last one included."""
    from spherify.pictures import Panel, View, side_by_side  # noqa: PLC0415 (matplotlib takes a second to import)

    shown = figures if len(figures) <= PANELS else [*figures[: PANELS - 1], figures[-1]]
    panels = []
    for item in shown:
        path = folder / snapshot_name(stem, item["iteration"], "ply")
        # parsed here and not judged: the file is ours, and all panels need the same vertices
        raw = read(path.read_bytes(), "ply", ReadLimits())
        mesh = TriangleMesh.checked(raw.vertices, raw.faces)
        panels.append(Panel(mesh, f"iteration {item['iteration']}", f"Ψ {item['metrics']['sphericity']:.4f}"))
    target = folder / f"{stem}.png"
    target.write_bytes(side_by_side(panels, view=View(up=up_axis)))
    return target


def _tell(job: dict[str, Any], figures: list[dict[str, Any]], folder: Path, picture: Path) -> None:
    table = Table("iteration", "Ψ", "radius variation", "inward faces", box=None, pad_edge=False)
    for item in figures:
        metrics = item["metrics"]
        table.add_row(
            str(item["iteration"]),
            f"{metrics['sphericity']:.4f}",
            f"{metrics['radius_variation']:.4f}",
            str(metrics["inward_faces"]),
        )
    out.print(table)
    reason = job["stop_reason"] or job["status"]
    progress = job["progress"]
    out.print(f"\nended as {reason}: {progress['iteration']} iterations, {progress['elapsed_s']:.1f} s")
    out.print(f"snapshots  {folder}/*.obj, *.ply\npicture    {picture}", markup=False)
    out.print(
        f"web page   `make up` or `spherify up`, then http://{DEFAULT.host}:{DEFAULT.port}/", markup=False
    )
