"""`spherify up`: starts, says what is wrong, mends itself, keeps its data, and leaves nothing behind."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import httpx
import pytest

from spherify.cli.gallery import ORDER, TAG
from spherify.client import Client, ServiceError
from spherify.formats import write_mesh
from spherify.geometry.samples import SAMPLES
from spherify.stores.embedded import EmbeddedServer
from tests.cli.program import Running, running, spherify_here
from tests.processes import await_gone
from tests.stack import wait_for

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")

API = "-m service"
WORKER = "-m worker"
ENDLESS = {"iterations": "1000000", "annealing": "null", "stop_radius_variation": "0"}
SERVER = "-server "  # valkey-server or redis-server


@dataclass
class Up:
    """A service that runs."""

    command: Running
    data: Path
    url: str


@pytest.fixture(scope="module")
def up(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Up]:
    """A service for the tests that leave it running."""
    folder = tmp_path_factory.mktemp("up")
    with running("up", "--no-gallery", "--port", "0", "--data", "data", cwd=folder) as command:
        yield Up(command, folder / "data", command.url())


@pytest.fixture(scope="module")
def mesh(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("mesh") / "bar.obj"
    path.write_bytes(write_mesh(SAMPLES["stone"].build(200), "obj"))
    return path


def ready(url: str) -> bool:
    """Whether it says so; a request made while the API is started again waits in the port's queue."""
    return httpx.get(f"{url}/readyz", timeout=60).is_success


def test_each_line_says_who_wrote_it(up: Up) -> None:
    assert ready(up.url)
    wait_for(lambda: re.search(r"^api      │ .*readyz", up.command.text, re.MULTILINE))
    wait_for(lambda: re.search(r"^worker-1 │ .*ready", up.command.text, re.MULTILINE))


def test_the_lines_of_the_banner_work(up: Up, tmp_path: Path) -> None:
    def run(line: str) -> bytes:
        done = subprocess.run(line.split(), cwd=tmp_path, capture_output=True, check=True)
        return done.stdout

    banner = up.command.text
    (make,) = re.findall(r"^  spherify (samples .*)$", banner, re.MULTILINE)
    upload, look, download = re.findall(r"^  (curl .*)$", banner, re.MULTILINE)
    assert spherify_here(*make.split(), "--vertices", "200", cwd=tmp_path).code == 0
    upload = upload.replace("iterations=1000", "iterations=20").replace("10,50,100", "5")
    job_id = json.loads(run(f"{upload} -sS"))["id"]
    with Client(up.url) as client:
        list(client.follow(job_id))
    assert json.loads(run(look.replace("JOB_ID", job_id) + " -sS"))["status"] == "successful"
    run(download.replace("JOB_ID", job_id) + " -sS")
    assert [path.name for path in tmp_path.glob("*.ply")] == ["quadruped_it00020.ply"]


def test_no_other_name_is_given_to_it(up: Up) -> None:
    """It listens for its own machine: a page whose name was made to stand for that is not served."""
    answer = httpx.get(f"{up.url}/v1/jobs", headers={"Host": "attacker.example"})
    assert answer.json()["type"] == "/problems/unknown-host"


def test_the_first_start_makes_a_gallery_and_a_command_goes_on_with_it(tmp_path: Path) -> None:
    def shapes(client: Client) -> list[str]:
        return [job["name"] for job in client.jobs(tag=TAG)]

    with (
        running("up", "--port", "0", "--data", "data", cwd=tmp_path) as command,
        Client(command.url()) as client,
    ):
        wait_for(lambda: len(shapes(client)) >= 2, limit_s=90, what="a second shape")
        assert shapes(client)[-1] == ORDER[0]
        assert client.jobs(tag=TAG)[-1]["done"], "one at a time"
        command.process.send_signal(signal.SIGINT)
        assert command.process.wait(30) == 0
    with (
        running("up", "--no-gallery", "--port", "0", "--data", "data", cwd=tmp_path) as command,
        running("gallery", "--url", command.url(), cwd=tmp_path),  # the same by hand, as containers do
        Client(command.url()) as client,
    ):
        wait_for(lambda: len(shapes(client)) >= 3, limit_s=90, what="a third shape")
        made = shapes(client)
        assert len(made) == len(set(made)), "none twice"


def test_a_port_in_use_is_named_with_the_cure(up: Up, tmp_path: Path) -> None:
    port = httpx.URL(up.url).port
    done = spherify_here("up", "--port", str(port), "--data", "data", cwd=tmp_path)
    assert done.code == 1
    assert f"port {port}" in done.err
    assert "--port" in done.err
    assert "Traceback" not in done.err


def test_a_data_folder_in_use_is_refused(up: Up, tmp_path: Path) -> None:
    done = spherify_here("up", "--port", "0", "--data", up.data, cwd=tmp_path)
    assert done.code == 1
    assert str(up.data) in done.err
    assert f"process {up.command.process.pid}" in done.err
    assert "Traceback" not in done.err
    assert ready(up.url)


@pytest.mark.parametrize("program", [API, WORKER, SERVER])
def test_a_program_that_is_killed_is_started_again(up: Up, mesh: Path, program: str) -> None:
    (before,) = up.command.children(program)
    os.kill(before.pid, signal.SIGKILL)
    wait_for(before.gone)
    wait_for(lambda: up.command.children(program), what=f"another {program}")
    wait_for(lambda: ready(up.url))
    with Client(up.url) as client:
        *_, job = client.follow(client.submit(mesh, {"iterations": "3"})["id"])
    assert job["status"] == "successful"
    assert "starting it again" in up.command.text


def test_data_is_kept_between_runs_and_nothing_is_left_behind(tmp_path: Path, mesh: Path) -> None:
    with running("up", "--no-gallery", "--port", "0", "--data", "data", cwd=tmp_path) as command:
        with Client(command.url()) as client:
            *_, job = client.follow(client.submit(mesh, {"iterations": "3"})["id"])
            endless = client.submit(mesh, ENDLESS)["id"]
            wait_for(lambda: client.job(endless)["progress"]["iteration"] > 0)
        family = command.family()
        assert len(family) >= 4, family  # server, API, worker, its pool
        assert command.end(signal.SIGINT) == 0
        await_gone(family)
    assert command.text.endswith("stopped\n")

    with running(
        "up", "--no-gallery", "--port", "0", "--data", "data", "--workers", "2", cwd=tmp_path
    ) as command:
        with Client(command.url()) as client:
            assert client.job(job["id"])["status"] == "successful"
            client.download(job["id"], "final", "ply", tmp_path / "final.ply")
            again = wait_for(lambda: (found := client.job(endless))["status"] == "running" and found)
            assert again["attempt"] == 2
        assert len(command.children(WORKER)) == 2
        wait_for(lambda: len(command.family()) >= 6)  # both workers with their pools
        family = command.family()
        command.process.kill()
        await_gone(family)


def test_it_starts_on_a_full_disk_so_that_jobs_can_be_deleted(tmp_path: Path, mesh: Path) -> None:
    arguments = ("up", "--port", "0", "--data", "data")
    with running(*arguments, "--no-gallery", cwd=tmp_path) as command, Client(command.url()) as client:
        job = client.submit(mesh, {"iterations": "5"})
        list(client.follow(job["id"]))
        assert "is full" not in command.text
        assert command.end(signal.SIGINT) == 0
    full = {"SPHERIFY_MIN_FREE_BYTES": str(2**62)}
    with running(*arguments, cwd=tmp_path, environment=full) as command, Client(command.url()) as client:
        wait_for(lambda: "The data folder is full: uploads are refused" in command.text)
        with pytest.raises(ServiceError, match="make room there"):
            client.submit(mesh, {"iterations": "6"})
        assert [one["id"] for one in client.jobs()] == [job["id"]], "and no gallery"
        assert httpx.delete(f"{command.url()}/v1/jobs/{job['id']}").is_success
        assert not client.jobs()


def test_a_server_of_ones_own_is_used_and_left_alone(tmp_path: Path, server: EmbeddedServer) -> None:
    environment = {"REDIS_URL": server.url, "SPHERIFY_MAX_UPLOAD_BYTE": "1"}
    with running(
        "up", "--no-gallery", "--port", "0", "--data", "data", cwd=tmp_path, environment=environment
    ) as command:
        assert ready(command.url())
        for name in ("api     ", "worker-1"):
            misspelt = rf"^{name} │ .*MAX_UPLOAD_BYTE is no setting.*is SPHERIFY_MAX_UPLOAD_BYTES meant\?"
            wait_for(lambda told=misspelt: re.search(told, command.text, re.MULTILINE))
        assert not command.children(SERVER)
        family = command.family()
        assert command.end(signal.SIGTERM) == 0
        await_gone(family)
    assert server.url in command.text
    assert server.alive


def test_ctrl_c_while_starting(tmp_path: Path) -> None:
    with running("up", "--no-gallery", "--port", "0", "--data", "data", cwd=tmp_path) as command:
        wait_for(command.children)
        family = command.family()
        assert command.end(signal.SIGINT) == 0
        await_gone(family)
    assert "Traceback" not in command.text


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("SPHERIFY_LEASE_S", "soon", "valid number"),
        ("REDIS_URL", "nonsense", "no address of a server: write it as in redis://127.0.0.1:6379/0"),
        ("REDIS_URL", "http://127.0.0.1:6379", "no address"),
        ("REDIS_URL", "redis://:secret@127.0.0.1:port/0", "no address"),
        ("REDIS_URL", "redis://127.0.0.1/first", "no address"),
    ],
)
def test_a_wrong_setting_is_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, value: str, says: str
) -> None:
    monkeypatch.setenv(name, value)
    done = spherify_here("up", "--data", "data", cwd=tmp_path)
    assert done.code == 2
    (line,) = done.err.splitlines()
    assert line.startswith(f"spherify: {name} in the environment: ")
    assert says in line
    assert "secret" not in line


def test_a_host_that_does_not_exist_is_a_sentence(tmp_path: Path) -> None:
    done = spherify_here("up", "--host", "no.such.host.invalid", "--data", "data", cwd=tmp_path)
    assert done.code == 1
    assert "no.such.host.invalid" in done.err
    assert "Traceback" not in done.err
