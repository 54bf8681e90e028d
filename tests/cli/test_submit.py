from __future__ import annotations

import os
import re
import signal
import socket
from pathlib import Path

import httpx
import pytest

from spherify.client import Client
from spherify.formats import read_mesh, write_mesh
from spherify.geometry.samples import SAMPLES
from tests.cli.program import running, spherify, spherify_here
from tests.cli.test_morph import LAST_FACE, OCTAHEDRON
from tests.stack import Stack, wait_for


@pytest.fixture
def meshes(tmp_path: Path) -> Path:
    for name in ("stone", "cube"):
        (tmp_path / f"{name}.off").write_bytes(write_mesh(SAMPLES[name].build(200), "off"))
    return tmp_path


def test_several_files_come_back_as_snapshots(stack: Stack, meshes: Path) -> None:
    options = ["--url", stack.url, "-o", "out", "--iterations", "6", "--snapshots", "2,4", "--format", "stl"]
    done = spherify("submit", "stone.off", "cube.off", *options, cwd=meshes)
    assert done.code == 0, done.err
    names = sorted(f"{name}_it{n:05d}.stl" for name in ("stone", "cube") for n in (0, 2, 4, 6))
    assert set(names) <= set(os.listdir(meshes / "out"))
    assert not [name for name in os.listdir(meshes / "out") if name.endswith(".part")]
    assert "stone.off" in done.err
    assert "cube.off" in done.err


def test_files_of_one_name_do_not_overwrite_each_other(stack: Stack, meshes: Path) -> None:
    (meshes / "stone.ply").write_bytes(write_mesh(SAMPLES["stone"].build(300), "ply"))
    done = spherify_here(
        "submit", "stone.off", "stone.ply", "--url", stack.url, "--iterations", "1", cwd=meshes
    )
    assert done.code == 0, done.err
    sizes = [
        len(read_mesh(path, path.name).mesh.vertices) for path in sorted(meshes.glob("stone*_it00001.ply"))
    ]
    assert len(set(sizes)) == 2


def test_files_of_one_name_are_told_apart_by_their_folders(stack: Stack, meshes: Path) -> None:
    for folder in ("a", "b"):
        (meshes / folder).mkdir()
        (meshes / folder / "same.obj").write_text(OCTAHEDRON)
    done = spherify_here("submit", "a/same.obj", "b/same.obj", "--url", stack.url, cwd=meshes)
    assert done.code == 2
    assert {line.partition(": ")[0] for line in done.err.splitlines() if ": " in line} == {
        "a/same.obj",
        "b/same.obj",
    }


def test_of_more_files_than_a_terminal_has_lines_those_at_work_are_shown(stack: Stack, meshes: Path) -> None:
    names = [f"{n}.obj" for n in range(12)]
    for name in names:
        (meshes / name).write_text(OCTAHEDRON + LAST_FACE)
    done = spherify(
        "submit", *names, "--url", stack.url, "--iterations", "1", cwd=meshes,
        environment={"FORCE_COLOR": "1", "TERM": "xterm", "LINES": "11", "COLUMNS": "100"},
    )  # fmt: skip
    assert done.code == 0, done.err
    drawn = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", done.err)
    assert "..." not in drawn, "what is at work is below the last line"
    last = drawn[drawn.rindex("all files") :]
    assert "12/12 done" in last
    assert all(f"{name} " in last for name in names)


def test_after_ctrl_c_it_says_how_many_were_accepted(stack: Stack, meshes: Path) -> None:
    names = [f"{n}.off" for n in range(10)]
    for name in names:
        (meshes / name).write_bytes((meshes / "cube.off").read_bytes())
    long = ["--preset", "paper", "--set", "step=1e-6", "--iterations", "900000", "--snapshots", "0"]
    tag = f"ctrl-c-{meshes.name.lower()}"
    with (
        Client(stack.url) as client,
        running("submit", *names, "--url", stack.url, *long, "--set", f"tags={tag}", cwd=meshes) as command,
    ):
        wait_for(lambda: len(client.jobs(tag)) == 8, what="as many as are sent at once")
        assert command.end(signal.SIGINT) == 130
        for job in client.jobs(tag):
            client.cancel(job["id"])
    said = f"interrupted; 8 of 10 files were accepted, and their jobs go on: {stack.url}/v1/jobs. The same command "
    assert said in command.text
    assert "9.off" not in command.text, "nobody has sent it"


def test_no_snapshot_takes_the_place_of_another_mesh(stack: Stack, meshes: Path) -> None:
    snapshot = meshes / "cube_it00002.ply"
    snapshot.write_bytes(write_mesh(SAMPLES["cube"].build(100), "ply"))
    command = ["submit", "cube.off", snapshot.name, "--url", stack.url, "--iterations", "2"]
    refused = spherify_here(*command, cwd=meshes)
    assert refused.code == 2
    assert "take the place of cube_it00002.ply: name another folder with -o" in refused.err
    assert spherify_here(*command, "-o", "out", cwd=meshes).code == 0
    assert len(read_mesh(snapshot, snapshot.name).mesh.vertices) < 200


def test_given_again_it_fetches_what_was_accepted(stack: Stack, meshes: Path) -> None:
    tag = f"again-{meshes.name.lower()}"
    options = ["--url", stack.url, "--iterations", "2", "--set", f"tags={tag}"]
    command = ["submit", "stone.off", "cube.off", *options]
    with Client(stack.url) as client:

        def given(*more: str) -> dict[str, str]:
            """Return the jobs there are since, each with its name."""
            done = spherify_here(*command, *more, cwd=meshes)
            assert done.code == 0, done.err
            return {job["id"]: job["name"] for job in client.jobs(tag)}

        first = given()
        assert sorted(first.values()) == ["cube", "stone"]
        (meshes / "stone_it00002.ply").unlink()
        assert given() == first
        assert (meshes / "stone_it00002.ply").is_file()
        assert given("--format", "obj") == first
        assert (meshes / "cube_it00002.obj").is_file()

        def new(*more: str) -> list[str]:
            """Return the files of which there are new jobs."""
            before = {job["id"] for job in client.jobs(tag)}
            return sorted(name for job, name in given(*more).items() if job not in before)

        assert new("-o", "elsewhere") == ["cube", "stone"]
        assert new("--anew") == ["cube", "stone"]
        (meshes / "cube.off").write_bytes((meshes / "stone.off").read_bytes())
        assert new() == ["cube"]


def test_given_again_it_computes_what_was_deleted(stack: Stack, meshes: Path) -> None:
    tag = f"deleted-{meshes.name.lower()}"
    command = ["submit", "stone.off", "--url", stack.url, "--iterations", "2", "--set", f"tags={tag}"]
    with Client(stack.url) as client:
        assert spherify_here(*command, cwd=meshes).code == 0
        (first,) = client.jobs(tag)
        assert httpx.delete(f"{stack.url}/v1/jobs/{first['id']}").is_success
        assert spherify_here(*command, cwd=meshes).code == 0
        (second,) = client.jobs(tag)
        assert second["id"] != first["id"]


def test_given_again_it_computes_what_was_cancelled(stack: Stack, meshes: Path) -> None:
    tag = f"cancelled-{meshes.name.lower()}"
    long = ["--preset", "paper", "--set", "step=1e-6", "--iterations", "900000", "--snapshots", "0"]
    command = ["submit", "stone.off", "--url", stack.url, *long, "--set", f"tags={tag}"]
    with Client(stack.url) as client:

        def cancelled() -> str:
            """Give the command, and cancel the job that is made."""
            before = {job["id"] for job in client.jobs(tag)}

            def made() -> list[str]:
                return [job["id"] for job in client.jobs(tag) if job["id"] not in before]

            with running(*command, cwd=meshes) as at_work:
                wait_for(made, what="a job")
                (job_id,) = made()
                client.cancel(job_id)
                assert at_work.process.wait(30) == 1
            return job_id

        assert cancelled() != cancelled()


def test_the_same_bytes_as_a_local_run(stack: Stack, meshes: Path) -> None:
    settings = ["--iterations", "7", "--set", "step=0.04", "--set", "window=[25,75]"]
    assert spherify_here("submit", "stone.off", "--url", stack.url, *settings, cwd=meshes).code == 0
    assert spherify_here("morph", "stone.off", "-o", "local.ply", *settings, cwd=meshes).code == 0
    assert (meshes / "stone_it00007.ply").read_bytes() == (meshes / "local.ply").read_bytes()


def test_a_refusal_is_a_sentence_and_the_others_go_on(stack: Stack, meshes: Path) -> None:
    (meshes / "open.obj").write_text(OCTAHEDRON)
    done = spherify_here(
        "submit", "open.obj", "cube.off", "--url", stack.url, "--iterations", "1", cwd=meshes
    )
    assert done.code == 1
    assert "open.obj: " in done.err
    assert "boundary" in done.err
    assert (meshes / "cube_it00001.ply").exists()


def test_the_one_mesh_that_is_refused_is_exit_code_2(stack: Stack, meshes: Path) -> None:
    (meshes / "open.obj").write_text(OCTAHEDRON)
    done = spherify_here("submit", "open.obj", "--url", stack.url, cwd=meshes)
    assert done.code == 2
    assert "boundary" in done.err


def test_a_wrong_parameter_is_named(stack: Stack, meshes: Path) -> None:
    done = spherify_here(
        "submit", "cube.off", "stone.off", "--url", stack.url, "--set", "stride=1", cwd=meshes
    )
    assert done.code == 2
    assert "stride" in done.err


@pytest.mark.parametrize("command", [("submit", "cube.off"), ("gallery",)])
@pytest.mark.parametrize("url", ["notaurl", "ftp://127.0.0.1", "http://", "http://a:b"])
def test_what_is_no_address_is_a_wrong_option(meshes: Path, command: tuple[str, ...], url: str) -> None:
    done = spherify_here(*command, "--url", url, cwd=meshes)
    assert done.code == 2
    assert f"--url: {url!r} is no address" in done.err


def test_a_collapsed_job_is_told_and_its_snapshots_are_saved(stack: Stack, meshes: Path) -> None:
    (meshes / "animal.ply").write_bytes(write_mesh(SAMPLES["quadruped"].build(400), "ply"))
    options = ["--preset", "paper", "--set", "step=0.2", "--iterations", "3000", "--snapshots", "10"]
    done = spherify_here("submit", "animal.ply", "--url", stack.url, *options, cwd=meshes)
    assert done.code == 3
    assert "inside out" in done.err
    assert (meshes / "animal_it00010.ply").exists()


def test_nobody_there(meshes: Path) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{probe.getsockname()[1]}"
        done = spherify_here("submit", "cube.off", "--url", url, cwd=meshes)
    assert done.code == 1
    assert url in done.err
    assert "spherify up" in done.err
    assert "Traceback" not in done.err


@pytest.mark.parametrize("file", ["no.obj", "."])
def test_what_is_no_file_is_named(stack: Stack, meshes: Path, file: str) -> None:
    done = spherify_here("submit", file, "--url", stack.url, cwd=meshes)
    assert done.code == 2
    assert f"\n{file}: " in f"\n{done.err}"
