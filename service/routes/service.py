"""/v1/info, /v1/presets, /v1/parameters, /v1/samples, /healthz, /readyz."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated

from fastapi import APIRouter, Path, Query, Request, Response

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
from service.queries import KNOWN_QUERY
from service.samples import DEFAULT_VERTICES, MAX_VERTICES, SamplesOut, samples_out, take_in
from service.schemas import MeshOut, mesh_out
from spherify.geometry.samples import SAMPLES

router = APIRouter(tags=["Service"])


@router.get(
    "/v1/info",
    operation_id="getInfo",
    dependencies=[KNOWN_QUERY],
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
    dependencies=[KNOWN_QUERY],
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
    dependencies=[KNOWN_QUERY],
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


@router.get(
    "/v1/samples",
    operation_id="listSamples",
    dependencies=[KNOWN_QUERY],
    tags=["Meshes"],
    summary="The sample shapes",
    response_model=SamplesOut,
    responses=doc.problems("invalid-parameters"),
)
async def list_samples(request: Request) -> Response:
    """Return the shapes of the paper's pictures, as the service can build them."""
    return json_answer(request, samples_out())


@router.post(
    "/v1/samples/{sample}",
    operation_id="createSample",
    dependencies=[KNOWN_QUERY],
    tags=["Meshes"],
    summary="Make a mesh of a sample shape",
    status_code=HTTPStatus.CREATED,
    response_model=MeshOut,
    responses={
        HTTPStatus.OK: {"description": "It was made before: the record it has.", "model": MeshOut},
        HTTPStatus.CREATED: {"description": "The mesh is made.", "headers": doc.LOCATION},
        **doc.problems("not-found", "invalid-parameters", "rate-limited", "storage-full", *doc.STORES),
    },
)
async def create_sample(
    request: Request,
    context: Context,
    sample: Annotated[str, Path(description="Which.", json_schema_extra={"enum": list(SAMPLES)})],
    vertices: Annotated[
        int, Query(ge=100, le=MAX_VERTICES, description="How many vertices to aim at.")
    ] = DEFAULT_VERTICES,
) -> Response:
    """Build the shape and keep it as a mesh to be morphed: the same name and number are the same mesh."""
    if sample not in SAMPLES:
        raise ProblemError("not-found", f"there is no sample {sample[:40]!r}; there are {', '.join(SAMPLES)}")
    record, new = await take_in(context, sample, vertices)
    status = HTTPStatus.CREATED if new else HTTPStatus.OK
    headers = {"Location": f"/v1/meshes/{record.id}"}
    return json_answer(request, mesh_out(record), status=status, headers=headers)
