"""What a client sends to have a finished job go on."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from service.problems import invalid_model
from service.requests import DEFAULT_SNAPSHOTS
from spherify.geometry.schedule import MAX_SNAPSHOTS
from spherify.parameters import MAX_ITERATIONS


class ExtendRequest(BaseModel):
    """How far a job is to go on."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        json_schema_extra={"examples": [{"iterations": 1000, "snapshots": "every:100"}]},
    )

    iterations: Annotated[
        int, Field(ge=1, le=MAX_ITERATIONS, description="Iterations beyond the last one of the job.")
    ]
    snapshots: Annotated[
        str | Annotated[list[Annotated[int, Field(ge=0)]], Field(max_length=MAX_SNAPSHOTS)],
        Field(
            description="Iterations whose state is kept, beside the parent's. They go on counting where it ended: "
            "after 1000, a list would be `1100,1500`; `every:100` keeps 1100, 1200, …; `log:12` (the default) spreads "
            "12 from there.",
            examples=["every:100", [1100, 1500], "log:12"],
        ),
    ] = DEFAULT_SNAPSHOTS


def parse_extension(text: bytes) -> ExtendRequest:
    """Read a request; raises `malformed-json`, `invalid-parameters`."""
    try:
        return ExtendRequest.model_validate_json(text, strict=True)
    except ValidationError as e:
        raise invalid_model(e) from e
