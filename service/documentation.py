"""How problems and contents are described in the OpenAPI document."""

from __future__ import annotations

from typing import Any, Final

from service.problem_types import PROBLEMS
from service.problems import MEDIA_TYPE, ProblemError
from service.requests import JobRequest
from spherify.formats import ALLOW, FORMATS_IN, FORMATS_OUT, media_type
from spherify.formats.codes import PROBLEM_CODES
from spherify.parameters import parameters_schema

Responses = dict[int | str, dict[str, Any]]
EVERYWHERE: Final = ("internal-error",)
STORES: Final = ("not-ready",)
FILES: Final = ("stored-file-damaged",)
REPEATS: Final = ("idempotency-in-progress", "idempotency-key-reused")
UPLOAD: Final = (
    "digest-mismatch",
    "request-timeout",
    "upload-too-large",
    *PROBLEM_CODES,
    "rate-limited",
    "storage-full",
)
BINARY: Final = {"type": "string", "format": "binary"}
_INSTANCE: Final = "/v1/…"


def header(description: str) -> dict[str, Any]:
    """Describe a header of an answer."""
    return {"description": description, "schema": {"type": "string"}}


ETAG: Final = {"ETag": header("Send it as `If-None-Match`; 304 means nothing has changed.")}
LOCATION: Final = {"Location": header("Path of what was made.")}
RETRY_AFTER: Final = {
    "Retry-After": header("Seconds to wait before asking again; while the job is not done.")
}
LINK: Final = {"Link": header('`<…>; rel="next"` while there are more.')}
FILE: Final = ETAG | {
    "Content-Disposition": header("A telling file name, such as `bunny_it05000.ply`."),
    "Accept-Ranges": header("`bytes`: a part can be asked for with `Range`."),
    "Cache-Control": header("`immutable` where these bytes can never change."),
}


def problems(*slugs: str) -> Responses:
    """Return the entries of `responses` for these problem types, grouped by status, with an example each."""
    grouped: Responses = {}
    for problem in (PROBLEMS[slug] for slug in (*slugs, *EVERYWHERE)):
        entry = grouped.setdefault(
            problem.status,
            {
                "description": "",
                "content": {
                    MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/ProblemOut"}, "examples": {}}
                },
            },
        )
        entry["description"] += ("; " if entry["description"] else "") + f"`{problem.slug}`: {problem.title}"
        if problem.retry_after_s is not None:
            entry["headers"] = {"Retry-After": header("Seconds to wait before trying again.")}
        example = ProblemError(problem.slug, problem.cure).document(
            _INSTANCE, "req_01K5Z9Q8M4T6V2X0Y7R3N1W5BC"
        )
        entry["content"][MEDIA_TYPE]["examples"][problem.slug] = {"summary": problem.title, "value": example}
    return grouped


def contents(*formats: str, also: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return the `content` of an answer that is a mesh in one of these formats."""
    kinds = dict.fromkeys([*(media_type(form) for form in formats), *also])
    return {kind: {"schema": BINARY} for kind in kinds}


def mesh_answer(description: str, *, also: tuple[str, ...] = (), inputs: bool = False) -> Responses:
    """Return the entries 200, 206 and 304 of an answer that is a mesh."""
    content = contents(*(FORMATS_IN if inputs else FORMATS_OUT), also=also)
    return {
        200: {"description": description, "content": content, "headers": FILE},
        206: {"description": "The range that was asked for.", "content": content, "headers": FILE},
        304: {"description": "The client has it already (`If-None-Match`).", "headers": ETAG},
    }


def array_answer(description: str) -> Responses:
    """Return the entries 200, 206 and 304 of an answer that is a bare array."""
    content = {"application/octet-stream": {"schema": BINARY}}
    headers = ETAG | {
        "Cache-Control": FILE["Cache-Control"],
        "Content-Encoding": header(
            "`gzip` where `Accept-Encoding` allows it; each coding has an ETag of its own."
        ),
        "Vary": header("`Accept-Encoding`."),
    }
    return {
        200: {"description": description, "content": content, "headers": headers},
        206: {"description": "The range that was asked for, of the coded bytes.", "content": content},
        304: {"description": "The client has it already (`If-None-Match`).", "headers": ETAG},
    }


def _words(description: str, values: tuple[str, ...] = ()) -> dict[str, Any]:
    item: dict[str, Any] = {"type": "string"} | ({"enum": list(values)} if values else {})
    return {"type": "array", "items": item, "description": description}


ALLOW_SCHEMA: Final = _words(
    "Lets unusual meshes in, repeated or separated by commas: `genus` (handles), `boundary` (holes), `components` "
    "(the largest part is taken), `nonmanifold-vertex`.",
    ALLOW,
)
FILE_SCHEMA: Final = BINARY | {
    "description": f"The mesh: {', '.join(form.upper() for form in FORMATS_IN)}; its name ends accordingly."
}


def form_body(schema: dict[str, Any], *, more: dict[str, Any] | None = None) -> dict[str, Any]:
    """Return `openapi_extra` for a body that a route reads itself."""
    content = {"multipart/form-data": {"schema": schema}, **(more or {})}
    return {"requestBody": {"required": True, "content": content}}


MESH_FORM: Final = form_body(
    {
        "type": "object",
        "required": ["file"],
        "properties": {"file": FILE_SCHEMA, "allow": ALLOW_SCHEMA},
        "additionalProperties": False,
    }
)
MESH_RAW: Final = {
    "requestBody": {"required": True, "content": {"application/octet-stream": {"schema": BINARY}}}
}


def job_form() -> dict[str, Any]:
    """Return `openapi_extra` of `POST /v1/jobs`: a form with a file, or JSON with the id of a mesh."""
    fields = JobRequest.model_json_schema(ref_template="#/components/schemas/{model}")["properties"]
    parameters = parameters_schema("#/components/schemas/{model}")["properties"]
    own = {name: schema for name, schema in parameters.items() if name != "iterations"}
    text = {"type": "string", "contentMediaType": "application/json"}
    schema = {
        "type": "object",
        "properties": {
            "file": FILE_SCHEMA,
            **fields,
            "parameters": text
            | {"description": 'What differs from the preset, as a JSON object: `{"step": 0.02}`.'},
            "tags": _words(
                "Words to find the job by, repeated or separated by commas. `up:z` has the page show it with z upward."
            ),
            "allow": ALLOW_SCHEMA,
            **own,
        },
        "oneOf": [{"required": [name]} for name in ("file", "mesh_id", "from_snapshot")],
        "additionalProperties": False,
    }
    return form_body(
        schema, more={"application/json": {"schema": {"$ref": "#/components/schemas/JobRequest"}}}
    )
