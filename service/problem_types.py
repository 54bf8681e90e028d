"""The table of problems (RFC 9457): each kind with its status, and what to do about it.

With `service.problems`, which tells which error is of which kind, the only file that knows HTTP error numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class ProblemType:
    """One kind of problem: its name in URLs, the status it is answered with, and what to do about it."""

    slug: str
    status: int
    title: str
    cure: str
    retry_after_s: int | None = None

    @property
    def is_refusal(self) -> bool:
        """Whether the request was at fault, and had no effect."""
        return self.status < 500

    @property
    def is_failure(self) -> bool:
        """Whether the service is at fault, so that its operator has to look."""
        return self.status == 500

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
            "digest-mismatch",
            400,
            "The body is not what was announced",
            "What arrived has another sha-256 than `Content-Digest` (RFC 9530) says: it was damaged on the way, or the "
            "digest is of something else. Send it again; nothing was kept.",
        ),
        ProblemType(
            "cross-site",
            403,
            "Sent by a page of another site",
            "A page of another origin had a browser send this. Only the service's own pages may, and those of origins "
            "on its list (`SPHERIFY_CORS_ORIGINS`); programs that are no browsers are not concerned.",
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
            "idempotency-in-progress",
            409,
            "The same request is being carried out",
            "A request with this `Idempotency-Key` has not been answered yet. Send it again after `Retry-After` "
            "seconds, with the same key: the answer will be that of the first.",
            2,
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
            "Only finished jobs can be deleted, extended or retried, and only they have an archive: cancel it or wait "
            "until `done` is true, then ask again.",
        ),
        ProblemType(
            "job-cannot-go-on",
            409,
            "Going on would lead nowhere else",
            "The job ended in a way that more iterations or another attempt would only repeat (it converged, stalled "
            "or collapsed), or it succeeded and needs no retry. Submit its mesh with other parameters.",
        ),
        ProblemType(
            "mesh-in-use",
            409,
            "Jobs use this mesh",
            "Delete the jobs that name the mesh first, then the mesh.",
        ),
        ProblemType("gone", 410, "It was deleted", "The job existed and was deleted; it does not come back."),
        ProblemType(
            "precondition-failed",
            412,
            "It is not as the request takes it to be",
            "`If-Match` names another state than there is, or `If-None-Match` the one there is. Nothing was done. Look "
            "again, and decide anew.",
        ),
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
            "address-too-long",
            414,
            "The address is too long",
            "No address of this service is nearly as long, with its query. What is long belongs in the body.",
        ),
        ProblemType(
            "unsupported-media-type",
            415,
            "The body is of the wrong kind",
            "Send `multipart/form-data` or `application/json`, as the description of the operation says, and no "
            "`Content-Encoding`: compressed bodies are not read.",
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
            "unknown-host",
            421,
            "Not a name of this service",
            "`Host` is neither `localhost`, nor an address, nor on the service's list (`SPHERIFY_ALLOWED_HOSTS`): a "
            "page might have given its own name to this address. The name of a proxy belongs on the list.",
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
            "idempotency-key-reused",
            422,
            "The key belongs to another request",
            "This `Idempotency-Key` was sent with another content within the last day. Take a new key for a new "
            "request.",
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
            "headers-too-large",
            431,
            "The headers are too large",
            "Send fewer or shorter ones. A browser sends those of all ports of this host along: delete its cookies.",
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
            "stored-file-damaged",
            500,
            "A stored file is damaged",
            "What is on the service's disk is not what was written there, or is missing; `detail` names it. Of a job: "
            "delete it, after its end, and send it again, for the same mesh and parameters give the same bytes. Of a "
            "mesh: upload it again, if it is damaged after deleting it, and before it the jobs that name it.",
        ),
        ProblemType(
            "not-ready",
            503,
            "The service is not ready",
            "A part the service needs does not answer (`/readyz` says which), or the memory for reading a mesh ran "
            "out (`detail` says so). Try again after `Retry-After` seconds. "
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
