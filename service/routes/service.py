"""/v1/info, /v1/presets, /v1/parameters, /healthz, /readyz."""

from __future__ import annotations

from http import HTTPStatus

from fastapi import APIRouter, Request, Response

from service import documentation as doc
from service.about import (
    HealthOut,
    InfoOut,
    ParametersOut,
    PresetsOut,
    ReadyOut,
    info_out,
    parameters_out,
    presets_out,
    probe,
)
from service.context import Context
from service.delivery import json_answer
from service.problems import ProblemError

router = APIRouter(tags=["Service"])


@router.get(
    "/v1/info",
    operation_id="getInfo",
    summary="What this service is, and its limits",
    response_model=InfoOut,
    responses=doc.problems(),
)
def get_info(request: Request, context: Context) -> Response:
    """Return version, limits, formats, and how many jobs are in each state."""
    return json_answer(request, info_out(context))


@router.get(
    "/v1/presets",
    operation_id="getPresets",
    summary="The presets",
    response_model=PresetsOut,
    responses=doc.problems(),
)
async def get_presets(request: Request) -> Response:
    """Return each preset with all its parameters and what to expect of it."""
    return json_answer(request, presets_out())


@router.get(
    "/v1/parameters",
    operation_id="getParameters",
    summary="The parameters as JSON Schema",
    response_model=ParametersOut,
    responses=doc.problems(),
)
async def get_parameters(request: Request, context: Context) -> Response:
    """Return titles, meanings, types and bounds of every parameter, and its value in each preset."""
    return json_answer(request, parameters_out(context.settings))


@router.get(
    "/healthz",
    operation_id="getHealth",
    summary="Whether the process lives",
    response_model=HealthOut,
    responses=doc.problems(),
)
async def get_health(request: Request) -> Response:
    """Answer at once, whatever the state of anything else: for restarting a process that hangs."""
    return json_answer(request, HealthOut(status="ok"), cache_control="no-store")


@router.get(
    "/readyz",
    operation_id="getReadiness",
    summary="Whether requests can be served",
    response_model=ReadyOut,
    responses={HTTPStatus.OK: {}, **doc.problems("not-ready")},
)
def get_readiness(request: Request, context: Context) -> Response:
    """Ask every part the service depends on; 503 `not-ready` names in `checks` the one that is down."""
    checks = probe(context)
    down = {name: state for name, state in checks.items() if state != "ok"}
    if down:
        detail = "; ".join(f"{name}: {state}" for name, state in down.items())
        raise ProblemError("not-ready", detail, extensions={"checks": checks})
    return json_answer(request, ReadyOut(status="ready", checks=checks), cache_control="no-store")
