"""schemathesis: the service against its own description, over HTTP, with real stores behind it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, settings
from schemathesis import Case
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
    status_code_conformance,
    unsupported_method,
)

from service.waiting import MAX_WAIT_S
from tests.service.conftest import Hand
from tests.service.test_openapi import DOCUMENT

CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
    unsupported_method,
]
UPLOADS = ["createJob", "createMesh", "createSample", "putMesh"]
STREAMS = ["followJob"]  # as long as their job: tests/service/test_events.py reads them
schema = schemathesis.openapi.from_dict(DOCUMENT)
sampled = schemathesis.openapi.from_dict(DOCUMENT)  # each case may start a reading process: a few, at random
sampled.config.phases.coverage.enabled = False
valid = schemathesis.openapi.from_dict(DOCUMENT)  # what is wrong on purpose is sent by the two above
valid.config.generation.modes = [schemathesis.GenerationMode.POSITIVE]
valid.config.phases.coverage.enabled = False


def bounded(examples: int) -> Callable[..., Any]:
    """The same few cases every time."""
    return settings(
        max_examples=examples,
        deadline=None,
        derandomize=True,
        database=None,
        phases=(Phase.explicit, Phase.generate),
        suppress_health_check=list(HealthCheck),
    )


@schema.exclude(operation_id=UPLOADS).parametrize()
@bounded(8)
def test_whatever_is_sent_is_answered_as_described(case: Case, base_url: str) -> None:
    case.call_and_validate(base_url=base_url, checks=CHECKS, timeout=30)


@sampled.include(operation_id=UPLOADS).parametrize()
@bounded(5)
def test_whatever_is_uploaded_is_answered_as_described(case: Case, base_url: str) -> None:
    case.call_and_validate(base_url=base_url, checks=CHECKS, timeout=30)


def _seconds(wait: object) -> float:
    """As the service reads a time to wait; what it refuses stays as it is."""
    try:
        seconds = float(str(wait))
    except ValueError:
        return -1
    return seconds if 0 <= seconds <= MAX_WAIT_S else -1


@pytest.fixture
def life(submitted: Callable[..., Hand]) -> dict[str, list[str]]:
    """A mesh, and jobs in every stage."""
    waiting = submitted()
    running = submitted().claim().reach(0).reach(100)
    finished = submitted().claim().reach(0).reach(100).reach(1000).end()
    return {
        "job_id": [waiting.job_id, running.job_id, finished.job_id],
        "mesh_id": [waiting.job().spec.mesh_id],
        "which": ["0", "100", "500", "latest", "best", "final", "initial"],
        "field": ["curvature", "distance", "displacement", "quality"],
    }


@(
    schema.include(path_regex="{")
    .exclude(method="DELETE")
    .exclude(operation_id=[*STREAMS, "createSample"])
    .parametrize()
)
@bounded(12)
def test_what_exists_is_answered_as_described(case: Case, base_url: str, life: dict[str, list[str]]) -> None:
    """The same with names that exist, each in turn as the generated name falls."""
    for name, values in life.items():
        if name in case.path_parameters:
            case.path_parameters[name] = values[len(str(case.path_parameters[name])) % len(values)]
    if "wait" in (case.query or {}):
        case.query["wait"] = min(case.query["wait"], 0.01, key=_seconds)  # nobody works on these jobs
    case.call_and_validate(base_url=base_url, checks=CHECKS, timeout=30)


@valid.include(operation_id="createJob").parametrize()
@bounded(40)
def test_jobs_on_a_mesh_that_exists_are_answered_as_described(case: Case, base_url: str, known: str) -> None:
    if isinstance(case.body, dict) and (case.body.pop("file", None) is not None or "mesh_id" in case.body):
        case.body["mesh_id"] = known
    case.call_and_validate(base_url=base_url, checks=CHECKS, timeout=30)
