from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from service.openapi import text
from service.problem_types import PROBLEMS
from service.problems import MEDIA_TYPE

COMMITTED = Path(__file__).resolve().parents[2] / "openapi" / "openapi.json"
DOCUMENT: dict[str, Any] = json.loads(COMMITTED.read_text())
OPERATIONS = {
    operation["operationId"]: operation
    for methods in DOCUMENT["paths"].values()
    for operation in methods.values()
}


def test_the_committed_document_is_fresh_and_the_same_every_time() -> None:
    assert text() == text() == COMMITTED.read_text(), "run `make openapi`"


def test_every_reference_leads_somewhere() -> None:
    def references(node: object) -> set[str]:
        if isinstance(node, dict):
            own = {node["$ref"]} if isinstance(node.get("$ref"), str) else set()
            return own.union(*map(references, node.values()))
        return set().union(*map(references, node)) if isinstance(node, list) else set()

    for reference in references(DOCUMENT):
        node: Any = DOCUMENT
        for part in reference.removeprefix("#/").split("/"):
            node = node[part]


@pytest.mark.parametrize("name", OPERATIONS)
def test_an_operation_is_described_for_client_authors(name: str) -> None:
    operation = OPERATIONS[name]
    assert operation["summary"]
    assert operation["description"]
    assert set(operation["tags"]) <= {tag["name"] for tag in DOCUMENT["tags"]}
    for parameter in operation.get("parameters", ()):
        assert parameter["description"], parameter["name"]
    assert "500" in operation["responses"]


def test_every_problem_is_documented_where_it_may_happen() -> None:
    documented = {
        slug
        for operation in OPERATIONS.values()
        for answer in operation["responses"].values()
        for slug in answer.get("content", {}).get(MEDIA_TYPE, {}).get("examples", ())
    }
    # of no operation in particular: the server's, the router's, and the refusals of web origins and of names
    before = {"address-too-long", "headers-too-large", "malformed-request", "method-not-allowed"}
    assert set(PROBLEMS) - documented == before | {"cross-site", "unknown-host"}
    assert {"cross-site", "unknown-host"} <= set(re.findall(r"`([a-z-]+)`", DOCUMENT["info"]["description"]))


def test_problem_examples_stand_under_their_status() -> None:
    for operation in OPERATIONS.values():
        for status, answer in operation["responses"].items():
            for slug, example in answer.get("content", {}).get(MEDIA_TYPE, {}).get("examples", {}).items():
                assert str(PROBLEMS[slug].status) == status == str(example["value"]["status"])


def test_no_trace_of_the_framework_is_left() -> None:
    assert "HTTPValidationError" not in DOCUMENT["components"]["schemas"]
    assert "anonymous" not in COMMITTED.read_text().lower()
