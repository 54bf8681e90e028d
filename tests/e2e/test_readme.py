"""What the README shows, done: its curl lines on a started stack, and its problem document."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys

import httpx

from tests.architecture.source import ROOT
from tests.stack import Stack

JOURNEY = ROOT / "tests" / "e2e" / "journey.sh"
BOX_WITHOUT_A_LID = b"""\
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 1
v 1 0 1
v 1 1 1
v 0 1 1
f 4 3 2 1
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
"""


def _journey(*arguments: str) -> str:
    # one mind about proxies: the stack is on this machine
    local = {"NO_PROXY": "127.0.0.1,localhost", "no_proxy": "127.0.0.1,localhost"}
    environment = {**os.environ, **local, "PYTHON": sys.executable}
    run = subprocess.run(
        [JOURNEY, *arguments], env=environment, capture_output=True, text=True, timeout=100, check=False
    )
    assert run.returncode == 0, run.stdout + run.stderr
    return run.stdout


def test_the_curl_lines_morph_a_mesh_and_what_they_made_stays(stack: Stack) -> None:
    said = _journey(stack.url)
    assert said.count("$ curl ") == 3
    assert "journey ok" in said
    assert "journey ok" in _journey(stack.url, "--kept")


def test_the_problem_document_is_what_a_box_without_a_lid_gets(stack: Stack) -> None:
    shown = re.search(
        r"<!-- problem -->\n```json\n(.*?)```", (ROOT / "README.md").read_text("utf-8"), re.DOTALL
    )
    assert shown is not None
    answer = httpx.post(f"{stack.url}/v1/jobs", files={"file": ("box.obj", BOX_WITHOUT_A_LID)}, timeout=30)
    got, written = answer.json(), json.loads(shown[1])
    assert re.fullmatch(r"req_[0-9A-Z]{26}", written.pop("request_id"))
    assert {name: got[name] for name in written} == written
    assert got.keys() - written.keys() == {"request_id", "errors", "report"}
