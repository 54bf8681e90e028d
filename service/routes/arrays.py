"""What a viewer loads into a GPU's buffers: …/topology once, then …/positions and …/fields of each state."""

from __future__ import annotations

from typing import Annotated, Any

from anyio import to_thread
from fastapi import APIRouter, Query, Request, Response

from service import arrays
from service import documentation as doc
from service.context import Context, Services
from service.delivery import IMMUTABLE
from service.identifiers import JobId, MeshId, VertexField, Which
from service.queries import KNOWN_QUERY
from service.snapshots import find
from spherify.formats.viewer import PositionType
from spherify.jobs.model import Job

router = APIRouter(tags=["Viewer"], dependencies=[KNOWN_QUERY])
TOPOLOGY = doc.array_answer(
    "3m uint32, little endian: three vertices a triangle, counter-clockwise from outside."
)
POSITIONS = doc.array_answer(
    "`f32`: 3n float32, little endian. `u16`: 6 float32, the least and the greatest corner of the bounding box, then "
    "3n uint16 q; a coordinate is low + q · (high − low) / 65535."
)
FIELD = doc.array_answer("n float32, little endian: one value a vertex, in the order of the vertices.")
OF_MESH = doc.problems("not-found", "range-not-satisfiable", "invalid-parameters", *doc.FILES, *doc.STORES)
OF_JOB = doc.problems(
    "not-found", "gone", "range-not-satisfiable", "invalid-parameters", *doc.FILES, *doc.STORES
)
OF_STATE = doc.problems(
    "not-found",
    "result-not-ready",
    "gone",
    "range-not-satisfiable",
    "invalid-parameters",
    *doc.FILES,
    *doc.STORES,
)
Dtype = Annotated[
    PositionType,
    Query(description="`f32`: as float32; `u16`: quantised, half the size, off by half a step at most."),
]


def _common(name: str, answer: doc.Responses, problems: doc.Responses) -> dict[str, Any]:
    return {"operation_id": name, "response_class": Response, "responses": answer | problems}


async def _job(services: Services, job_id: str) -> Job:
    return await to_thread.run_sync(services.stores.jobs.get, job_id)


async def _state(services: Services, job_id: str, which: str) -> tuple[arrays.State, str]:
    job = await _job(services, job_id)
    snapshot, cache_control = find(job, which)
    return arrays.State(job.spec.mesh_id, snapshot), cache_control


async def _mesh(services: Services, mesh_id: str) -> arrays.State:
    return arrays.State((await to_thread.run_sync(services.stores.meshes.get, mesh_id)).id)


@router.get(
    "/v1/jobs/{job_id}/topology",
    summary="The triangles of a job's mesh, as a bare array",
    **_common("getTopology", TOPOLOGY, OF_JOB),
)
async def get_topology(request: Request, context: Context, job_id: JobId) -> Response:
    """Return the triangles; they are the same in every state, so that a viewer loads them once."""
    job = await _job(context, job_id)
    return await arrays.topology(request, context, job.spec.mesh_id, IMMUTABLE)


@router.get(
    "/v1/jobs/{job_id}/snapshots/{which}/positions",
    summary="The positions of a kept state, as a bare array",
    **_common("getPositions", POSITIONS, OF_STATE),
)
async def get_positions(
    *, request: Request, context: Context, job_id: JobId, which: Which, dtype: Dtype = "f32"
) -> Response:
    """Return where the vertices are, also while the job runs; in the order that `topology` names them in."""
    state, cache_control = await _state(context, job_id, which)
    return await arrays.positions(request, context, state, dtype, cache_control)


@router.get(
    "/v1/jobs/{job_id}/snapshots/{which}/fields/{field}",
    summary="A scalar field over the vertices of a kept state, as a bare array",
    **_common("getField", FIELD, OF_STATE),
)
async def get_field(
    *, request: Request, context: Context, job_id: JobId, which: Which, field: VertexField
) -> Response:
    """Return one value a vertex, to colour by."""
    state, cache_control = await _state(context, job_id, which)
    return await arrays.field(request, context, state, field, cache_control)


@router.get(
    "/v1/meshes/{mesh_id}/topology",
    summary="The triangles of a mesh, as a bare array",
    **_common("getMeshTopology", TOPOLOGY, OF_MESH),
)
async def get_mesh_topology(request: Request, context: Context, mesh_id: MeshId) -> Response:
    """Return the triangles as they were accepted."""
    state = await _mesh(context, mesh_id)
    return await arrays.topology(request, context, state.mesh_id, IMMUTABLE)


@router.get(
    "/v1/meshes/{mesh_id}/positions",
    summary="The positions of a mesh, as a bare array",
    **_common("getMeshPositions", POSITIONS, OF_MESH),
)
async def get_mesh_positions(
    request: Request, context: Context, mesh_id: MeshId, dtype: Dtype = "f32"
) -> Response:
    """Return where the vertices are as they were accepted."""
    return await arrays.positions(request, context, await _mesh(context, mesh_id), dtype, IMMUTABLE)


@router.get(
    "/v1/meshes/{mesh_id}/fields/{field}",
    summary="A scalar field over the vertices of a mesh, as a bare array",
    **_common("getMeshField", FIELD, OF_MESH),
)
async def get_mesh_field(request: Request, context: Context, mesh_id: MeshId, field: VertexField) -> Response:
    """Return one value a vertex, to colour by; the displacement is 0."""
    return await arrays.field(request, context, await _mesh(context, mesh_id), field, IMMUTABLE)
