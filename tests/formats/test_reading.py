"""The parent survives whatever its child does, and leaves nothing behind."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from spherify.formats import MeshRefusedError, ReadLimits, read_mesh, reading, write_mesh
from spherify.formats.errors import ReaderKilledError
from tests.formats.shapes import CUBE_FACES, cube, obj_bytes

ROOT = Path(__file__).resolve().parents[2]
SOME_REPORT = '{"code": null, "report": {}}'
ANSWER = "import sys, json, pathlib; folder = pathlib.Path(json.load(sys.stdin)['folder']);"


@pytest.fixture
def cube_file(tmp_path: Path) -> Path:
    path = tmp_path / "upload"
    path.write_bytes(write_mesh(cube(), "obj"))
    return path


@pytest.fixture(autouse=True)
def folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Folders of readings are made in one of the test's own; none may be left."""
    place = tmp_path / "temporary"
    place.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(place))
    yield
    assert list(place.iterdir()) == []


def be(monkeypatch: pytest.MonkeyPatch, program: str) -> None:
    """Put another program in the child's place."""
    monkeypatch.setattr(reading, "_COMMAND", (sys.executable, "-c", program))


def children() -> set[str]:
    """Return the ids of this process's children, zombies too."""
    tasks = Path("/proc/self/task")
    if not tasks.exists():
        pytest.skip("only Linux tells children this way")
    return {child for task in tasks.iterdir() for child in (task / "children").read_text().split()}


@pytest.mark.parametrize(
    ("program", "logged"),
    [
        ("import os; os.abort()", "ended with -6"),
        ("import ctypes; ctypes.string_at(0)", "ended with -11"),
        ("raise SystemExit('it broke')", "it broke"),
        ("", "no usable answer"),
        ("print('x' * 100_000_000)", "no usable answer"),
        (ANSWER + "(folder / 'answer.json').write_text('{')", "no usable answer"),
        (ANSWER + "(folder / 'answer.json').write_text('[' * 1_000_000)", "no usable answer"),
        (ANSWER + "(folder / 'answer.json').write_text('null')", "no usable answer"),
        (ANSWER + "(folder / 'answer.json').write_bytes(bytes(range(256)))", "no usable answer"),
        (ANSWER + "(folder / 'answer.json').write_text('{\"code\": \"ok\", \"report\": null, \"errors\": []}')",
         "no usable answer"),
        (ANSWER + f"(folder / 'answer.json').write_text('{SOME_REPORT}')", "no usable answer"),
    ],
)  # fmt: skip
def test_a_child_that_breaks_is_a_refusal_and_is_logged(
    program: str,
    logged: str,
    cube_file: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
):
    before = children()
    be(monkeypatch, program)
    with pytest.raises(MeshRefusedError, match="broke down on this file") as refusal:
        read_mesh(cube_file, "cube.obj")
    assert refusal.value.code == "mesh-not-parsable"
    assert any(logged in record.getMessage() for record in caplog.records if record.levelno == logging.ERROR)
    assert children() == before


def test_a_child_that_is_killed_is_no_fault_of_the_file(
    cube_file: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    be(monkeypatch, "import os, signal; os.kill(os.getpid(), signal.SIGKILL)")
    with pytest.raises(ReaderKilledError, match=r"ran out of memory\. Send it again"):
        read_mesh(cube_file, "cube.obj")
    assert "ended with -9" in caplog.text


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux lets a process volunteer")
def test_the_kernel_is_to_end_the_child_first_where_memory_runs_out(
    cube_file: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    asked = "raise SystemExit('score ' + pathlib.Path('/proc/self/oom_score_adj').read_text())"
    be(monkeypatch, accepted_then(asked))
    with pytest.raises(MeshRefusedError):
        read_mesh(cube_file, "cube.obj")
    assert "score 1000" in caplog.text


def accepted_then(program: str) -> str:
    """Return a program that reads as the real child does and then spoils what it left."""
    return (
        "import io, sys, json, pathlib; said = sys.stdin.read(); sys.stdin = io.StringIO(said);"
        "folder = pathlib.Path(json.loads(said)['folder']);"
        f"from spherify.formats.child import main; main(); {program}"
    )


@pytest.mark.parametrize(
    "program",
    [
        "(folder / 'faces.npy').write_bytes(b'')",
        "(folder / 'faces.npy').write_bytes((folder / 'faces.npy').read_bytes()[:-8])",
        "import pickle; (folder / 'faces.npy').write_bytes(pickle.dumps([1]))",
        "import numpy; numpy.save(folder / 'faces.npy', numpy.array([{}], dtype=object), allow_pickle=True)",
        "import numpy; numpy.save(folder / 'faces.npy', numpy.array([[0, 1, 99]]))",
        "import numpy; numpy.save(folder / 'vertices.npy', numpy.full((8, 3), numpy.nan))",
        "(folder / 'vertices.npy').unlink()",
    ],
)
def test_arrays_from_the_child_are_not_trusted(
    program: str, cube_file: Path, monkeypatch: pytest.MonkeyPatch
):
    be(monkeypatch, accepted_then(program))
    with pytest.raises(MeshRefusedError, match="broke down on this file"):
        read_mesh(cube_file, "cube.obj")


def test_unspoilt_arrays_from_that_program_are_taken(cube_file: Path, monkeypatch: pytest.MonkeyPatch):
    be(monkeypatch, accepted_then(""))
    assert np.array_equal(read_mesh(cube_file, "cube.obj").mesh.faces, CUBE_FACES)


@pytest.mark.parametrize(
    "program", ["while True: pass", "import signal; signal.signal(15, 1); signal.sigwait([10])"]
)
def test_a_child_that_hangs_is_killed(program: str, cube_file: Path, monkeypatch: pytest.MonkeyPatch):
    before = children()
    be(monkeypatch, program)
    with pytest.raises(MeshRefusedError, match="longer than the 0 s") as refusal:
        read_mesh(cube_file, "cube.obj", limits=ReadLimits(seconds=0.3, seconds_per_mib=0))
    assert refusal.value.code == "mesh-too-large"
    assert children() == before


def test_a_child_ends_by_itself_when_nobody_waits_for_it(tmp_path: Path):
    program = "from spherify.formats.child import confine; confine(1 << 31, -0.9, 1 << 20)\nwhile True: pass"
    assert os.waitstatus_to_exitcode(os.system(f'{sys.executable} -c "{program}"')) != 0


def test_the_child_sees_no_secrets(
    cube_file: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    monkeypatch.setenv("SPHERIFY_API_KEYS", "hunter2")
    be(monkeypatch, "import os; raise SystemExit(str(dict(os.environ)))")
    with pytest.raises(MeshRefusedError):
        read_mesh(cube_file, "cube.obj")
    assert "OPENBLAS_NUM_THREADS" in caplog.text
    assert "hunter2" not in caplog.text


def test_reading_does_not_wait_for_what_only_writing_needs():
    program = "import sys, spherify.formats.child; raise SystemExit('trimesh' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], cwd=ROOT, check=False).returncode == 0


def test_many_threads_may_read_at_once(tmp_path: Path):
    paths = []
    for n in range(4):
        paths.append(tmp_path / f"{n}.obj")
        paths[-1].write_bytes(obj_bytes(cube().vertices * (n + 1), CUBE_FACES))
    with ThreadPoolExecutor(4) as pool:
        results = list(pool.map(lambda path: read_mesh(path, path.name), paths))
    assert [round(result.report.volume) for result in results] == [1, 8, 27, 64]


def test_the_arrays_returned_are_frozen_and_of_the_right_kind(cube_file: Path):
    mesh = read_mesh(cube_file, "upload").mesh
    assert (mesh.vertices.dtype, mesh.faces.dtype) == (np.float64, np.int64)
    assert not mesh.vertices.flags.writeable
    assert type(mesh.vertices) is np.ndarray


def test_the_path_may_be_relative(cube_file: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(cube_file.parent)
    assert read_mesh(Path("upload"), "cube.obj").report.faces == 12


def test_unknown_switches_and_missing_files_are_the_callers_fault(cube_file: Path):
    with pytest.raises(ValueError, match="no switch 'holes'; choose from genus, boundary"):
        read_mesh(cube_file, "cube.obj", allow=["holes"])
    with pytest.raises(FileNotFoundError):
        read_mesh(cube_file.with_name("gone"), "cube.obj")


def test_a_refusal_crosses_the_pipe_whole(tmp_path: Path):
    path = tmp_path / "open.obj"
    path.write_bytes(obj_bytes(cube().vertices, CUBE_FACES[1:]))
    with pytest.raises(MeshRefusedError) as refusal:
        read_mesh(path, path.name)
    error = refusal.value
    assert error.code == "mesh-not-closed"
    assert error.report is not None
    assert error.errors == error.report.defects
    assert [place.kind for place in error.errors[0].locations] == ["edge"] * 3
    allowed = read_mesh(path, path.name, allow=["boundary"]).report
    assert (allowed.eligible, allowed.defects, allowed.allowed) == (True, error.errors, ("boundary",))
