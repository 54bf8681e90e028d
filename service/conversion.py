"""Stored states as files to download: loaded, written in the asked format, a few at a time."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Literal

from anyio import to_thread
from fastapi import Query
from starlette.requests import Request
from starlette.responses import Response

from service.context import Services
from service.delivery import IMMUTABLE, Content, deliver, file_name, matches, not_modified, strong_etag
from service.problems import invalid
from spherify import __version__
from spherify.formats import InvalidExportError, media_type, safe_stem, write_mesh
from spherify.formats.names import extension
from spherify.geometry.mesh import TriangleMesh
from spherify.jobs import layout
from spherify.jobs.model import Job, MeshRecord, Snapshot
from spherify.jobs.ports import BlobStore
from spherify.stores.arrays import load_arrays

PrecisionValue = Literal["double", "float"]
Precision = Annotated[
    PrecisionValue,
    Query(description="Of coordinates in OBJ, OFF and PLY: `double` reads back as the same float64."),
]
Ascii = Annotated[bool, Query(description="Text instead of binary, where there is a choice (PLY, STL).")]


@dataclass(frozen=True, slots=True)
class Form:
    """How a mesh is to be written."""

    format: str
    precision: PrecisionValue = "double"
    ascii: bool = False


@dataclass(frozen=True, slots=True)
class Target:
    """What is converted (a name of its content), and under which name and for how long a client may keep it."""

    source: str
    filename: str
    cache_control: str


def original(request: Request, services: Services, record: MeshRecord) -> Response:
    """Answer with an uploaded file as it was."""
    blobs, key = services.stores.blobs, layout.mesh_original(record.id, record.format)
    told = extension(record.name) == record.format
    content = Content(
        size=record.size,
        etag=f'"{record.sha256}"',
        media_type=media_type(record.format),
        filename=record.name if told else file_name(record.name, f".{record.format}"),
        cache_control=IMMUTABLE,
        open=lambda: blobs.open(key),
    )
    return deliver(request, content)


async def converted_mesh(request: Request, services: Services, record: MeshRecord, form: Form) -> Response:
    """Answer with an accepted mesh in a format."""
    blobs = services.stores.blobs
    target = Target(record.id, file_name(safe_stem(record.name), f".{form.format}"), IMMUTABLE)
    return await _converted(request, services, target, form, lambda: load_mesh(blobs, record.id))


async def converted_snapshot(
    request: Request, services: Services, job: Job, found: tuple[Snapshot, str], form: Form
) -> Response:
    """Answer with what `service.snapshots.find` found, in a format."""
    snapshot, cache_control = found
    blobs = services.stores.blobs

    def load() -> TriangleMesh:
        vertices = load_arrays(blobs.read(snapshot.key))["vertices"]
        return load_mesh(blobs, job.spec.mesh_id).with_vertices(vertices)

    name = file_name(job.spec.name, f"_it{snapshot.iteration:05d}.{form.format}")
    return await _converted(request, services, Target(snapshot.sha256, name, cache_control), form, load)


def load_mesh(blobs: BlobStore, mesh_id: str) -> TriangleMesh:
    """Return an accepted mesh."""
    arrays = load_arrays(blobs.read(layout.mesh_arrays(mesh_id)))
    return TriangleMesh.checked(arrays["vertices"], arrays["faces"])


async def _converted(
    request: Request, services: Services, target: Target, form: Form, load: Callable[[], TriangleMesh]
) -> Response:
    """Convert unless the client has it: the tag is made of what determines the bytes, not of the bytes."""
    etag = strong_etag(target.source, form, __version__)
    if matches(request, etag):
        return not_modified(etag, target.cache_control)

    def write() -> bytes:
        try:
            return write_mesh(load(), form.format, precision=form.precision, ascii=form.ascii)
        except InvalidExportError as e:
            raise invalid("query/ascii", "no-text-form", str(e)) from e

    data = await to_thread.run_sync(write, limiter=services.conversions)
    content = Content(
        size=len(data),
        etag=etag,
        media_type=media_type(form.format),
        filename=target.filename,
        cache_control=target.cache_control,
        open=lambda: io.BytesIO(data),
    )
    return deliver(request, content)
