"""`spherify submit`: several meshes to a service, each with a bar, snapshots saved as they appear."""

from __future__ import annotations

import hashlib
import json
import platform
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from rich.progress import Progress as Bars
from rich.progress import TaskID

from spherify.cli.console import FAILED, INTERRUPTED, REFUSED, code_of, err, fail, progress_bar
from spherify.cli.inputs import AllowOption, AssignmentsOption, IterationsOption, MethodOption, PresetOption
from spherify.cli.interruption import interruptible
from spherify.cli.snapshots import snapshot_name, stem_and_form
from spherify.client import Client, InvalidAddressError, RefusedError, ServiceError
from spherify.formats import FORMATS_OUT

AT_ONCE: Final = 8
# Answers that blame the mesh or an option, and would be the same tomorrow.
_OURS: Final = frozenset({400, 413, 415, 422})


def submit(
    files: Annotated[list[Path], typer.Argument(metavar="FILE…", help="Mesh files.")],
    *,
    url: Annotated[
        str, typer.Option(metavar="URL", help="Address of the service.", envvar="SPHERIFY_URL")
    ] = "http://127.0.0.1:8000",
    folder: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the snapshots.")
    ] = Path(),
    method: MethodOption = None,
    preset: PresetOption = None,
    iterations: IterationsOption = None,
    snapshots: Annotated[
        str | None, typer.Option(metavar="WHICH", help="States to save: 100,500 or every:100 or log:12.")
    ] = None,
    mesh_format: Annotated[
        str,
        typer.Option(
            "--format", metavar="FORMAT", help=f"Format of the saved files: {', '.join(FORMATS_OUT)}."
        ),
    ] = "ply",
    assignments: AssignmentsOption = None,
    allow: AllowOption = None,
    anew: Annotated[
        bool, typer.Option("--anew", help="Compute again what was submitted with the same options before.")
    ] = False,
) -> None:
    """Morph meshes on a service and save their snapshots as they appear.

    Interrupted, it can be given again: a file that was accepted within the last day, from here, with the same options
    and for the same folder, is not computed again, but followed, and its snapshots are saved.

    Exit codes: 0 if all succeeded; 2 if an option or the mesh was refused; 3 if the run collapsed (its best state is
    saved); 1 if it failed for another reason, or if of several meshes only some succeeded or they failed differently;
    130 after Ctrl-C, with the jobs going on.
    """
    if mesh_format not in FORMATS_OUT:
        fail(f"--format must be one of {', '.join(FORMATS_OUT)}, not {mesh_format!r}", REFUSED)
    stems = _stems(files)
    if taken := _overwritten(files, stems, folder, mesh_format):
        fail(f"a snapshot could take the place of {taken}: name another folder with -o", REFUSED)
    fields = _fields(method, preset, assignments or [], iterations, snapshots)
    if allow:
        fields["allow"] = allow
    try:
        folder.mkdir(parents=True, exist_ok=True)
        client = Client(url)
    except OSError as e:
        fail(f"{folder} cannot be made: {e.strerror}", REFUSED)
    except InvalidAddressError as e:
        fail(f"--url: {e}", REFUSED)
    with interruptible() as stopping, client, progress_bar() as bars, ThreadPoolExecutor(AT_ONCE) as pool:
        whole = _Whole(bars, len(files))
        errands = [
            _Errand(
                client,
                path,
                name,
                fields,
                mesh_format,
                folder / stem,
                bars,
                _bar(bars, name),
                whole,
                stopping,
                anew,
            )
            for path, name, stem in zip(files, _names(files), stems, strict=True)
        ]
        codes = set(pool.map(_Errand.run, errands))
        for errand in errands:  # the last that is drawn may be as long as it likes
            bars.update(errand.task, visible=errand.begun)
    if stopping:
        accepted = sum(errand.accepted for errand in errands)
        fail(
            f"interrupted; {accepted} of {len(files)} files were accepted, and their jobs go on: "
            f"{client.url}/v1/jobs. The same command fetches their results and sends the others",
            INTERRUPTED,
        )
    raise typer.Exit(codes.pop() if len(codes) == 1 else FAILED)


def _fields(
    method: str | None,
    preset: str | None,
    assignments: list[str],
    iterations: int | None,
    snapshots: str | None,
) -> dict[str, str | list[str]]:
    """Return the fields of the form; ends the program where an assignment is none."""
    fields: dict[str, str | list[str]] = {}
    if method is not None:
        fields["method"] = method
    if preset is not None:
        fields["preset"] = preset
    for text in assignments:
        name, equals, value = text.partition("=")
        if not equals:
            fail(f"--set takes name=value, not {text!r}", REFUSED)
        fields[name] = value
    if iterations is not None:
        fields["iterations"] = str(iterations)
    if snapshots is not None:
        fields["snapshots"] = snapshots
    return fields


class _LeftError(Exception):
    """The user pressed Ctrl-C."""


class _Whole:
    """Counts all files, where there are too many for a bar each: a terminal shows the first lines that fit."""

    def __init__(self, bars: Bars, files: int) -> None:
        self._bars = bars
        self.crowded = files > AT_ONCE
        self._task = bars.add_task(
            "all files", total=files, visible=self.crowded, note="done", rate=None, eta=None
        )

    def begin(self, task: TaskID) -> None:
        """Show the bar of one file."""
        self._bars.update(task, visible=True)

    def end(self, task: TaskID) -> None:
        """Count one file, and make room."""
        self._bars.update(task, visible=not self.crowded)
        self._bars.advance(self._task)


@dataclass
class _Errand:
    """One file's way through the service."""

    client: Client
    path: Path
    name: str
    fields: dict[str, str | list[str]]
    mesh_format: str
    target: Path
    bars: Bars
    task: TaskID
    whole: _Whole
    stopping: list[int]
    anew: bool
    begun: bool = False
    accepted: bool = False

    def run(self) -> int:
        """Upload, follow, download; returns the exit code of a command that does no more, and says why it is not 0."""
        if self.stopping:
            return INTERRUPTED
        self.begun = True
        self.whole.begin(self.task)
        try:
            return self._run()
        except _LeftError:
            return INTERRUPTED
        except ServiceError as e:
            return self._failed(str(e), FAILED)
        except OSError as e:
            return self._failed(f"{e.filename}: {e.strerror}", FAILED)
        finally:
            self.whole.end(self.task)

    def _run(self) -> int:
        try:
            job = self.client.submit(self.path, self.fields, key=None if self.anew else self._key())
        except RefusedError as e:
            return self._failed(str(e), REFUSED if e.status in _OURS else FAILED)
        except OSError as e:
            return self._failed(str(e.strerror), REFUSED)
        self.accepted = True
        saved: set[int] = set()
        for job in self.client.follow(job["id"], meanwhile=self._look_up):  # noqa: B020 (the newest is what counts)
            show(self.bars, self.task, job)
            for iteration in job["snapshots"]["available"]:
                if iteration not in saved:
                    self._save(job["id"], iteration)
                    saved.add(iteration)
        if job["status"] == "successful":
            return 0
        return self._failed(
            job["error"]["detail"] if job["error"] else f"job {job['id']} was cancelled",
            code_of(job),
        )

    def _key(self) -> str | None:
        """Return a name for this errand that is its own, and the same when the command is given again."""
        if not self.path.is_file():  # a pipe can be read once
            return None
        with self.path.open("rb") as file:
            content = hashlib.file_digest(file, "sha256").hexdigest()
        whole = [platform.node(), str(self.target.absolute()), self.path.name, content, self.fields]
        return hashlib.sha256(json.dumps(whole, sort_keys=True).encode()).hexdigest()

    def _look_up(self) -> None:
        if self.stopping:
            raise _LeftError

    def _save(self, job_id: str, iteration: int) -> None:
        target = self.target.with_name(snapshot_name(self.target.name, iteration, self.mesh_format))
        self.client.download(job_id, iteration, self.mesh_format, target)

    def _failed(self, sentence: str, code: int) -> int:
        self.bars.update(self.task, note="failed", rate=None)
        err.print(f"{self.name}: {sentence}", markup=False)
        return code


def show(bars: Bars, task: TaskID, job: dict[str, Any]) -> None:
    """Let a bar show how far a job is."""
    progress, figures = job["progress"], job["metrics"] or {}
    sphericity = figures.get("sphericity")
    ended = job["status"] in {"successful", "failed", "cancelled"}
    bars.update(
        task,
        completed=progress["iteration"],
        total=progress["iteration"] if ended else max(progress["iterations_total"], 1),
        note=(f"Ψ {sphericity:.4f} " if sphericity is not None else "")
        + (job["stop_reason"] or job["status"] if ended else job["status"]),
        rate=progress["iterations_per_s"],
        eta=progress["eta_s"],
    )


def _bar(bars: Bars, name: str) -> TaskID:
    return bars.add_task(name, total=1, visible=False, note="uploading", rate=None, eta=None)


def _names(files: list[Path]) -> list[str]:
    """Return what each file is called: by its path where another has its name; `.` and `/` have none of their own."""
    several = Counter(path.name for path in files)
    return [path.name if path.name and several[path.name] == 1 else str(path) for path in files]


def _stems(files: list[Path]) -> list[str]:
    """Return a name for each file, none twice."""
    stems: list[str] = []
    for path in files:
        stem, number = path.stem, 2
        while stem in stems:
            stem, number = f"{path.stem}-{number}", number + 1
        stems.append(stem)
    return stems


def _overwritten(files: list[Path], stems: list[str], folder: Path, mesh_format: str) -> Path | None:
    """Return a file that has the name of another's snapshot, in the folder where that would be saved."""
    where, names = folder.resolve(), {(stem, mesh_format) for stem in stems}
    found = (path for path in files if stem_and_form(path.name) in names and path.resolve().parent == where)
    return next(found, None)
