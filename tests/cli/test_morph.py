from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from spherify.formats import FORMATS_OUT, ReadLimits, read_mesh
from spherify.formats.acceptance import accept
from spherify.geometry.samples import SAMPLES
from tests.cli.program import COMMAND, Ended, spherify, spherify_here
from tests.stack import wait_for

OCTAHEDRON = """v 1 0 0
v -1 0 0
v 0 1 0
v 0 -1 0
v 0 0 1
v 0 0 -1
f 1 3 5
f 3 2 5
f 2 4 5
f 4 1 5
f 3 1 6
f 2 3 6
f 4 2 6
"""
LAST_FACE = "f 1 4 6\n"
PROMISED = {
    "sphericity",
    "radius_variation",
    "inward_faces",
    "faces",
    "iterations",
    "stop_reason",
    "seconds",
    "vertices",
}


def report(
    folder: Path, *arguments: str | Path, code: int = 0, run: Callable[..., Ended] = spherify_here
) -> dict[str, object]:
    """Morph with --json and return the report, which is all there is on standard output."""
    done = run("morph", *arguments, "--json", cwd=folder)
    assert done.code == code, done.err
    (line,) = done.out.splitlines()
    found = json.loads(line)
    assert found.keys() >= PROMISED
    return dict(found)


def test_it_reports_once_and_writes_the_result(tmp_path: Path) -> None:
    found = report(tmp_path, "sample:stone:300", "-o", "out.ply", "--iterations", "8", run=spherify)
    mesh = read_mesh(tmp_path / "out.ply", "out.ply").mesh
    assert (found["vertices"], found["faces"]) == (len(mesh.vertices), len(mesh.faces))
    assert (found["iterations"], found["stop_reason"]) == (8, "iterations")
    assert isinstance(found["seconds"], float)
    assert found["seconds"] > 0
    assert os.listdir(tmp_path) == ["out.ply"]


@pytest.mark.parametrize("mesh_format", FORMATS_OUT)
def test_the_suffix_decides_the_format(tmp_path: Path, mesh_format: str) -> None:
    report(tmp_path, "sample:cube:100", "-o", f"out.{mesh_format}", "--iterations", "1")
    read = read_mesh(tmp_path / f"out.{mesh_format}", f"out.{mesh_format}")
    assert read.report.format == mesh_format


def test_no_snapshot_takes_the_place_of_its_own_mesh(tmp_path: Path) -> None:
    report(tmp_path, "sample:cube:100", "-o", "a_it00004.obj", "--iterations", "1")
    before = (tmp_path / "a_it00004.obj").read_bytes()
    arguments = ["morph", "./a_it00004.obj", "-o", "a.obj", "--iterations", "6", "--snapshots"]
    refused = spherify_here(*arguments, "2,4", cwd=tmp_path)
    assert refused.code == 2
    assert "take the place of a_it00004.obj: give -o another name" in refused.err
    assert (tmp_path / "a_it00004.obj").read_bytes() == before
    assert spherify_here(*arguments, "2,3", cwd=tmp_path).code == 0
    assert (tmp_path / "a_it00004.obj").read_bytes() == before


def test_snapshots_stand_beside_the_result(tmp_path: Path) -> None:
    found = report(tmp_path, "sample:cube:100", "-o", "a.obj", "--iterations", "6", "--snapshots", "2,4")
    names = [f"a_it{n:05d}.obj" for n in (0, 2, 4, 6)]
    assert found["snapshots"] == names
    assert sorted(os.listdir(tmp_path)) == ["a.obj", *names]
    assert (tmp_path / "a.obj").read_bytes() == (tmp_path / names[-1]).read_bytes()
    assert (tmp_path / names[0]).read_bytes() != (tmp_path / names[1]).read_bytes()


def test_the_same_run_writes_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a.ply", "b.ply"):
        report(tmp_path, "sample:non-convex-sphere:200", "-o", name, "--iterations", "5")
    assert (tmp_path / "a.ply").read_bytes() == (tmp_path / "b.ply").read_bytes()


@pytest.mark.parametrize(
    ("source", "options", "reason"),
    [
        ("sample:stone:300", ["--set", "stop_radius_variation=0.9"], "converged"),
        (
            "sample:stone:300",
            ["--set", 'annealing={"patience":1,"factor":0.1,"min_step":0.049}', "--set", "unfolding=null"],
            "stalled",
        ),
        ("octahedron.obj", ["--preset", "paper"], "constant-curvature"),
    ],
)
def test_a_run_that_ends_by_itself_says_how(
    tmp_path: Path, source: str, options: list[str], reason: str
) -> None:
    (tmp_path / "octahedron.obj").write_text(OCTAHEDRON + LAST_FACE)
    found = report(tmp_path, source, "-o", "out.ply", "--iterations", "3000", *options)
    assert found["stop_reason"] == reason
    assert isinstance(found["iterations"], int)
    assert found["iterations"] < 3000
    assert (tmp_path / "out.ply").exists()


def test_a_collapsed_run_leaves_its_best_state_and_exit_code_3(tmp_path: Path) -> None:
    options = ["--preset", "paper", "--set", "step=0.2", "--iterations", "3000"]
    found = report(tmp_path, "sample:quadruped:400", "-o", "out.ply", *options, code=3)
    assert found["stop_reason"] == "collapsed"
    best = read_mesh(tmp_path / "out.ply", "out.ply")
    assert best.report.volume is not None
    assert best.report.volume > 0
    assert best.report.sphericity == pytest.approx(found["sphericity"], rel=1e-9)
    start = report(tmp_path, "sample:quadruped:400", "-o", "start.ply", "--iterations", "0")
    assert float(str(found["sphericity"])) >= float(str(start["sphericity"]))


def test_ctrl_c_writes_what_there_is(tmp_path: Path) -> None:
    arguments = ["sample:stone:2000", "-o", "out.ply", "--snapshots", "3", "--json", "--iterations", "900000"]
    arguments += ["--set", "annealing=null", "--set", "stop_radius_variation=0"]
    with subprocess.Popen(
        [*COMMAND, "morph", *arguments],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        wait_for((tmp_path / "out_it00003.ply").exists, limit_s=60)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    assert process.returncode == 130
    found = json.loads(out)
    assert found["stop_reason"] == "cancelled"
    assert f"iteration {found['iterations']}" in err
    assert len(read_mesh(tmp_path / "out.ply", "out.ply").mesh.vertices) == found["vertices"]


def test_a_refused_mesh_is_one_sentence_and_exit_code_2(tmp_path: Path) -> None:
    (tmp_path / "open.obj").write_text(OCTAHEDRON)
    done = spherify("morph", "open.obj", "-o", "out.ply", "--json", cwd=tmp_path)
    assert done.code == 2
    assert done.out == ""
    (line,) = done.err.splitlines()
    assert line.startswith("spherify: open.obj: ")
    assert "3 " in line  # boundary edges
    assert "boundary" in line
    assert os.listdir(tmp_path) == ["open.obj"]


def test_a_switch_lets_the_same_mesh_in(tmp_path: Path) -> None:
    (tmp_path / "open.obj").write_text(OCTAHEDRON)
    found = report(tmp_path, "open.obj", "-o", "out.ply", "--allow", "boundary", "--iterations", "2")
    assert found["faces"] == 7


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["no.obj", "-o", "out.ply"], "no.obj"),
        ([".", "-o", "out.ply"], "spherify: . cannot be read: Is a directory"),
        (["sample:cube", "-o", "."], "spherify: .: the suffix must be"),
        (["sample:stone:1000001", "-o", "out.ply"], "at most 1,000,000 vertices"),
        (["sample:stone:" + 5000 * "9", "-o", "out.ply"], "at most 1,000,000 vertices"),
        (["sample:dragon", "-o", "out.ply"], "quadruped"),
        (["sample:cube:many", "-o", "out.ply"], "sample:cube:5000"),
        (["sample:cube", "-o", "out.txt"], ".ply"),
        (["sample:cube", "-o", "nowhere/out.ply"], "nowhere"),
        (["sample:cube", "-o", "out.ply", "--preset", "magic"], "paper-absolute"),
        (["sample:cube", "-o", "out.ply", "--set", "step"], "name=value"),
        (
            ["sample:cube", "-o", "out.ply", "--set", "stride=1"],
            "no parameter stride; there are method, iterations",
        ),
        (["sample:cube", "-o", "out.ply", "--set", "step=-1"], "step"),
        (["sample:cube", "-o", "out.ply", "--set", "iterations=true"], "iterations: "),
        (["sample:cube", "-o", "out.ply", "--set", "step=NaN"], "step"),
        (["sample:cube", "-o", "out.ply", "--set", "window=[70,30]"], "window"),
        (["sample:cube", "-o", "out.ply", "--snapshots", "often"], "every:N"),
        (["sample:cube", "-o", "out.ply", "--iterations", "5", "--snapshots", "9"], "0 … 5"),
        (["sample:cube", "-o", "out.ply", "--engine", "steam"], "reference, compiled"),
        (["sample:cube", "-o", "out.ply", "--engine", "reference", "--threads", "2"], "one thread"),
        (["sample:cube", "-o", "out.ply", "--allow", "everything"], "everything"),
        (["sphere.obj", "-o", "out.ply", "--allow", "everything"], "choose from genus, boundary"),
    ],
)
def test_a_wrong_option_is_named(tmp_path: Path, arguments: list[str], says: str) -> None:
    (tmp_path / "sphere.obj").write_text(OCTAHEDRON + LAST_FACE)
    done = spherify_here("morph", *arguments, cwd=tmp_path)
    assert done.code == 2
    assert says in done.err
    assert os.listdir(tmp_path) == ["sphere.obj"]


@pytest.mark.parametrize("way", ["cat sphere.obj | {} /dev/stdin", "{} /dev/stdin < sphere.obj"])
def test_a_mesh_may_come_through_a_pipe(tmp_path: Path, way: str) -> None:
    (tmp_path / "sphere.obj").write_text(OCTAHEDRON + LAST_FACE)
    line = way.format(f"{shlex.join(COMMAND)} morph -o out.ply --iterations 1")
    done = subprocess.run(
        ["sh", "-c", line], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    assert len(read_mesh(tmp_path / "out.ply", "out.ply").mesh.faces) == 8


def test_a_finished_sphere_takes_no_time(tmp_path: Path) -> None:
    enough = ["--set", "stop_radius_variation=0.9"]
    assert "-0.0" not in str(report(tmp_path, "sample:stone:300", "-o", "a.ply", *enough)["seconds"])
    done = spherify_here("morph", "sample:stone:300", "-o", "a.ply", *enough, cwd=tmp_path)
    assert "converged after 0 iterations in 0.00 s" in done.err
    assert " 0/0 " in done.err


def test_an_output_that_is_a_folder_is_told_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "out.ply").mkdir()
    done = spherify_here("morph", "sample:stone:300", "-o", "out.ply", cwd=tmp_path)
    assert done.code == 2
    assert done.err == "spherify: out.ply is a folder: name a file\n"


@pytest.mark.parametrize("there", [False, True])
def test_an_output_that_must_not_be_written_is_told_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, there: bool
) -> None:
    if there:
        (tmp_path / "out.ply").touch()
    # root may write anywhere
    monkeypatch.setattr(os, "access", lambda _, mode: mode != os.W_OK)
    done = spherify_here("morph", "sample:stone:300", "-o", "out.ply", cwd=tmp_path)
    assert done.code == 2
    assert done.err == "spherify: out.ply cannot be written: permission denied\n"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is none but on Linux")
@pytest.mark.parametrize("command", [["morph", "sphere.obj", "-o", "out.ply", "--json"], ["samples"]])
def test_an_output_that_is_full_is_a_sentence(tmp_path: Path, command: list[str]) -> None:
    (tmp_path / "sphere.obj").write_text(OCTAHEDRON + LAST_FACE)
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [*COMMAND, *command], cwd=tmp_path, stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("spherify: what there is to say cannot be written: ")
    assert "Traceback" not in done.stderr


def test_version(tmp_path: Path) -> None:
    done = spherify("--version", cwd=tmp_path)
    assert (done.code, done.out) == (0, "spherify 0.1.0\n")


def test_samples_that_cannot_be_written_are_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "folder" / "stone.obj").mkdir(parents=True)
    for folder, code, says in (
        ("file", 2, "file cannot be made: File exists"),
        ("folder", 1, "stone.obj cannot be written: Is a directory"),
    ):
        done = spherify_here("samples", "-o", folder, "--vertices", "100", cwd=tmp_path)
        assert done.code == code
        assert says in done.err
    assert spherify_here("samples", "-o", "new", "--vertices", "1000001", cwd=tmp_path).code == 2
    assert not (tmp_path / "new").exists()


def test_samples_are_listed_and_written(tmp_path: Path) -> None:
    listed = spherify_here("samples", cwd=tmp_path)
    assert listed.code == 0
    assert [line.split()[0] for line in listed.out.splitlines()] == [f"sample:{name}" for name in SAMPLES]
    written = spherify_here("samples", "-o", "shapes", "--format", "off", "--vertices", "200", cwd=tmp_path)
    assert written.code == 0
    assert sorted(os.listdir(tmp_path / "shapes")) == sorted(f"{name}.off" for name in SAMPLES)
    for path in (tmp_path / "shapes").iterdir():
        assert accept(path.read_bytes(), path.name, (), ReadLimits()).report.eligible
