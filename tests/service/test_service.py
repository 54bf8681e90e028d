from __future__ import annotations

import ast
import html
import json
import logging
import os
import re
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import fields
from pathlib import Path

import httpx
import pytest

import service
from service.pages import landing
from service.schemas import FiguresOut
from spherify.geometry.metrics import Metrics
from spherify.geometry.presets import PRESETS
from spherify.logs import JsonLines
from spherify.parameters import PARAMETER_NAMES, parameters_of
from spherify.settings import Settings
from spherify.stores import keys
from spherify.stores.connect import Stores, open_stores
from tests.service.conftest import OCTAHEDRON, Hand, problem, serve, until

ROOT = Path(service.__file__).parent


def test_info_names_limits_and_formats(
    client: httpx.Client, settings: Settings, submitted: Callable[..., Hand]
) -> None:
    submitted()
    info = client.get("/v1/info").json()
    assert info["limits"]["max_upload_bytes"] == settings.max_upload_bytes
    assert [form["name"] for form in info["formats"]["read"]] == ["obj", "ply", "stl", "off", "glb", "3mf"]
    assert [form["name"] for form in info["formats"]["written"]] == ["obj", "ply", "stl", "off", "glb"]
    assert info["jobs"]["accepted"] == 1
    assert info["default_preset"] in PRESETS


def test_presets_are_whole_and_can_be_sent_back(client: httpx.Client, known: str) -> None:
    presets = client.get("/v1/presets").json()["items"]
    assert {preset["name"] for preset in presets} == set(PRESETS)
    assert [preset["default"] for preset in presets] == [True] + [False] * (len(PRESETS) - 1)
    for preset in presets:
        request = {"mesh_id": known, "preset": preset["name"], "parameters": preset["parameters"]}
        job = client.post("/v1/jobs", json=request).json()
        assert job["parameters"] == preset["parameters"]


def test_parameters_are_a_schema_with_defaults(client: httpx.Client) -> None:
    answer = client.get("/v1/parameters").json()
    properties = answer["schema"]["properties"]
    assert set(properties) == set(PARAMETER_NAMES)
    assert all(entry["title"] for entry in properties.values())
    assert properties["momentum"]["exclusiveMaximum"] == 1
    for name, preset in PRESETS.items():
        assert answer["defaults"][name] == parameters_of(preset.config).model_dump(mode="json")
    assert [method["name"] for method in answer["methods"]] == ["curvature", "conformal", "mean-curvature"]
    assert [method["default"] for method in answer["methods"]] == [True, False, False]
    for method in answer["methods"]:
        names = {name for name, entry in properties.items() if method["name"] in entry["x-methods"]}
        assert names == set(method["parameters"]) == set(answer["defaults"][method["preset"]])


def test_health_needs_nothing_and_readiness_says_what_is_down(
    settings: Settings, client: httpx.Client
) -> None:
    assert client.get("/readyz").json()["status"] == "ready"
    lost = settings.model_copy(update={"redis_url": "redis://127.0.0.1:1/0"})
    stores = open_stores(lost)
    with serve(lost, stores) as url:
        assert httpx.get(f"{url}/healthz").json() == {"status": "ok"}
        document = problem(httpx.get(f"{url}/readyz"), 503, "not-ready")
        assert httpx.get(f"{url}/v1/info").json()["jobs"] is None
    stores.close()
    checks = document["checks"]
    assert isinstance(checks, dict)
    assert checks["files"] == "ok"
    assert "ok" not in {checks["jobs"], checks["meshes"], checks["queue"]}


@pytest.mark.parametrize("path", ["/docs", "/problems"])
def test_pages_need_no_other_host(client: httpx.Client, path: str) -> None:
    answer = client.get(path)
    assert answer.headers["content-type"].startswith("text/html")
    assert not re.findall(r"""(?:src|@import)\s*=?\s*["'(]""", answer.text)
    assert "<link" not in answer.text
    assert "<script" not in answer.text


def test_the_documentation_names_every_operation(client: httpx.Client) -> None:
    page = client.get("/docs").text
    for path, methods in client.get("/openapi.json").json()["paths"].items():
        for method in methods:
            assert f"{method.upper()} {path}" in page


def test_the_pages_name_the_defaults(client: httpx.Client) -> None:
    page = client.get("/docs").text
    for name, value in (("precision", "double"), ("limit", 50)):
        row = page.split(f"<code>{name}</code>", maxsplit=1)[1].split("</tr>")[0]
        assert f"by default <code>{html.escape(json.dumps(value))}</code>" in row


def test_links_of_the_landing_page_lead_somewhere(client: httpx.Client) -> None:
    page = landing("http://localhost:8000", "not built")
    assert "not built" in page
    links = re.findall(r'href="(/[^"]*)"', page)
    assert len(links) > 5
    for link in links:
        assert client.get(link).status_code == 200


@pytest.fixture
def lines(client: httpx.Client) -> Iterator[list[dict[str, object]]]:
    """The log as it is written."""
    found: list[dict[str, object]] = []

    class Keep(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            text = self.format(record)
            assert "\n" not in text
            found.append(json.loads(text))

    handler, logger = Keep(), logging.getLogger("service")
    handler.setFormatter(JsonLines())
    level = logger.level
    logger.setLevel(logging.INFO)
    logger.addHandler(handler)
    yield found
    logger.removeHandler(handler)
    logger.setLevel(level)


def test_every_answer_and_log_line_has_the_request_id(
    client: httpx.Client, lines: list[dict[str, object]], known: str
) -> None:
    given = client.get("/v1/jobs/none", headers={"X-Request-ID": "mine-1"})
    assert given.headers["x-request-id"] == given.json()["request_id"] == "mine-1"
    made = client.get("/healthz", headers={"X-Request-ID": "two words"})
    assert re.fullmatch(r"req_[0-9A-Z]{26}", made.headers["x-request-id"])
    job = client.post("/v1/jobs", json={"mesh_id": known}, headers={"X-Request-ID": "mine-2"}).json()
    until(lambda: len(lines) == 4)  # a line is written when its answer is out already
    assert {(line["request_id"], line["status"], line["path"]) for line in lines if "status" in line} == {
        ("mine-1", 404, "/v1/jobs/none"),
        (made.headers["x-request-id"], 200, "/healthz"),
        ("mine-2", 201, "/v1/jobs"),
    }
    (submitted,) = (line for line in lines if "action" in line)
    assert (submitted["action"], submitted["job_id"], submitted["request_id"]) == (
        "submit",
        job["id"],
        "mine-2",
    )


def test_log_lines_cannot_be_forged(client: httpx.Client, lines: list[dict[str, object]]) -> None:
    client.get("/a%0d%0a%22,%22status%22:%22200")
    until(lambda: len(lines) == 1)
    assert lines[0]["path"] == "/a%0d%0a%22,%22status%22:%22200"


def test_little_of_a_long_address_is_said_back_or_logged(
    client: httpx.Client, lines: list[dict[str, object]]
) -> None:
    answer = client.get("/" + "a" * 8000)
    document = problem(answer, 404, "not-found")
    assert document["instance"] == "/" + "a" * 199 + "%E2%80%A6"
    assert len(answer.content) < 1000
    until(lambda: len(lines) == 1)
    assert lines[0]["path"] == "/" + "a" * 199 + "…"
    assert len(str(lines[0])) < 1000


@pytest.mark.parametrize("cause", ["DamagedBlobError", "JSONDecodeError"])
def test_a_failure_of_ours_is_logged_with_its_trace(
    client: httpx.Client,
    stores: Stores,
    submitted: Callable[..., Hand],
    lines: list[dict[str, object]],
    cause: str,
) -> None:
    hand = submitted().claim().reach(0)
    if cause == "DamagedBlobError":
        (stores.blobs.root / hand.job().snapshots[0].key).write_bytes(b"damaged")
    else:
        stores.client.hset(keys.job(hand.job_id), "spec", "{")
    answer = client.get(f"/v1/jobs/{hand.job_id}/snapshots/0.ply")
    failures = [line for line in lines if line["level"] == "error" and "request_id" in line]
    assert [failure["request_id"] for failure in failures] == [answer.json()["request_id"]]
    assert cause in str(failures[0]["trace"])


def test_web_origins_are_an_explicit_list(settings: Settings, stores: Stores) -> None:
    good, evil = {"Origin": "https://good.example"}, {"Origin": "https://evil.example"}
    changed = settings.model_copy(update={"cors_origins": ["https://good.example"]})
    with serve(changed, stores) as url, httpx.Client(base_url=url) as client:
        for path in ("/healthz", "/v1/jobs/none", "/nowhere", "/v1/jobs?limit=0"):
            answer = client.get(path, headers=good)
            assert answer.headers["access-control-allow-origin"] == "https://good.example"
            assert {"Location", "ETag", "Link", "Retry-After", "Content-Disposition"} <= set(
                answer.headers["access-control-expose-headers"].split(", ")
            )
            assert "access-control-allow-origin" not in client.get(path, headers=evil).headers
        broken = client.post("/v1/jobs", files={"file": ("o.obj", b"")}, headers=good)
        assert broken.headers["access-control-allow-origin"] == "https://good.example"
        asked = {
            "Access-Control-Request-Method": "DELETE",
            "Access-Control-Request-Headers": "if-none-match,content-digest",
        }
        assert client.options("/v1/jobs/x", headers=good | asked).status_code == 200
        refused = client.options("/v1/jobs/x", headers=evil | asked)
        problem(refused, 400, "malformed-request")


def test_failures_of_ours_reach_web_clients_too(
    settings: Settings, stores: Stores, submitted: Callable[..., Hand]
) -> None:
    hand = submitted().claim().reach(0)
    path = stores.blobs.root / hand.job().snapshots[0].key
    path.write_bytes(b"damaged")
    changed = settings.model_copy(update={"cors_origins": ["https://good.example"]})
    with serve(changed, stores) as url:
        answer = httpx.get(
            f"{url}/v1/jobs/{hand.job_id}/snapshots/0.ply", headers={"Origin": "https://good.example"}
        )
    problem(answer, 500, "stored-file-damaged")
    assert answer.headers["access-control-allow-origin"] == "https://good.example"


def test_figures_are_those_of_the_mathematics() -> None:
    assert set(FiguresOut.model_fields) == {field.name for field in fields(Metrics)}


def test_only_the_problems_know_error_numbers() -> None:
    for path in ROOT.rglob("*.py"):
        if path.name in {"problems.py", "problem_types.py"}:
            continue
        tree = ast.parse(path.read_text())
        plain = [
            n for n in ast.walk(tree) if not isinstance(n, ast.List)
        ]  # lists hold iterations, as examples
        children = [child for node in plain for child in ast.iter_child_nodes(node)]
        numbers = [n.value for n in children if isinstance(n, ast.Constant) and type(n.value) is int]
        assert not [n for n in numbers if 400 <= n < 600], path
        names = {n.attr for n in ast.walk(tree) if isinstance(n, ast.Attribute)}
        assert not names & {"NOT_FOUND", "BAD_REQUEST", "CONFLICT", "INTERNAL_SERVER_ERROR", "GONE"}, path


def test_it_starts_from_the_environment_and_stops_cleanly(server_url: str, tmp_path: Path) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [
        sys.executable,
        "-W",
        "error::ResourceWarning",
        "-m",
        "service",
    ]
    environment = os.environ | {"REDIS_URL": server_url, "SPHERIFY_DATA_DIR": str(tmp_path)}
    process = subprocess.Popen(
        [*command, "--port", str(port)], env=environment, cwd=ROOT.parent, stderr=subprocess.PIPE, text=True
    )
    try:
        transport = httpx.HTTPTransport(retries=0)
        deadline, pause = time.monotonic() + 30, threading.Event()
        with httpx.Client(base_url=f"http://127.0.0.1:{port}", transport=transport) as client:
            while True:
                try:
                    assert client.get("/readyz").status_code == 200
                    break
                except httpx.ConnectError:
                    assert time.monotonic() < deadline
                    pause.wait(0.05)
            mesh = client.put("/v1/meshes?name=o.obj", content=OCTAHEDRON).json()
            assert client.delete(mesh["links"]["self"]).status_code == 204
    finally:
        process.terminate()
        _, errors = process.communicate(timeout=20)
    assert process.returncode in {0, -15}, errors
    assert "Traceback" not in errors
    logged = [json.loads(line) for line in errors.splitlines() if line.startswith("{")]
    assert [line["status"] for line in logged if line.get("method") == "DELETE"] == [204]
    assert "INFO:     127.0.0.1" not in errors, "uvicorn's own line would say it twice"
