"""One parameter chooses the method; presets and parameters belong to one."""

from __future__ import annotations

import httpx
import pytest

from spherify.geometry.presets import PRESETS
from tests.service.conftest import OCTAHEDRON, problem


def parameters_of(preset: str, client: httpx.Client) -> dict[str, object]:
    defaults = client.get("/v1/parameters").json()["defaults"]
    return dict(defaults[preset])


@pytest.mark.parametrize(
    ("asked", "method", "preset"),
    [
        ({}, "curvature", "robust"),
        ({"method": "curvature"}, "curvature", "robust"),
        ({"method": "conformal"}, "conformal", "conformal"),
        ({"parameters": {"method": "conformal"}}, "conformal", "conformal"),
        ({"preset": "conformal"}, "conformal", "conformal"),
        ({"preset": "mean-curvature"}, "mean-curvature", "mean-curvature"),
        ({"method": "mean-curvature", "preset": "mean-curvature"}, "mean-curvature", "mean-curvature"),
        ({"method": "curvature", "preset": "paper"}, "curvature", "paper"),
        ({"method": None, "preset": None}, "curvature", "robust"),
    ],
)
def test_method_and_preset_imply_each_other(
    client: httpx.Client, known: str, asked: dict[str, object], method: str, preset: str
) -> None:
    job = client.post("/v1/jobs", json={"mesh_id": known, **asked}).json()
    assert job["preset"] == preset
    assert job["parameters"]["method"] == method
    assert job["parameters"] == parameters_of(preset, client)


def test_a_form_chooses_it_with_a_field(client: httpx.Client) -> None:
    files = {"file": ("bunny.obj", OCTAHEDRON)}
    fields = {"method": "conformal", "time_step": "0.02", "iterations": "30"}
    job = client.post("/v1/jobs", files=files, data=fields).json()
    assert job["parameters"] == parameters_of("conformal", client) | {"time_step": 0.02, "iterations": 30}
    assert job["progress"]["iterations_total"] == 30


@pytest.mark.parametrize(
    ("asked", "pointer", "said"),
    [
        ({"method": "ricci"}, "#/method", "conformal"),
        ({"parameters": {"method": "ricci"}}, "#/parameters/method", "conformal"),
        (
            {"method": "conformal", "preset": "paper"},
            "#/parameters",
            "of the method curvature, not conformal",
        ),
        (
            {"preset": "mean-curvature", "parameters": {"method": "conformal"}},
            "#/parameters",
            "leave one out",
        ),
        ({"method": "curvature", "parameters": {"method": "conformal"}}, "#/method", "another"),
        ({"method": "conformal", "parameters": {"momentum": 0.5}}, "#/parameters", "no parameter momentum"),
        (
            {"method": "conformal", "parameters": {"annealing": None}},
            "#/parameters",
            "no parameter annealing",
        ),
        ({"parameters": {"time_step": 0.1}}, "#/parameters", "no parameter time_step"),
        ({"method": "conformal", "parameters": {"time_step": 0}}, "#/parameters/time_step", "greater than 0"),
        ({"method": "conformal", "parameters": {"time_step": 1.5}}, "#/parameters/time_step", "equal to 1"),
        ({"method": "conformal", "parameters": {"patience": -1}}, "#/parameters/patience", "equal to 0"),
    ],
)
def test_what_does_not_go_together_is_refused(
    client: httpx.Client, known: str, asked: dict[str, object], pointer: str, said: str
) -> None:
    answer = client.post("/v1/jobs", json={"mesh_id": known, **asked})
    errors = problem(answer, 422, "invalid-parameters")["errors"]
    assert isinstance(errors, list)
    assert errors[0]["pointer"] == pointer
    assert said in errors[0]["detail"]
    assert client.get("/v1/jobs").json()["items"] == []


def test_a_form_is_told_by_its_fields(client: httpx.Client) -> None:
    files = {"file": ("bunny.obj", OCTAHEDRON)}
    answer = client.post("/v1/jobs", files=files, data={"method": "ricci"})
    (error,) = problem(answer, 422, "invalid-parameters")["errors"]  # type: ignore[misc] # a list, as above
    assert error["pointer"] == "form/method"


def test_every_method_has_a_preset_and_every_preset_a_method(client: httpx.Client) -> None:
    methods = client.get("/v1/parameters").json()["methods"]
    assert {PRESETS[method["preset"]].config.method for method in methods} == {m["name"] for m in methods}
