"""Every problem the service answers with (RFC 9457): one table, and what turns an error into an entry of it.

The only file that knows HTTP error numbers. `PROBLEMS` is the table; a route raises `ProblemError`, or lets an
error of the domain through, which `problem_of` translates.
"""

from __future__ import annotations

import errno
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

from pydantic import ValidationError

from spherify.formats import MeshRefusedError
from spherify.geometry.errors import InvalidConfigError
from spherify.jobs.errors import (
    BlobNotFoundError,
    InvalidCursorError,
    JobGoneError,
    JobNotFinishedError,
    JobNotFoundError,
    MeshInUseError,
    MeshNotFoundError,
    StorageFullError,
    StoreUnavailableError,
)

MEDIA_TYPE: Final = "application/problem+json"
MAX_ERRORS: Final = 100  # listed: a wrong request of a megabyte need not get an answer of ten


@dataclass(frozen=True, slots=True)
class ProblemType:
    """One kind of problem: its name in URLs, the status it is answered with, and what to do about it."""

    slug: str
    status: int
    title: str
    cure: str
    retry_after_s: int | None = None

    @property
    def uri(self) -> str:
        """The problem's `type`: where it is documented, relative to the service."""
        return f"/problems/{self.slug}"


PROBLEMS: Final[dict[str, ProblemType]] = {
    problem.slug: problem
    for problem in (
        ProblemType(
            "malformed-multipart",
            400,
            "The form cannot be read",
            "The body is not what its Content-Type announces: no boundary, a part without a name, or a form that ends "
            "early. Let the HTTP client build the form and its Content-Type (curl: `-F`).",
        ),
        ProblemType(
            "malformed-json",
            400,
            "The JSON cannot be read",
            "The body is not JSON as RFC 8259 has it. `detail` names the place.",
        ),
        ProblemType(
            "malformed-request",
            400,
            "The request cannot be understood",
            "The request breaks a rule of HTTP, or comes from a web origin that is not on the service's list "
            "(`SPHERIFY_CORS_ORIGINS`).",
        ),
        ProblemType(
            "not-found",
            404,
            "There is nothing here",
            "The address is wrong, or the job, mesh or snapshot was never there. `detail` says which.",
        ),
        ProblemType(
            "result-not-ready",
            404,
            "Not computed yet",
            "This snapshot was asked for and the job has not reached it. Try again after `Retry-After` seconds.",
            1,
        ),
        ProblemType(
            "method-not-allowed",
            405,
            "This address does not know the method",
            "Use one of the methods in the `Allow` header.",
        ),
        ProblemType(
            "not-acceptable",
            406,
            "No such representation",
            "None of the media types in `Accept` can be produced here. Name a form by its suffix instead "
            "(`/snapshots/latest.ply`).",
        ),
        ProblemType(
            "request-timeout",
            408,
            "The upload stalled",
            "Nothing, or next to nothing, arrived for longer than the service waits. Send it again; nothing was kept.",
        ),
        ProblemType(
            "job-already-finished",
            409,
            "The job is finished",
            "A finished job cannot be cancelled. Its snapshots stay until it is deleted.",
        ),
        ProblemType(
            "job-not-finished",
            409,
            "The job is not finished",
            "Only finished jobs can be deleted: cancel it, wait until `done` is true, then delete it.",
        ),
        ProblemType(
            "mesh-in-use",
            409,
            "Jobs use this mesh",
            "Delete the jobs that name the mesh first, then the mesh.",
        ),
        ProblemType("gone", 410, "It was deleted", "The job existed and was deleted; it does not come back."),
        ProblemType(
            "upload-too-large",
            413,
            "The body is too large",
            "`/v1/info` names the limit (`limits.max_upload_bytes`). Binary PLY is the smallest of the formats.",
        ),
        ProblemType(
            "mesh-too-large",
            413,
            "The mesh is too large",
            "It has, or claims, more vertices or triangles than `/v1/info` allows, or reading it took too much. "
            "Decimate it.",
        ),
        ProblemType(
            "unsupported-media-type",
            415,
            "The body is of the wrong kind",
            "Send `multipart/form-data` or `application/json`, as the description of the operation says.",
        ),
        ProblemType(
            "unsupported-mesh-format",
            415,
            "Not a mesh format that is read",
            "OBJ, PLY, STL, OFF, GLB and 3MF are read. The content decides, and the name must agree with it.",
        ),
        ProblemType(
            "range-not-satisfiable",
            416,
            "Outside the content",
            "The range starts behind the end; `Content-Range` names the length.",
        ),
        ProblemType(
            "invalid-parameters",
            422,
            "A value is not allowed",
            "`errors` lists every value that is missing, unknown, of the wrong type or out of bounds, each with a "
            "pointer: `#/parameters/step` within a body, `query/limit` for a query parameter, `form/preset` for a "
            "form field. `/v1/parameters` is the schema.",
        ),
        ProblemType(
            "mesh-not-parsable",
            422,
            "The mesh cannot be read",
            "The file is damaged, empty, or has numbers or indices that cannot be. `detail` names the first place.",
        ),
        ProblemType(
            "mesh-not-closed",
            422,
            "The mesh has holes",
            "Every edge must lie in exactly two triangles. Fill the holes, or send `allow=boundary`: edges on the "
            "boundary then do not count in the curvature.",
        ),
        ProblemType(
            "mesh-not-manifold",
            422,
            "The mesh is not a surface",
            "An edge lies in more than two triangles, or a vertex joins two sheets. Separate them; a vertex alone may "
            "pass with `allow=nonmanifold-vertex`.",
        ),
        ProblemType(
            "mesh-not-oriented",
            422,
            "The triangles disagree about the outside",
            "Neighbouring triangles run the same way along their edge. Recalculate the normals in a mesh editor.",
        ),
        ProblemType(
            "mesh-not-connected",
            422,
            "The mesh has several parts",
            "A sphere is one piece. Unite the parts, or send `allow=components`: the largest part is then morphed.",
        ),
        ProblemType(
            "mesh-genus",
            422,
            "The mesh has handles",
            "A surface with a handle cannot become a sphere. Close the handles, or send `allow=genus` to see what "
            "happens.",
        ),
        ProblemType(
            "rate-limited",
            429,
            "Too many uploads at once",
            "The service reads a few meshes at a time and has enough waiting. Try again after `Retry-After` seconds.",
            5,
        ),
        ProblemType(
            "internal-error",
            500,
            "The service failed",
            "This is a fault of ours. Please report it with the `request_id`.",
        ),
        ProblemType(
            "not-ready",
            503,
            "The service is not ready",
            "A part the service needs does not answer; `/readyz` says which. Try again after `Retry-After` seconds. "
            "A job may have been recorded all the same: look before sending it again.",
            2,
        ),
        ProblemType(
            "storage-full",
            507,
            "There is no space left",
            "The service's disk is full. Nothing was kept. Delete finished jobs, or tell its operator.",
            60,
        ),
    )
}


@dataclass(frozen=True, slots=True)
class FieldError:
    """One wrong value: where it is, a short code, and a sentence."""

    pointer: str
    code: str
    detail: str


@dataclass(eq=False)
class ProblemError(Exception):
    """An answer of one of the types in `PROBLEMS`, to be raised anywhere within a request.

    Attributes:
        slug: which.
        detail: what happened here, and how to mend it.
        errors: each wrong value, JSON-ready.
        headers: added to the answer.
        extensions: further members of the document.

    """

    slug: str
    detail: str
    errors: Sequence[Mapping[str, Any]] = ()
    headers: Mapping[str, str] = field(default_factory=dict)
    extensions: Mapping[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        return self.detail

    @property
    def type(self) -> ProblemType:
        """The entry of `PROBLEMS`."""
        return PROBLEMS[self.slug]

    @property
    def all_headers(self) -> dict[str, str]:
        """The headers of the answer: `Retry-After` where the type has one, then the error's own."""
        retry = self.type.retry_after_s
        return ({"Retry-After": str(retry)} if retry is not None else {}) | dict(self.headers)

    def document(self, instance: str, request_id: str) -> dict[str, Any]:
        """Return the problem document."""
        return {
            "type": self.type.uri,
            "title": self.type.title,
            "status": self.type.status,
            "detail": self.detail,
            "instance": instance,
            "request_id": request_id,
            "errors": [dict(error) for error in self.errors],
            **self.extensions,
        }


def invalid(pointer: str, code: str, detail: str) -> ProblemError:
    """Return `invalid-parameters` for one value."""
    error = {"pointer": pointer, "code": code, "detail": detail}
    return ProblemError("invalid-parameters", f"{pointer}: {detail}", (error,))


def invalid_many(errors: Sequence[FieldError]) -> ProblemError:
    """Return `invalid-parameters` for several values, the first of them listed."""
    first = f"{errors[0].pointer}: {errors[0].detail}"
    more = f" ({len(errors) - 1} more in `errors`)" if len(errors) > 1 else ""
    listed = tuple({"pointer": e.pointer, "code": e.code, "detail": e.detail} for e in errors[:MAX_ERRORS])
    return ProblemError("invalid-parameters", first + more, listed)


def invalid_model(error: ValidationError, prefix: str = "#") -> ProblemError:
    """Return `invalid-parameters` for a model that pydantic refused, or `malformed-json`."""
    found = error.errors(include_url=False, include_input=False, include_context=False)
    if found[0]["type"] == "json_invalid":
        return ProblemError("malformed-json", found[0]["msg"])
    return invalid_many(
        [
            FieldError(
                "/".join((prefix, *map(_token, e["loc"]))), e["type"], _PLAINER.get(e["type"], e["msg"])
            )
            for e in found
        ]
    )


_PLAINER: Final = {"extra_forbidden": "unknown; /docs and /v1/parameters list the names"}


def _token(part: str | int) -> str:
    return str(part)[:80].replace("~", "~0").replace("/", "~1")  # RFC 6901


_DOMAIN: Final[tuple[tuple[type[Exception], str], ...]] = (
    (JobGoneError, "gone"),
    (JobNotFoundError, "not-found"),
    (MeshNotFoundError, "not-found"),
    (BlobNotFoundError, "not-found"),
    (JobNotFinishedError, "job-not-finished"),
    (MeshInUseError, "mesh-in-use"),
    (StoreUnavailableError, "not-ready"),
    (StorageFullError, "storage-full"),
)
_STATUS: Final = {
    400: "malformed-request",
    404: "not-found",
    405: "method-not-allowed",
    406: "not-acceptable",
    413: "upload-too-large",
    415: "unsupported-media-type",
    416: "range-not-satisfiable",
    422: "invalid-parameters",
    429: "rate-limited",
    503: "not-ready",
}


def problem_of(error: Exception) -> ProblemError | None:
    """Translate an error of the domain; None for what is a fault of ours."""
    found: ProblemError | None = None
    if isinstance(error, ProblemError):
        found = error
    elif isinstance(error, MeshRefusedError):
        found = _refused(error)
    elif isinstance(error, InvalidConfigError):
        found = invalid("#/parameters", "contradiction", str(error))
    elif isinstance(error, InvalidCursorError):
        found = invalid("query/cursor", "cursor", str(error))
    elif isinstance(error, OSError) and error.errno in {errno.ENOSPC, errno.EDQUOT}:
        found = ProblemError("storage-full", "the service's disk is full")
    else:
        for kind, slug in _DOMAIN:
            if isinstance(error, kind):
                return ProblemError(slug, str(error))
    return found


def problem_of_status(status: int, detail: str, headers: Mapping[str, str]) -> ProblemError:
    """Translate an error that the framework raised by its number."""
    return replace(ProblemError(_STATUS.get(status, "internal-error"), detail), headers=dict(headers))


def _refused(error: MeshRefusedError) -> ProblemError:
    errors = tuple(
        {
            "pointer": defect.pointer or "form/file",
            "code": defect.code,
            "detail": defect.detail,
            "locations": [
                {"kind": place.kind, "indices": place.indices, "positions": place.positions}
                for place in defect.locations
            ],
        }
        for defect in error.errors
    )
    report = error.report.as_dict() if error.report else None
    return ProblemError(error.code, str(error), errors, extensions={"report": report})
