"""The README against the code: settings, verbs, commands, presets, addresses, links; and the API's description."""

from __future__ import annotations

import re
import runpy
import subprocess
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spherify.cli.commands import COMMANDS
from spherify.formats import ALLOW
from spherify.geometry.flow import StopReason
from spherify.geometry.presets import PRESETS
from spherify.geometry.samples import SAMPLES
from spherify.jobs.model import LEGAL_MOVES, JobStatus
from spherify.settings import Settings
from tests.architecture.source import ROOT, python_files, web_files

README = (ROOT / "README.md").read_text("utf-8")
MOST_LINES = 400
MOST_PICTURE_BYTES = 300_000


def _table(heading: str) -> dict[str, list[str]]:
    """Rows of the tables below a heading, by the code words in their first cells."""
    section = re.search(rf"^## {re.escape(heading)}\n(.*?)(?=^## |\Z)", README, re.DOTALL | re.MULTILINE)
    assert section is not None, f"the README has no section {heading!r}"
    rows: dict[str, list[str]] = {}
    lines = section[1].splitlines()
    for line, after in pairwise([*lines, ""]):
        cells = [cell.strip() for cell in line.strip("|").split("|")] if line.startswith("|") else []
        is_header = after.startswith("|---")
        if cells and not is_header and (word := re.match(r"`([^`]+)`", cells[0])):
            rows[word[1]] = cells[1:]
    return rows


def _environment(name: str) -> str:
    return "REDIS_URL" if name == "redis_url" else f"SPHERIFY_{name.upper()}"


def test_every_setting_is_in_the_table_with_its_default_and_meaning() -> None:
    table = _table("Configuration")
    assert table.keys() == {_environment(name) for name in Settings.model_fields}
    for name, field in Settings.model_fields.items():
        default, meaning = table[_environment(name)]
        written = default.strip("`")
        if isinstance(field.default, float):
            assert float(written) == field.default
        else:
            assert written == (str(field.default) if field.default != [] else "(none)")
        assert meaning == field.description


def test_every_verb_is_documented() -> None:
    out = subprocess.run(
        ["make", "help"], cwd=ROOT, capture_output=True, text=True, check=True, timeout=20
    ).stdout
    verbs = {
        f"make {line.split()[1]}": " ".join(line.split()[2:]) for line in out.splitlines() if line.strip()
    }
    table = _table("Development")
    assert {verb: cells[0] for verb, cells in table.items()} == verbs


def test_every_command_is_documented() -> None:
    assert {words.split()[1] for words in _table("Command line")} == set(COMMANDS)


def test_presets_switches_and_reasons_are_documented() -> None:
    assert _table("Presets, and what to expect of them").keys() >= PRESETS.keys()
    assert _table("Meshes").keys() == set(ALLOW)
    reasons = _table("What happens to a job")
    assert reasons.keys() == {reason.value for reason in StopReason}
    assert {cells[0] for cells in reasons.values()} <= {status.value for status in JobStatus}


@pytest.mark.parametrize("name", SAMPLES)
def test_the_table_of_what_to_expect_is_what_the_samples_do(name: str) -> None:
    figures = runpy.run_path(str(ROOT / "docs" / "figures.py"))
    said, found = (
        re.fullmatch(r"\| ([\w-]+) \| (.*) \|", line)
        for line in (re.search(rf"^\| {name} \| \d.*$", README, re.MULTILINE)[0], figures["row"](name))  # type: ignore[index]
    )
    assert said is not None
    assert found is not None
    said_cells, found_cells = (
        [float(cell.split(" of ")[0]) for cell in row[2].replace(",", "").split(" | ")]
        for row in (said, found)
    )
    # By rounding, another processor may differ in the last digit; in `paper`, the run of an animal is chaotic.
    room = [0, 1e-3, 1, 1, 2e-4, 0, 0.02 if name == "quadruped" else 0.002]
    assert (np.abs(np.array(found_cells) - said_cells) <= room).all()


def test_the_picture_of_the_states_has_exactly_the_legal_moves() -> None:
    drawn = set(re.findall(r"^    (\w+) --> (\w+)", README, re.MULTILINE))
    legal = {(status.value, after.value) for status, moves in LEGAL_MOVES.items() for after in moves}
    assert drawn == legal


def test_every_link_and_named_file_exists() -> None:
    links = [link for link in re.findall(r"\]\(([^)\s]+)\)", README) if not link.startswith("http")]
    named = re.findall(
        r"`((?:docs|tests|spherify|openapi|requirements|service|worker|\.ci)/[\w./-]*)`", README
    )
    assert len(links) > 5
    for path in (*links, *named):
        assert (ROOT / path.partition("#")[0]).exists(), path
    for picture in (ROOT / "docs" / "images").iterdir():
        assert picture.stat().st_size < MOST_PICTURE_BYTES, picture
        assert f"docs/images/{picture.name}" in README, f"nobody shows {picture.name}"


def test_every_address_the_readme_names_exists(routes: dict[str, set[str]]) -> None:
    known = {re.sub(r"\{\w+\}", "{}", path) for path in routes}
    rows = re.search(r"^## The API\n(.*?)^## ", README, re.DOTALL | re.MULTILINE)
    assert rows is not None
    for path in re.findall(r"`(?:(?:GET|POST|PUT|DELETE) )?(/[\w/{}.?=-]+)`", rows[1]):
        assert re.sub(r"\{\w+\}", "{}", path.partition("?")[0]) in known, path


def test_the_description_covers_every_route(routes: dict[str, set[str]], description: dict[str, Any]) -> None:
    described = {path: {method.upper() for method in item} for path, item in description["paths"].items()}
    for path, methods in routes.items():
        if path.startswith("/v1") or path in {"/healthz", "/readyz"}:
            assert described[path] >= methods - {"HEAD"}, path
    assert described.keys() <= routes.keys()


@pytest.mark.parametrize(
    "path", [*python_files(), *web_files()], ids=lambda path: str(path.relative_to(ROOT))
)
def test_no_file_is_too_long(path: Path) -> None:
    assert len(path.read_text("utf-8").splitlines()) <= MOST_LINES
