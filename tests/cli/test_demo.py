from __future__ import annotations

import os
import re
import signal
from pathlib import Path

from spherify.formats import read_mesh, write_mesh
from spherify.geometry.samples import SAMPLES
from tests.cli.program import await_gone, running, spherify
from tests.cli.test_morph import OCTAHEDRON
from tests.stack import wait_for

PNG = b"\x89PNG\r\n\x1a\n"


def test_the_demo_saves_snapshots_and_a_picture(tmp_path: Path) -> None:
    done = spherify("demo", "--iterations", "20", cwd=tmp_path)
    assert done.code == 0, done.err
    folder = tmp_path / "demo-output"
    pictures = [name for name in os.listdir(folder) if name.endswith(".png")]
    assert len(pictures) == 1
    assert (folder / pictures[0]).read_bytes().startswith(PNG)
    states = {match[1] for name in os.listdir(folder) if (match := re.search(r"_it(\d+)\.", name))}
    assert len(states) >= 3
    for state in states:
        read = [read_mesh(path, path.name).mesh for path in sorted(folder.glob(f"*_it{state}.*"))]
        assert len(read) == 2  # OBJ and PLY
        assert (read[0].vertices == read[1].vertices).all()
    printed = [float(text) for text in re.findall(r"\b0\.\d{4}\b", done.out)]
    assert printed, done.out
    assert "Ψ" in done.out


def test_it_takes_a_mesh_of_the_user(tmp_path: Path) -> None:
    (tmp_path / "mine.stl").write_bytes(write_mesh(SAMPLES["cube"].build(150), "stl"))
    done = spherify("demo", "mine.stl", "-o", "out", "--iterations", "3", cwd=tmp_path)
    assert done.code == 0, done.err
    assert (tmp_path / "out" / "mine_it00003.obj").exists()


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
    options = ["--iterations", "900000", "--preset", "paper"]
    with running("demo", *options, cwd=tmp_path, environment={"TMPDIR": str(scratch)}) as demo:
        wait_for((tmp_path / "demo-output" / "quadruped_it00000.obj").exists, limit_s=60)
        family = demo.family()
        assert len(family) >= 4  # server, API, worker, pool
        assert demo.end(signal.SIGINT) == 130
        await_gone(family)
    assert "Traceback" not in demo.text
    assert not os.listdir(scratch)
