"""Reading a stranger's mesh without risk to the process that asks."""

from __future__ import annotations

import json
import logging
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Collection
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from numpy.lib.format import open_memmap

from spherify.formats.acceptance import ReadMesh
from spherify.formats.codes import problem_code
from spherify.formats.errors import MeshRefusedError, ReaderKilledError
from spherify.formats.limits import MIB, ReadLimits
from spherify.formats.report import MeshReport, check_allow, defect_from_dict
from spherify.geometry.mesh import TriangleMesh

_log = logging.getLogger(__name__)

_ROOT: Final = Path(__file__).resolve().parents[2]
_COMMAND: Final = (sys.executable, "-P", "-m", "spherify.formats.child")
_PASSED_ON: Final = (
    "PATH",
    "LD_LIBRARY_PATH",
    "DYLD_LIBRARY_PATH",
    "LANG",
    "LC_ALL",
    "VIRTUAL_ENV",
)  # no secrets
_ONE_THREAD: Final = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}  # each thread takes address space
_MOST_ANSWER: Final = 4 * MIB
_MOST_COMPLAINT: Final = 4000  # characters of the child's last words that are logged
_DAMAGED: Final = (
    "The reader broke down on this file, so it is damaged or made to harm. Export the mesh again."
)
_KILLED: Final = (
    "Reading the mesh was broken off, most likely because this server ran out of memory. Send it again in a "
    "moment; if that happens again, the file is too large for this server: decimate it."
)


def read_mesh(
    path: Path, name: str, *, allow: Collection[str] = (), limits: ReadLimits | None = None
) -> ReadMesh:
    """Read, mend and judge a mesh file in a child process with limits on memory and time.

    Safe to call from any thread. Whatever the file does to the child, this process is unharmed.

    Args:
        path: the file.
        name: what the user calls it; its extension must agree with the content, if it is one we know.
        allow: switches of `ALLOW` that let a defect through.
        limits: what the file may cost; `ReadLimits()` if None.

    Returns:
        The mesh: closed, oriented outward, of one component and genus 0, but for what was allowed; its vertices
        in the file's order.

    Raises:
        MeshRefusedError: it is no such mesh; the message says what, where, and the cure.
        ValueError: an unknown switch.
        ReaderKilledError: the child was killed, most likely for lack of memory.
        OSError: the file cannot be opened, or no child can be started.

    """
    check_allow(allow)
    limits = limits or ReadLimits()
    path = Path(path).resolve(strict=True)
    with path.open(
        "rb"
    ) as file:  # a folder, or what may not be read, is the caller's fault and not the child's
        size = os.fstat(file.fileno()).st_size
    seconds = limits.seconds_for(size)
    with tempfile.TemporaryDirectory(prefix="spherify-read-") as folder:
        request = {
            "path": str(path),
            "name": name,
            "folder": folder,
            "allow": sorted(allow),
            "limits": asdict(limits),
            "memory": limits.memory_for(size),
            "seconds": seconds,
        }
        _run(request, Path(folder), seconds, _COMMAND)
        return _result(Path(folder))


def _run(request: dict[str, Any], folder: Path, seconds: float, command: tuple[str, ...]) -> None:
    """Run the child to its end, its own or ours."""
    environment = {key: os.environ[key] for key in _PASSED_ON if key in os.environ}
    environment |= _ONE_THREAD | {"PYTHONPATH": str(_ROOT)}
    complaints = folder / "stderr"
    with (
        complaints.open("wb") as stderr,
        subprocess.Popen(  # noqa: S603  # our own module, no shell, nothing of the user's in the command
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=stderr,
            cwd=folder,
            env=environment,
        ) as child,
    ):
        try:
            child.communicate(json.dumps(request).encode(), timeout=seconds)
        except subprocess.TimeoutExpired:
            raise MeshRefusedError(
                "mesh-too-large",
                f"Reading the mesh took longer than the {seconds:.0f} s a file of this size is given. Decimate it, "
                "or export it as binary PLY.",
            ) from None
        finally:
            child.kill()
    if child.returncode:
        _log.error(
            "mesh reader ended with %s on %r: %s",
            child.returncode,
            request["name"],
            complaints.read_text("utf-8", "replace")[-_MOST_COMPLAINT:],
        )
        # Its own limit of memory raises an error in it, its own of time comes after ours: this came from outside.
        if child.returncode == -signal.SIGKILL:
            raise ReaderKilledError(_KILLED)
        raise MeshRefusedError("mesh-not-parsable", _DAMAGED)


def _result(folder: Path) -> ReadMesh:
    """Return what the child left behind, trusting none of it."""
    try:
        with (folder / "answer.json").open("rb") as file:
            answer = json.loads(file.read(_MOST_ANSWER))
        report = MeshReport.from_dict(answer["report"]) if answer["report"] is not None else None
        code = answer["code"]
        if code is None and report is not None:
            # Mapped, not loaded: a header that claims more than the file holds is an error, not an allocation.
            vertices, faces = (
                open_memmap(folder / f"{part}.npy", mode="r") for part in ("vertices", "faces")
            )
            return ReadMesh(TriangleMesh.checked(vertices, faces), report)
        errors = tuple(map(defect_from_dict, answer["errors"]))
        refusal = MeshRefusedError(problem_code(code), str(answer["detail"]), errors, report)
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        _log.exception("the mesh reader left no usable answer")
        raise MeshRefusedError("mesh-not-parsable", _DAMAGED) from error
    raise refusal
