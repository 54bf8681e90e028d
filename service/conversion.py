"""Stored states as files to download: loaded, written in the asked format, a few at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Literal

from fastapi import Query
from starlette.requests import Request
from starlette.responses import Response

from service.arrays import State, open_original, verify_original
from service.context import Services
from service.delivery import IMMUTABLE, Content, deliver, file_name
from service.problems import invalid
from spherify import __version__
from spherify.formats import COLOURED, InvalidExportError, media_type, safe_stem, write_mesh
from spherify.formats.colours import vertex_colours
from spherify.formats.names import extension
from spherify.geometry.fields import FieldName, vertex_field
from spherify.jobs.model import Job, MeshRecord, Snapshot
from spherify.jobs.ports import BlobStore

PrecisionValue = Literal["double", "float"]
Precision = Annotated[
    PrecisionValue,
    Query(description="Of coordinates in OBJ, OFF and PLY: `double` reads back as the same float64."),
]
Ascii = Annotated[bool, Query(description="Text instead of binary, where there is a choice (PLY, STL).")]

Color = Annotated[
    FieldName | None,
    Query(
        description=f"Colour the vertices by a field ({', '.join(COLOURED)} only), with the scale and the range of the "
        "web page: 2nd to 98th percentile, for `curvature` 10th to 90th; symmetric about 0 where it lies between them "
        "for `curvature` and `distance`. The file says the range: in a comment, in GLB in `asset.extras.note`."
    ),
]


@dataclass(frozen=True, slots=True)
class Form:
    """How a mesh is to be written."""

    format: str
    precision: PrecisionValue = "double"
    ascii: bool = False
    color: FieldName | None = None

    @property
    def tail(self) -> str:
        """The end of a file's name: files of other colours are other files."""
        return f".{self.format}" if self.color is None else f"_{self.color}.{self.format}"


@dataclass(frozen=True, slots=True)
class Target:
    """What is converted, under which name, and for how long a client may keep it."""

    state: State
    filename: str
    cache_control: str


def original(request: Request, services: Services, record: MeshRecord) -> Response:
    """Answer with an uploaded file as it was."""
    blobs = services.stores.blobs
    told = extension(record.name) == record.format
    content = Content(
        size=record.size,
        etag=f'"{record.sha256}"',
        media_type=media_type(record.format),
        filename=record.name if told else file_name(record.name, f".{record.format}"),
        cache_control=IMMUTABLE,
        open=lambda: open_original(blobs, record),
        verify=lambda digest: verify_original(record, digest),
    )
    return deliver(request, content)


async def converted_mesh(request: Request, services: Services, record: MeshRecord, form: Form) -> Response:
    """Answer with an accepted mesh in a format."""
    target = Target(State(record.id), file_name(safe_stem(record.name), form.tail), IMMUTABLE)
    return await _converted(request, services, target, form)


async def converted_snapshot(
    request: Request, services: Services, job: Job, found: tuple[Snapshot, str], form: Form
) -> Response:
    """Answer with what `service.snapshots.find` found, in a format."""
    snapshot, cache_control = found
    name = file_name(job.spec.name, f"_it{snapshot.iteration:05d}{form.tail}")
    return await _converted(
        request, services, Target(State(job.spec.mesh_id, snapshot), name, cache_control), form
    )


def conversion(blobs: BlobStore, state: State, form: Form) -> tuple[object, Callable[[], bytes]]:
    """Return what determines the bytes of a state in a form, and what makes them."""

    def make() -> bytes:
        start, now = state.load(blobs)
        colours = (
            vertex_colours(form.color, vertex_field(form.color, start, now.vertices)) if form.color else None
        )
        try:
            return write_mesh(now, form.format, precision=form.precision, ascii=form.ascii, colours=colours)
        except InvalidExportError as e:
            raise invalid("query/ascii", "no-text-form", str(e)) from e

    return ("mesh", state.source, form, __version__), make


async def _converted(request: Request, services: Services, target: Target, form: Form) -> Response:
    """Convert, once: the file is kept under what determines its bytes, and its tag is made of the bytes."""
    if form.color is not None and form.format not in COLOURED:
        raise invalid(
            "query/color", "no-colours", f"{form.format} holds no colours; {', '.join(COLOURED)} do"
        )
    parts, make = conversion(services.stores.blobs, target.state, form)
    with await services.cache.get(parts, lambda file: file.write(make()), services.conversions) as file:
        content = Content(
            size=file.size,
            etag=file.etag,
            media_type=media_type(form.format),
            filename=target.filename,
            cache_control=target.cache_control,
            open=file.take,
            verify=file.verify,
        )
        return deliver(request, content)
