"""`spherify submit`: several meshes to a service, each with a bar, snapshots saved as they appear."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from rich.progress import Progress as Bars
from rich.progress import TaskID

from spherify.cli.console import FAILED, INTERRUPTED, REFUSED, err, fail, progress_bar
from spherify.cli.inputs import MethodOption, PresetOption
from spherify.cli.interruption import interruptible
from spherify.client import Client, ServiceError
from spherify.formats import FORMATS_OUT

AT_ONCE: Final = 8


def submit(
    files: Annotated[list[Path], typer.Argument(metavar="FILE…", help="Mesh files.")],
    *,
    url: Annotated[
        str, typer.Option(help="Where the service is.", envvar="SPHERIFY_URL")
    ] = "http://127.0.0.1:8000",
    folder: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Where the snapshots go.")
    ] = Path(),
    method: MethodOption = None,
    preset: PresetOption = None,
    iterations: Annotated[int | None, typer.Option(help="At most so many; the preset's by default.")] = None,
    snapshots: Annotated[str | None, typer.Option(help="100,500 or every:100 or log:12.")] = None,
    mesh_format: Annotated[str, typer.Option("--format", help="Of the files that are saved.")] = "ply",
    assignments: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Change one parameter; repeatable."),
    ] = None,
    allow: Annotated[
        list[str] | None,
        typer.Option(help="Let through: boundary, components, genus or nonmanifold-vertex; repeatable."),
    ] = None,
) -> None:
    """Morph meshes on a service and save their snapshots as they appear.

    Ends with 0 if all succeeded, 1 if any could not be had (what there is of it is saved), 2 for a wrong option,
    and 130 after Ctrl-C, with the jobs going on.
    """
    if mesh_format not in FORMATS_OUT:
        fail(f"--format must be one of {', '.join(FORMATS_OUT)}, not {mesh_format!r}", REFUSED)
    fields: dict[str, str | list[str]] = {}
    if method is not None:
        fields["method"] = method
    if preset is not None:
        fields["preset"] = preset
    for text in assignments or []:
        name, equals, value = text.partition("=")
        if not equals:
            fail(f"--set takes name=value, not {text!r}", REFUSED)
        fields[name] = value
    if iterations is not None:
        fields["iterations"] = str(iterations)
    if snapshots is not None:
        fields["snapshots"] = snapshots
    if allow:
        fields["allow"] = allow
    try:
        folder.mkdir(parents=True, exist_ok=True)
        client = Client(url)
    except OSError as e:
        fail(f"{folder} cannot be made: {e.strerror}", REFUSED)
    except ServiceError as e:
        fail(f"--url: {e}", REFUSED)
    with interruptible() as stopping, client, progress_bar() as bars, ThreadPoolExecutor(AT_ONCE) as pool:
        errands = [
            _Errand(client, path, fields, mesh_format, folder / stem, bars, _bar(bars, path.name), stopping)
            for path, stem in zip(files, _stems(files), strict=True)
        ]
        succeeded = list(pool.map(_Errand.run, errands))
    if stopping:
        fail("interrupted; what was accepted goes on, see `curl URL/v1/jobs`", INTERRUPTED)
    if not all(succeeded):
        raise typer.Exit(FAILED)


class _LeftError(Exception):
    """The user pressed Ctrl-C."""


@dataclass
class _Errand:
    """One file's way through the service."""

    client: Client
    path: Path
    fields: dict[str, str | list[str]]
    mesh_format: str
    target: Path
    bars: Bars
    task: TaskID
    stopping: list[int]

    def run(self) -> bool:
        """Upload, follow, download; returns whether all went well, and says so where it did not."""
        try:
            return self._run()
        except _LeftError:
            return False
        except ServiceError as e:
            return self._failed(str(e))
        except OSError as e:
            return self._failed(
                f"{e.filename}: {e.strerror}" if e.filename != str(self.path) else str(e.strerror)
            )

    def _run(self) -> bool:
        self._look_up()
        job = self.client.submit(self.path, self.fields)
        saved: set[int] = set()
        for job in self.client.follow(job["id"], meanwhile=self._look_up):  # noqa: B020 (the newest is what counts)
            show(self.bars, self.task, job)
            for iteration in job["snapshots"]["available"]:
                if iteration not in saved:
                    self._save(job["id"], iteration)
                    saved.add(iteration)
        if job["status"] == "successful":
            return True
        return self._failed(job["error"]["detail"] if job["error"] else f"job {job['id']} was cancelled")

    def _look_up(self) -> None:
        if self.stopping:
            raise _LeftError

    def _save(self, job_id: str, iteration: int) -> None:
        target = self.target.with_name(f"{self.target.name}_it{iteration:05d}.{self.mesh_format}")
        self.client.download(job_id, iteration, self.mesh_format, target)

    def _failed(self, sentence: str) -> bool:
        self.bars.update(self.task, note="failed", rate=None)
        err.print(f"{self.path.name}: {sentence}", markup=False)
        return False


def show(bars: Bars, task: TaskID, job: dict[str, Any]) -> None:
    """Let a bar show how far a job is."""
    progress, figures = job["progress"], job["metrics"] or {}
    sphericity = figures.get("sphericity")
    ended = job["status"] in {"successful", "failed", "cancelled"}
    total = progress["iteration"] if ended else progress["iterations_total"]
    bars.update(
        task,
        completed=max(progress["iteration"], 1) if ended else progress["iteration"],
        total=max(total, 1),
        note=(f"Ψ {sphericity:.4f} " if sphericity is not None else "")
        + (job["stop_reason"] or job["status"] if ended else job["status"]),
        rate=progress["iterations_per_s"],
        eta=progress["eta_s"],
    )


def _bar(bars: Bars, name: str) -> TaskID:
    return bars.add_task(name, total=1, note="uploading", rate=None, eta=None)


def _stems(files: list[Path]) -> list[str]:
    """Return a name for each file, none twice."""
    stems: list[str] = []
    for path in files:
        stem, number = path.stem, 2
        while stem in stems:
            stem, number = f"{path.stem}-{number}", number + 1
        stems.append(stem)
    return stems
