"""/v1/jobs."""

from __future__ import annotations

import logging
from datetime import UTC, datetime
from http import HTTPStatus
from typing import Annotated

from anyio import to_thread
from fastapi import APIRouter, Query, Request, Response

from service import documentation as doc
from service.conditions import heed, is_conditional, matches
from service.context import Context, Services
from service.delivery import json_answer
from service.forms import FORM, media_type, multipart
from service.identifiers import JobId
from service.job_answers import job_answer, job_etag
from service.paging import DEFAULT_LIMIT, Cursor, Limit, link_header, links
from service.problems import ProblemError, invalid
from service.queries import KNOWN_QUERY
from service.rehearsal import DryRunOut, rehearsed
from service.repeats import IDEMPOTENT, Identity, once
from service.requests import TAG, JobPlan, JobRequest, parse_allow, parse_form, parse_json, plan, plan_form
from service.samples import take_in_state
from service.schemas import JobOut, PageOut, job_out
from service.uploads import DIGEST, small_body
from service.waiting import PREFER, Wait, after_waiting, awaited
from spherify.jobs.cancel import cancel
from spherify.jobs.delete import delete_job
from spherify.jobs.errors import MeshNotFoundError, StoreUnavailableError
from spherify.jobs.model import Job, JobSpec, JobStatus, MeshRecord
from spherify.jobs.ports import CancelOutcome
from spherify.jobs.submit import submit

router = APIRouter(prefix="/v1/jobs", tags=["Jobs"], dependencies=[KNOWN_QUERY])
log = logging.getLogger(__name__)
MAX_JSON_BYTES = 1024 * 1024
DryRun = Annotated[bool, Query(description="Check everything, and make no job.")]
NO_MESH = "mesh_of_this_form"  # stands in for the id until the file has been read


def _submit(services: Services, spec: JobSpec) -> Job:
    stores = services.stores
    job = submit(stores.jobs, stores.blobs, stores.queue, spec)
    log.info("submitted", extra={"action": "submit", "job_id": job.id, "mesh_id": spec.mesh_id})
    return job


async def _known_mesh(services: Services, asked: JobRequest, pointer: str) -> MeshRecord:
    """Return the mesh that a request names, or that is the state it names."""
    if asked.from_snapshot is not None:
        return await take_in_state(services, asked.from_snapshot)
    try:
        return await to_thread.run_sync(services.stores.meshes.get, asked.mesh_id or "")
    except MeshNotFoundError as e:
        raise invalid(pointer, "unknown", str(e)) from e


def _submit_known(services: Services, spec: JobSpec, pointer: str) -> Job:
    try:
        return _submit(services, spec)
    except MeshNotFoundError as e:  # deleted meanwhile
        raise invalid(pointer, "unknown", str(e)) from e


@router.post(
    "",
    operation_id="createJob",
    dependencies=[IDEMPOTENT, PREFER, DIGEST],
    summary="Morph a mesh",
    status_code=HTTPStatus.CREATED,
    response_model=JobOut,
    responses={
        HTTPStatus.OK: {"description": "Of a dry run: it would be accepted.", "model": DryRunOut},
        HTTPStatus.CREATED: {"headers": doc.LOCATION | doc.RETRY_AFTER},
        **doc.problems(
            "not-found",
            "result-not-ready",
            "gone",
            "malformed-multipart",
            "malformed-json",
            "unsupported-media-type",
            "invalid-parameters",
            *doc.REPEATS,
            *doc.UPLOAD,
            *doc.STORES,
        ),
    },
    response_description="The job is recorded: it will be done, whatever happens to this service meanwhile.",
    openapi_extra=doc.job_form(),
)
async def create_job(request: Request, context: Context, dry_run: DryRun = False) -> Response:
    """Upload a mesh and have it morphed in one go, or name a mesh that is known already.

    As a form: `curl -F file=@bunny.obj -F iterations=1000 -F snapshots=10,50,100 …/v1/jobs`; every parameter can
    be a field of its own (`-F step=0.02`), or all in `parameters` as JSON. As JSON: the same names, with `mesh_id`.
    The answer is the whole job; follow `links.self` until `done`. With `dry_run=true` everything is checked and
    nothing is queued: the answer, 200, says what the job would be and what it would take.
    """
    kind = media_type(request)
    if kind == "application/json":
        text = await small_body(request, MAX_JSON_BYTES, context.settings.upload_timeout_s)
        asked = parse_json(text)
        planned = plan(asked, context.settings)
        answer = await _on_known_mesh(request, context, planned, asked, "#/mesh_id", dry_run=dry_run)
    elif kind == FORM:
        answer = await _from_form(request, context, dry_run=dry_run)
    else:
        raise ProblemError(
            "unsupported-media-type", f"send multipart/form-data or application/json, not {kind!r}"
        )
    return answer if dry_run else await after_waiting(request, context, answer)


async def _on_known_mesh(
    request: Request,
    services: Services,
    planned: JobPlan,
    asked: JobRequest,
    pointer: str,
    *,
    dry_run: bool,
) -> Response:
    if dry_run:
        return json_answer(request, rehearsed(planned, await _known_mesh(services, asked, pointer)))

    async def act(identity: Identity) -> Response:
        spec = planned.spec(await _known_mesh(services, asked, pointer), identity)
        job = await to_thread.run_sync(_submit_known, services, spec, pointer)
        return job_answer(request, job, HTTPStatus.CREATED)

    content = [asked.mesh_id or asked.from_snapshot, planned.as_dict()]
    return await once(request, services.stores.repeats, content, act, jobs=services.stores.jobs)


async def _from_form(request: Request, services: Services, *, dry_run: bool) -> Response:
    async with multipart(request, services.stores.blobs, services.settings) as form:
        file = form.file
        asked = parse_form(form.fields, None if file is None else NO_MESH)
        planned = plan_form(asked, form.fields, services.settings)
        if file is None:
            return await _on_known_mesh(request, services, planned, asked, "form/mesh_id", dry_run=dry_run)
        allow = parse_allow(form.fields.get("allow", ()), "form/allow")
        if dry_run:
            mesh, _ = await services.intake.accept(file, allow)
            return json_answer(request, rehearsed(planned, mesh, file.name))

        async def act(identity: Identity) -> Response:
            mesh, _ = await services.intake.accept(file, allow)
            spec = planned.spec(mesh, identity, file.name)
            try:
                job = await to_thread.run_sync(_submit, services, spec)
            except MeshNotFoundError as e:
                raise StoreUnavailableError("this mesh was deleted at the same moment: send it again") from e
            return job_answer(request, job, HTTPStatus.CREATED)

        content = [file.sha256, file.name, sorted(allow), planned.as_dict()]
        return await once(request, services.stores.repeats, content, act, jobs=services.stores.jobs)


@router.get(
    "",
    operation_id="listJobs",
    summary="List jobs, newest first",
    response_model=PageOut[JobOut],
    responses={HTTPStatus.OK: {"headers": doc.LINK}, **doc.problems("invalid-parameters", *doc.STORES)},
)
def list_jobs(
    *,
    request: Request,
    context: Context,
    status: Annotated[JobStatus | None, Query(description="Only jobs in this state.")] = None,
    tag: Annotated[str | None, Query(pattern=TAG, description="Only jobs with this tag.")] = None,
    mesh_id: Annotated[
        str | None, Query(min_length=1, max_length=64, description="Only jobs on this mesh.")
    ] = None,
    created_after: Annotated[
        datetime | None,
        Query(description="Only jobs made after this time (RFC 3339; UTC unless it says otherwise)."),
    ] = None,
    limit: Limit = DEFAULT_LIMIT,
    cursor: Cursor = None,
) -> Response:
    """Return a slice of the jobs that fit all filters; follow `Link: <…>; rel="next"` or `next_cursor` for more."""
    page = context.stores.jobs.find(
        status=status,
        tag=tag,
        mesh_id=mesh_id,
        created_after=_seconds(created_after),
        limit=limit,
        cursor=cursor,
    )
    found = links(request, page.next_cursor)
    items = [job_out(job) for job in page.items]
    answer = PageOut[JobOut](items=items, next_cursor=page.next_cursor, links=found)
    return json_answer(request, answer, headers=link_header(found))


@router.get(
    "/{job_id}",
    operation_id="getJob",
    summary="Look at a job",
    response_model=JobOut,
    responses={
        HTTPStatus.OK: {"headers": doc.ETAG | doc.RETRY_AFTER},
        HTTPStatus.NOT_MODIFIED: {
            "description": "Nothing has changed (`If-None-Match`).",
            "headers": doc.ETAG,
        },
        **doc.problems("not-found", "gone", "invalid-parameters", *doc.STORES),
    },
)
async def get_job(request: Request, context: Context, job_id: JobId, wait: Wait = 0) -> Response:
    """Return the job as it is now. Ask again after `Retry-After` seconds, with the ETag as `If-None-Match`.

    With `wait` the answer comes as soon as the job is done; with `If-None-Match` too, as soon as it has changed.
    """
    job = await context.reader.get(job_id)
    if wait > 0:
        known = request.headers.get("if-none-match") is not None
        job = await awaited(
            context.watch,
            job,
            wait,
            lambda seen: not matches(request, job_etag(seen)) if known else seen.status.done,
        )
    return job_answer(request, job, document=context.documents.document)


@router.post(
    "/{job_id}/cancel",
    operation_id="cancelJob",
    summary="Cancel a job",
    response_model=JobOut,
    responses={
        HTTPStatus.OK: {"description": "The job was waiting, or was cancelled before: it is cancelled."},
        HTTPStatus.ACCEPTED: {
            "description": "A worker has been told; the job ends within seconds.",
            "model": JobOut,
            "headers": doc.RETRY_AFTER,
        },
        **doc.problems("not-found", "gone", "job-already-finished", "storage-full", *doc.STORES),
    },
)
def cancel_job(request: Request, context: Context, job_id: JobId) -> Response:
    """Ask for the end of a job. The snapshots kept so far stay."""
    outcome = cancel(context.stores.jobs, context.stores.blobs, job_id)
    job = context.stores.jobs.get(job_id)  # also tells an unknown job from a deleted one
    log.info("cancel asked: %s", outcome, extra={"action": "cancel", "job_id": job_id})
    if outcome is CancelOutcome.FINISHED:
        raise ProblemError(
            "job-already-finished",
            f"{job_id} ended as {job.status} before it could be cancelled"
            if job.status.done
            else f"{job_id} is just ending: it is too late to cancel it",
        )
    return job_answer(
        request, job, HTTPStatus.ACCEPTED if outcome is CancelOutcome.CANCELLING else HTTPStatus.OK
    )


@router.delete(
    "/{job_id}",
    operation_id="deleteJob",
    summary="Delete a finished job",
    status_code=HTTPStatus.NO_CONTENT,
    responses=doc.problems("not-found", "gone", "job-not-finished", "precondition-failed", *doc.STORES),
)
def remove_job(request: Request, context: Context, job_id: JobId) -> Response:
    """Delete a finished job, its snapshots and figures; its address answers 410 from then on."""
    if is_conditional(request) and (job := context.stores.jobs.get(job_id)).status.done:
        heed(request, job_etag(job))  # which stays: what has ended does not change any more
    delete_job(context.stores.jobs, context.stores.blobs, job_id)
    log.info("deleted", extra={"action": "delete", "job_id": job_id})
    return Response(status_code=HTTPStatus.NO_CONTENT)


def _seconds(time: datetime | None) -> float | None:
    if time is None:
        return None
    seconds = (time if time.tzinfo is not None else time.replace(tzinfo=UTC)).timestamp()
    return max(seconds, 0.0)  # identifiers hold times, and none before the epoch
