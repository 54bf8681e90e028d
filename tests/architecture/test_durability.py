"""docs/durability.md against the tests: every fault of the table is tried by tests that exist."""

from __future__ import annotations

import ast
import re

import pytest

from tests.architecture.source import ROOT

PAGE = (ROOT / "docs" / "durability.md").read_text("utf-8")
ROWS = {int(row[1]): row[0] for row in re.finditer(r"^\| (\d+) \|.*$", PAGE, re.MULTILINE)}


def test_every_fault_has_a_row() -> None:
    assert list(ROWS) == list(range(1, 24))


@pytest.mark.parametrize("number", ROWS)
def test_every_fault_is_tried_by_tests_that_exist(number: int) -> None:
    named = re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", ROWS[number])
    assert named
    for path, name in named:
        tree = ast.parse((ROOT / path).read_text("utf-8"))
        assert name in {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}, (
            path,
            name,
        )


def test_every_link_of_the_page_leads_somewhere() -> None:
    links = re.findall(r"\]\(([^)\s]+)\)", PAGE)
    assert len(links) > 10
    for link in links:
        assert (ROOT / "docs" / link).exists(), link


def test_the_states_are_drawn_as_in_the_code() -> None:
    drawing = re.search(r"## The states\n\n```\n(.*?)```", PAGE, re.DOTALL)
    assert drawing is not None
    assert drawing[1].rstrip() in (ROOT / "spherify" / "jobs" / "model.py").read_text("utf-8")
