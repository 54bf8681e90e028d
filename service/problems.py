"""Every problem the service answers with (RFC 9457): what turns an error into an entry of the table.

The table is `service.problem_types`. A route raises `ProblemError`, or lets an error of the domain through, which
`problem_of` translates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

from pydantic import ValidationError

from service.problem_types import PROBLEMS, ProblemType
from spherify.formats import MeshRefusedError
from spherify.formats.errors import ReaderKilledError
from spherify.geometry.errors import InvalidConfigError
from spherify.jobs.errors import (
    BlobNotFoundError,
    DamagedBlobError,
    InvalidCursorError,
    JobCannotGoOnError,
    JobGoneError,
    JobNotFinishedError,
    JobNotFoundError,
    KeyReusedError,
    MeshInUseError,
    MeshNotFoundError,
    RequestInProgressError,
    StorageFullError,
    StoreUnavailableError,
)
from spherify.stores.blobs import FULL

MEDIA_TYPE: Final = "application/problem+json"
MAX_ERRORS: Final = 100  # listed: a wrong request of a megabyte need not get an answer of ten
MAX_PATH: Final = 200  # characters, for the same reason


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


def clipped(path: str) -> str:
    """Return a path as it is said back or logged: its beginning, where it is longer than any of ours."""
    return path if len(path) <= MAX_PATH else path[:MAX_PATH] + "…"


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
    (BlobNotFoundError, "stored-file-damaged"),
    (JobNotFinishedError, "job-not-finished"),
    (JobCannotGoOnError, "job-cannot-go-on"),
    (MeshInUseError, "mesh-in-use"),
    (KeyReusedError, "idempotency-key-reused"),
    (RequestInProgressError, "idempotency-in-progress"),
    (StoreUnavailableError, "not-ready"),
    (ReaderKilledError, "not-ready"),
    (StorageFullError, "storage-full"),
    (DamagedBlobError, "stored-file-damaged"),
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
    elif isinstance(error, OSError) and error.errno in FULL:
        found = ProblemError("storage-full", "the service's disk is full")
    else:
        for kind, slug in _DOMAIN:
            if isinstance(error, kind):
                return ProblemError(slug, str(error) or (kind.__doc__ or ""))
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
    report = error.report.as_dict(most_locations=0) if error.report else None
    return ProblemError(error.code, str(error), errors, extensions={"report": report})
