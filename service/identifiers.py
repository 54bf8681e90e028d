"""Identifiers in URL paths: what cannot be one is answered as not found, without asking any store."""

from __future__ import annotations

from typing import Annotated, Final

from fastapi import Depends, Path

from service.problems import ProblemError
from spherify.formats import FORMATS_OUT
from spherify.geometry.fields import FIELDS, FieldName
from spherify.jobs.ids import JOB_ID, MESH_ID

_JOB: Final = Path(description="Identifier of a job.", examples=["job_01K5Z9Q8M4T6V2X0Y7R3N1W5BC"])
_MESH: Final = Path(description="Identifier of a mesh.", examples=["mesh_4T9V0K2J7C8N5R1W3X6Y0ZQABD"])
_WHICH: Final = Path(
    description="An iteration, or `initial`, `latest`, `best` (of the highest sphericity), `final` (the result).",
    examples=["500", "latest"],
)
_FORMAT: Final = Path(description="Format of the file.", json_schema_extra={"enum": list(FORMATS_OUT)})


_FIELD: Final = Path(
    description="Which: "
    + "; ".join(f"`{name}` ({it.unit}): {it.description}" for name, it in FIELDS.items()),
    json_schema_extra={"enum": list(FIELDS)},
)


async def _job_id(job_id: Annotated[str, _JOB]) -> str:
    if not JOB_ID.fullmatch(job_id):
        raise ProblemError("not-found", f"there is no job {job_id[:80]!r}")
    return job_id


async def _mesh_id(mesh_id: Annotated[str, _MESH]) -> str:
    if not MESH_ID.fullmatch(mesh_id):
        raise ProblemError("not-found", f"there is no mesh {mesh_id[:80]!r}")
    return mesh_id


async def _which(which: Annotated[str, _WHICH]) -> str:
    return which


async def _format(format: Annotated[str, _FORMAT]) -> str:  # noqa: A002 (its name in the address)
    if format not in FORMATS_OUT:
        raise ProblemError(
            "not-found", f"there is no form {format[:20]!r}; {', '.join(FORMATS_OUT)} are written"
        )
    return format


async def _field(field: Annotated[str, _FIELD]) -> str:
    if field not in FIELDS:
        raise ProblemError("not-found", f"there is no field {field[:20]!r}; there are {', '.join(FIELDS)}")
    return field


JobId = Annotated[str, Depends(_job_id)]
MeshId = Annotated[str, Depends(_mesh_id)]
Which = Annotated[str, Depends(_which)]
MeshFormat = Annotated[str, Depends(_format)]
VertexField = Annotated[FieldName, Depends(_field)]
