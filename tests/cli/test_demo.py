from __future__ import annotations

import os
import re
import signal
from pathlib import Path

from spherify.formats import ReadLimits, write_mesh
from spherify.formats.acceptance import accept
from spherify.geometry.samples import SAMPLES
from tests.cli.program import running, spherify
from tests.cli.test_morph import OCTAHEDRON
from tests.processes import await_gone
from tests.stack import wait_for

PNG = b"\x89PNG\r\n\x1a\n"


def test_the_demo_saves_snapshots_and_a_picture_of_a_mesh_of_the_user(tmp_path: Path) -> None:
    (tmp_path / "mine.stl").write_bytes(write_mesh(SAMPLES["stone"].build(300), "stl"))
    done = spherify("demo", "mine.stl", "--iterations", "20", cwd=tmp_path)
    assert done.code == 0, done.err
    folder = tmp_path / "demo-output"
    assert (folder / "mine.png").read_bytes().startswith(PNG)
    states = {match[1] for name in os.listdir(folder) if (match := re.fullmatch(r"mine_it(\d+)\.obj", name))}
    assert {"00000", "00005", "00015", "00020"} <= states  # and the best one, if it is none of them
    for state in states:
        names = [f"mine_it{state}.obj", f"mine_it{state}.ply"]
        obj, ply = (accept((folder / name).read_bytes(), name, (), ReadLimits()).mesh for name in names)
        assert (obj.vertices == ply.vertices).all()
    printed = [float(text) for text in re.findall(r"\b0\.\d{4}\b", done.out)]
    assert printed, done.out
    assert "Ψ" in done.out
    assert "web page   `make up` or `spherify up`, then http://127.0.0.1:8000/" in done.out


def test_a_mesh_that_is_refused_is_a_sentence_and_nothing_is_left(tmp_path: Path) -> None:
    (tmp_path / "open.obj").write_text(OCTAHEDRON)
    with running("demo", "open.obj", cwd=tmp_path) as demo:
        wait_for(lambda: "uploading" in demo.text, limit_s=60)
        family = demo.family()
        assert demo.process.wait(60) == 2
        await_gone(family)
    assert "boundary" in demo.text
    assert "Traceback" not in demo.text


def test_ctrl_c_stops_everything(tmp_path: Path) -> None:
    scratch = tmp_path / "tmp"
    scratch.mkdir()
    (tmp_path / "large.ply").write_bytes(write_mesh(SAMPLES["stone"].build(40_000), "ply"))  # minutes
    options = ["large.ply", "--iterations", "900000", "--preset", "paper"]
    with running("demo", *options, cwd=tmp_path, environment={"TMPDIR": str(scratch)}) as demo:
        wait_for((tmp_path / "demo-output" / "large_it00000.obj").exists, limit_s=60)
        family = demo.family()
        assert len(family) >= 4  # server, API, worker, pool
        assert demo.end(signal.SIGINT) == 130
        await_gone(family)
    assert "Traceback" not in demo.text
    assert not os.listdir(scratch)


def test_a_file_that_is_not_there_is_told_before_anything_is_started(tmp_path: Path) -> None:
    done = spherify("demo", "nowhere.obj", cwd=tmp_path)
    assert done.code == 2
    assert done.err == "spherify: nowhere.obj: No such file or directory\n"


def test_a_run_that_ends_otherwise_than_by_a_collapse_does_not_say_that_it_collapsed(tmp_path: Path) -> None:
    options = ["sample:stone:10000", "--preset", "paper", "--iterations", "100000"]
    done = spherify("demo", *options, cwd=tmp_path, environment={"SPHERIFY_WALL_LIMIT_S": "0.01"})
    assert done.code == 1, done.err
    assert (tmp_path / "demo-output" / "stone.png").read_bytes().startswith(PNG)
