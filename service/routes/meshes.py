"""/v1/meshes."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated, Final

from anyio import to_thread
from fastapi import APIRouter, Query, Request, Response

from service import documentation as doc
from service.conditions import heed, is_conditional
from service.context import Context
from service.conversion import Ascii, Color, Form, Precision, converted_mesh, original
from service.delivery import json_answer, json_text, text_etag
from service.forms import multipart
from service.identifiers import MeshFormat, MeshId
from service.paging import DEFAULT_LIMIT, Cursor, Limit, link_header, links
from service.problems import invalid
from service.queries import KNOWN_QUERY
from service.repeats import IDEMPOTENT, Identity, once
from service.requests import parse_allow
from service.schemas import MeshOut, PageOut, mesh_out
from service.uploads import DIGEST, raw_upload
from spherify.jobs.delete import delete_mesh
from spherify.jobs.model import MeshRecord

router = APIRouter(prefix="/v1/meshes", tags=["Meshes"], dependencies=[KNOWN_QUERY])
_NAME_MOST: Final = 255  # as long as file systems have them; `safe_name` shortens it, as that of a form
_KNOWN = {"description": "These bytes are known already: the record they have.", "headers": doc.LOCATION}
_UPLOADED = doc.problems(
    "malformed-multipart",
    "unsupported-media-type",
    "invalid-parameters",
    *doc.REPEATS,
    *doc.UPLOAD,
    *doc.STORES,
)
_UPLOADED_RAW = doc.problems("unsupported-media-type", "invalid-parameters", *doc.UPLOAD, *doc.STORES)


def _answer(request: Request, record: MeshRecord, new: bool) -> Response:
    status = HTTPStatus.CREATED if new else HTTPStatus.OK
    headers = {"Location": f"/v1/meshes/{record.id}"}
    return json_answer(request, mesh_out(record), status=status, headers=headers)


@router.post(
    "",
    operation_id="createMesh",
    dependencies=[IDEMPOTENT, DIGEST],
    summary="Upload a mesh as a form",
    status_code=HTTPStatus.CREATED,
    response_model=MeshOut,
    responses={
        HTTPStatus.OK: _KNOWN | {"model": MeshOut},
        HTTPStatus.CREATED: {"headers": doc.LOCATION},
        **_UPLOADED,
    },
    response_description="The mesh is accepted.",
    openapi_extra=doc.MESH_FORM,
)
async def create_mesh(request: Request, context: Context) -> Response:
    """Read, judge and keep a mesh: `curl -F file=@bunny.obj …/v1/meshes`.

    It must be one closed, oriented surface of genus 0; what is mended on the way in, and what is wrong, stands in
    the report. The same bytes with the same switches are the same mesh, so that sending them again is harmless.
    """
    async with multipart(request, context.stores.blobs, context.settings) as form:
        file = form.file
        if file is None:
            raise invalid("form/file", "missing", "the form needs the file of a mesh")
        if unknown := sorted(form.fields.keys() - {"allow"}):
            raise invalid(f"form/{unknown[0][:80]}", "unknown", "the fields are file and allow")
        allow = parse_allow(form.fields.get("allow", ()), "form/allow")

        async def act(_: Identity) -> Response:
            return _answer(request, *await context.intake.accept(file, allow))

        content = [file.sha256, file.name, sorted(allow)]
        return await once(request, context.stores.repeats, content, act)


@router.put(
    "",
    operation_id="putMesh",
    dependencies=[DIGEST],
    summary="Upload a mesh as it is",
    status_code=HTTPStatus.CREATED,
    response_model=MeshOut,
    responses={
        HTTPStatus.OK: _KNOWN | {"model": MeshOut},
        HTTPStatus.CREATED: {"headers": doc.LOCATION},
        **_UPLOADED_RAW,
    },
    response_description="The mesh is accepted.",
    openapi_extra=doc.MESH_RAW,
)
async def put_mesh(
    request: Request,
    context: Context,
    name: Annotated[
        str, Query(min_length=1, max_length=_NAME_MOST, description="File name; its ending names the format.")
    ],
    allow: Annotated[list[str], Query(description=doc.ALLOW_SCHEMA["description"])] = [],  # noqa: B006 (FastAPI copies it)
) -> Response:
    """Read, judge and keep a mesh whose bytes are the body: `curl -T bunny.obj "…/v1/meshes?name=bunny.obj"`."""
    switches = parse_allow(allow, "query/allow")
    async with raw_upload(request, name, context.stores.blobs, context.settings) as upload:
        return _answer(request, *await context.intake.accept(upload, switches))


@router.get(
    "",
    operation_id="listMeshes",
    summary="List meshes, newest first",
    response_model=PageOut[MeshOut],
    responses={HTTPStatus.OK: {"headers": doc.LINK}, **doc.problems("invalid-parameters", *doc.STORES)},
)
def list_meshes(
    request: Request, context: Context, limit: Limit = DEFAULT_LIMIT, cursor: Cursor = None
) -> Response:
    """Return a slice of all meshes; follow `Link: <…>; rel="next"` or `next_cursor` for more."""
    page = context.stores.meshes.find(limit=limit, cursor=cursor)
    found = links(request, page.next_cursor)
    items = [mesh_out(record) for record in page.items]
    answer = PageOut[MeshOut](items=items, next_cursor=page.next_cursor, links=found)
    return json_answer(request, answer, headers=link_header(found))


@router.get(
    "/{mesh_id}",
    operation_id="getMesh",
    summary="Look at a mesh",
    response_model=MeshOut,
    responses={HTTPStatus.OK: {"headers": doc.ETAG}, **doc.problems("not-found", *doc.STORES)},
)
def get_mesh(request: Request, context: Context, mesh_id: MeshId) -> Response:
    """Return what is known of a mesh: its report says what was repaired and what is wrong."""
    return json_answer(request, mesh_out(context.stores.meshes.get(mesh_id)))


@router.get(
    "/{mesh_id}/content",
    operation_id="downloadMesh",
    summary="Download the uploaded file",
    response_class=Response,
    responses=doc.mesh_answer("The bytes as they were uploaded.", inputs=True)
    | doc.problems("not-found", "range-not-satisfiable", *doc.FILES, *doc.STORES),
)
def download_mesh(request: Request, context: Context, mesh_id: MeshId) -> Response:
    """Return the file byte for byte."""
    return original(request, context, context.stores.meshes.get(mesh_id))


@router.get(
    "/{mesh_id}/content.{format}",
    operation_id="downloadMeshAs",
    summary="Download the accepted mesh in a format",
    response_class=Response,
    responses=doc.mesh_answer("The accepted mesh.")
    | doc.problems("not-found", "range-not-satisfiable", "invalid-parameters", *doc.FILES, *doc.STORES),
)
async def download_mesh_as(
    *,
    request: Request,
    context: Context,
    mesh_id: MeshId,
    format: MeshFormat,  # noqa: A002 (its name in the address)
    precision: Precision = "double",
    ascii: Ascii = False,  # noqa: A002 (its name in the address)
    color: Color = None,
) -> Response:
    """Return the mesh after repairs: vertices and triangles in the order of every snapshot made of it."""
    record = await to_thread.run_sync(context.stores.meshes.get, mesh_id)
    return await converted_mesh(request, context, record, Form(format, precision, ascii, color))


@router.delete(
    "/{mesh_id}",
    operation_id="deleteMesh",
    summary="Delete a mesh",
    status_code=HTTPStatus.NO_CONTENT,
    responses=doc.problems("not-found", "mesh-in-use", "precondition-failed", *doc.STORES),
)
def remove_mesh(request: Request, context: Context, mesh_id: MeshId) -> Response:
    """Delete a mesh and its files; refused while any job names it."""
    if is_conditional(request):
        heed(request, text_etag(json_text(mesh_out(context.stores.meshes.get(mesh_id)))))
    delete_mesh(context.stores.meshes, context.stores.blobs, mesh_id)
    return Response(status_code=HTTPStatus.NO_CONTENT)
