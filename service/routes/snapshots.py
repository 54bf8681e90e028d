"""/v1/jobs/{job_id}/snapshots and /v1/jobs/{job_id}/metrics."""

from __future__ import annotations

import io
from http import HTTPStatus
from typing import Annotated, BinaryIO

from anyio import to_thread
from fastapi import APIRouter, Query, Request, Response

from service import archive
from service import documentation as doc
from service.arrays import State
from service.context import Context
from service.conversion import Ascii, Color, Form, Precision, conversion, converted_snapshot
from service.delivery import (
    IMMUTABLE,
    REVALIDATE,
    Content,
    deliver,
    file_name,
    json_answer,
    stream,
    strong_etag,
)
from service.identifiers import JobId, MeshFormat, Which
from service.queries import KNOWN_QUERY
from service.schemas import (
    MetricsOut,
    SnapshotOut,
    SnapshotsOut,
    metrics_out,
    snapshot_out,
    snapshots_out,
)
from service.snapshots import find, negotiate, retry_after_s
from service.uploads import check_space
from spherify import __version__
from spherify.formats import FORMATS_OUT
from spherify.jobs.errors import JobNotFinishedError
from spherify.jobs.model import Job, MeshRecord, Snapshot

router = APIRouter(prefix="/v1/jobs/{job_id}", tags=["Snapshots"], dependencies=[KNOWN_QUERY])
VARY = "Accept"
_KEPT_SHARE = 2  # of the cache: so much of it may be taken by the states of one archive


@router.get(
    "/snapshots",
    operation_id="listSnapshots",
    summary="List the kept states of a job",
    response_model=SnapshotsOut,
    responses={
        HTTPStatus.OK: {"headers": doc.ETAG | doc.RETRY_AFTER},
        **doc.problems("not-found", "gone", *doc.STORES),
    },
)
def list_snapshots(request: Request, context: Context, job_id: JobId) -> Response:
    """Return what is kept so far, ascending, each with its figures and links; also while the job runs."""
    job = context.stores.jobs.get(job_id)
    headers = {} if job.status.done else {"Retry-After": str(retry_after_s(job))}
    return json_answer(request, snapshots_out(job), headers=headers)


@router.get(
    "/snapshots/{which}.{format}",
    operation_id="downloadSnapshot",
    summary="Download a kept state as a mesh",
    response_class=Response,
    responses=doc.mesh_answer("The mesh at that iteration.")
    | doc.problems(
        "not-found",
        "result-not-ready",
        "gone",
        "range-not-satisfiable",
        "invalid-parameters",
        *doc.FILES,
        *doc.STORES,
    ),
)
async def download_snapshot(
    *,
    request: Request,
    context: Context,
    job_id: JobId,
    which: Which,
    format: MeshFormat,  # noqa: A002 (its name in the address)
    precision: Precision = "double",
    ascii: Ascii = False,  # noqa: A002 (its name in the address)
    color: Color = None,
) -> Response:
    """Return the state as a file, also while the job runs: `curl -OJ …/snapshots/latest.ply`.

    Vertices and triangles keep their order from one snapshot to the next. A state that was asked for and is not
    reached yet is 404 `result-not-ready` with `Retry-After`.
    """
    job = await to_thread.run_sync(context.stores.jobs.get, job_id)
    return await converted_snapshot(
        request, context, job, find(job, which), Form(format, precision, ascii, color)
    )


@router.get(
    "/snapshots/{which}",
    operation_id="getSnapshot",
    summary="Look at a kept state, or download it by Accept",
    response_model=SnapshotOut,
    responses={
        HTTPStatus.OK: {
            "content": doc.contents(*(f for f in FORMATS_OUT if f != "off")),
            "headers": doc.FILE,
        },
        HTTPStatus.PARTIAL_CONTENT: {
            "description": "The range of the mesh that was asked for.",
            "content": doc.contents(*(f for f in FORMATS_OUT if f != "off")),
        },
        HTTPStatus.NOT_MODIFIED: {
            "description": "The client has it already (`If-None-Match`).",
            "headers": doc.ETAG,
        },
        **doc.problems(
            "not-found",
            "result-not-ready",
            "gone",
            "not-acceptable",
            "range-not-satisfiable",
            "invalid-parameters",
            *doc.FILES,
            *doc.STORES,
        ),
    },
)
async def get_snapshot(
    *,
    request: Request,
    context: Context,
    job_id: JobId,
    which: Which,
    precision: Precision = "double",
    ascii: Ascii = False,  # noqa: A002 (its name in the address)
    color: Color = None,
) -> Response:
    """Return the figures of a state as JSON, or the mesh if `Accept` names the media type of one."""
    form = negotiate(request.headers.get("accept"))
    job = await to_thread.run_sync(context.stores.jobs.get, job_id)
    found = find(job, which)
    if form is None:
        answer = json_answer(request, snapshot_out(job_id, found[0]), cache_control=found[1])
    else:
        answer = await converted_snapshot(request, context, job, found, Form(form, precision, ascii, color))
    answer.headers["Vary"] = VARY
    return answer


@router.get(
    "/metrics",
    operation_id="getMetrics",
    summary="The time series of a job",
    tags=["Metrics"],
    response_model=MetricsOut,
    responses={HTTPStatus.OK: {"headers": doc.ETAG}, **doc.problems("not-found", "gone", *doc.STORES)},
)
def get_metrics(request: Request, context: Context, job_id: JobId) -> Response:
    """Return the figures of every recorded iteration so far."""
    return json_answer(request, metrics_out(job_id, context.stores.jobs.metrics(job_id)))


@router.get(
    "/metrics.csv",
    operation_id="getMetricsCsv",
    summary="The time series of a job as CSV",
    tags=["Metrics"],
    response_class=Response,
    responses={
        HTTPStatus.OK: {
            "description": "A header line, then one line an iteration; an empty field where there is no figure.",
            "content": {"text/csv": {"schema": {"type": "string"}}},
            "headers": doc.FILE,
        },
        HTTPStatus.PARTIAL_CONTENT: {
            "description": "The range that was asked for.",
            "content": {"text/csv": {"schema": {"type": "string"}}},
            "headers": doc.FILE,
        },
        HTTPStatus.NOT_MODIFIED: {"description": "The client has it already.", "headers": doc.ETAG},
        **doc.problems("not-found", "gone", "range-not-satisfiable", *doc.STORES),
    },
)
def get_metrics_csv(request: Request, context: Context, job_id: JobId) -> Response:
    """Return the same as `/metrics`, for spreadsheets and plots."""
    job = context.stores.jobs.get(job_id)
    data = archive.metrics_csv(metrics_out(job_id, context.stores.jobs.metrics(job_id)))
    content = Content(
        size=len(data),
        etag=strong_etag(data),
        media_type="text/csv",
        filename=file_name(job.spec.name, "_metrics.csv"),
        cache_control=REVALIDATE,
        open=lambda: io.BytesIO(data),
    )
    return deliver(request, content)


@router.get(
    "/archive.zip",
    operation_id="downloadArchive",
    summary="Download everything of a finished job",
    response_class=Response,
    responses={
        HTTPStatus.OK: {
            "description": "`manifest.json` (parameters, version, the SHA-256 of every file), `metrics.csv`, and every "
            "kept state.",
            "content": {archive.MEDIA_TYPE: {"schema": doc.BINARY}},
            "headers": doc.FILE,
        },
        HTTPStatus.PARTIAL_CONTENT: {
            "description": "The range that was asked for.",
            "content": {archive.MEDIA_TYPE: {"schema": doc.BINARY}},
        },
        HTTPStatus.NOT_MODIFIED: {"description": "The client has it already.", "headers": doc.ETAG},
        **doc.problems(
            "not-found",
            "gone",
            "job-not-finished",
            "range-not-satisfiable",
            "invalid-parameters",
            "storage-full",
            *doc.FILES,
            *doc.STORES,
        ),
    },
)
async def download_archive(
    request: Request,
    context: Context,
    job_id: JobId,
    format: Annotated[  # noqa: A002 (its name in the address)
        str,
        Query(
            pattern=f"^({'|'.join(FORMATS_OUT)})$",
            description="Of the states.",
            json_schema_extra={"enum": list(FORMATS_OUT)},
        ),
    ] = "ply",
) -> Response:
    """Return one zip file, built once: `curl -OJ …/archive.zip`.

    Of a job that keeps more than 256 MiB it is sent as it is written, without a length, a tag or ranges; the bytes
    would be the same.
    """
    stores = context.stores

    def read() -> tuple[Job, MeshRecord, MetricsOut]:
        job = stores.jobs.get(job_id)
        if not job.status.done:
            raise JobNotFinishedError(f"{job_id} is {job.status}: its archive is made when it is done")
        return job, stores.meshes.get(job.spec.mesh_id), metrics_out(job_id, stores.jobs.metrics(job_id))

    job, mesh, metrics = await to_thread.run_sync(read)

    sizes = [snapshot.size for snapshot in job.snapshots]
    streamed = sum(sizes) > archive.STREAMED_BYTES
    kept = (
        streamed and sum(sizes) < context.settings.cache_bytes / _KEPT_SHARE
    )  # else it is kept as a whole, or too much

    def convert(snapshot: Snapshot) -> bytes:
        parts, make = conversion(stores.blobs, State(job.spec.mesh_id, snapshot), Form(format))
        return context.cache.read(parts, make) if kept else make()

    matter = archive.Matter(job, mesh, metrics, format, convert)
    name = file_name(job.spec.name, ".zip")
    if streamed:
        check_space(stores.blobs.scratch(), max(sizes), context.settings.min_free_bytes)
        made = archive.archive_parts(stores.blobs.scratch(), matter)
        return await stream(request, made, context.conversions, archive.MEDIA_TYPE, name)

    def build(file: BinaryIO) -> None:
        check_space(context.cache.folder, sum(sizes), context.settings.min_free_bytes)
        archive.write_archive(file, matter)

    parts = ("archive", job_id, job.rev, format, __version__)
    with await context.cache.get(parts, build, context.conversions, small=False) as found:
        content = Content(
            size=found.size,
            etag=found.etag,
            media_type=archive.MEDIA_TYPE,
            filename=name,
            cache_control=IMMUTABLE,
            open=found.take,
            verify=found.verify,
        )
        return deliver(request, content)
