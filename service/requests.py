"""What a client sends to have a mesh morphed: as JSON, or as a form with the same names.

A form is translated into the JSON and checked as such, so that there is one description of a job.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Final

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError

from service.problems import FieldError, ProblemError, invalid, invalid_many, invalid_model
from service.repeats import Identity
from spherify.formats import ALLOW
from spherify.formats.names import safe_stem
from spherify.geometry.config import Method
from spherify.geometry.errors import InvalidConfigError
from spherify.geometry.presets import PRESETS
from spherify.geometry.schedule import MAX_SNAPSHOTS, SnapshotPlan
from spherify.jobs.ids import time_of
from spherify.jobs.model import JobSpec, MeshRecord
from spherify.parameters import (
    PARAMETER_NAMES,
    ParameterOverrides,
    Parameters,
    chosen_preset,
    resolve,
)
from spherify.settings import Settings

DEFAULT_SNAPSHOTS: Final = "log:12"
MAX_NAME: Final = 120
PRINTABLE: Final = r"^[^\x00-\x1f\x7f]+$"
TAG: Final = r"^[A-Za-z0-9._:/+-]{1,64}$"
SNAPSHOT: Final = r"^job_[0-9A-Za-z]{1,32}/[0-9a-z]{1,12}$"
_LISTS: Final = frozenset({"tags", "allow"})
_TEXTS: Final = frozenset(
    {"mesh_id", "from_snapshot", "name", "preset", "method"}
)  # taken as they are, whatever JSON would make of them
_OWN_NAMES: Final = frozenset(PARAMETER_NAMES) - {"iterations", "method"}
_SINGLE: Final = _TEXTS | {"iterations", "snapshots", "parameters"}


class JobRequest(BaseModel):
    """A job to be done on a mesh that is known already."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        json_schema_extra={
            "examples": [
                {
                    "mesh_id": "mesh_4T9V0K2J7C8N5R1W3X6Y0ZQABD",
                    "preset": "robust",
                    "iterations": 2000,
                    "snapshots": [100, 500, 1000],
                    "name": "bunny",
                    "tags": ["animals"],
                }
            ]
        },
    )

    mesh_id: Annotated[
        str | None, Field(max_length=64, description="From `POST /v1/meshes`; this or `from_snapshot`.")
    ] = None
    from_snapshot: Annotated[
        str | None,
        Field(
            max_length=80,
            pattern=SNAPSHOT,
            description="A kept state of another job, which becomes a mesh of its own to begin with: the job's id, a "
            "slash, and an iteration or `initial`, `latest`, `best`, `final`.",
            examples=["job_01K5Z9Q8M4T6V2X0Y7R3N1W5BC/500"],
        ),
    ] = None
    method: Annotated[
        Method | None,
        Field(
            description="Short for `parameters.method`: how the mesh is morphed; that of the preset by default."
        ),
    ] = None
    preset: Annotated[
        str | None,
        Field(
            description="Where the parameters start from: see `/v1/presets`; `robust` by default, or the first one "
            "of the method.",
            json_schema_extra={"enum": [*PRESETS, None]},
        ),
    ] = None
    parameters: Annotated[
        ParameterOverrides | None,
        Field(description="What differs from the preset: see `/v1/parameters`."),
    ] = None
    iterations: Annotated[
        int | None,
        Field(
            ge=0,
            description="Short for `parameters.iterations`: iterations at most; the preset's by default.",
        ),
    ] = None
    snapshots: Annotated[
        str | Annotated[list[Annotated[int, Field(ge=0)]], Field(max_length=MAX_SNAPSHOTS)] | None,
        Field(
            description="Iterations whose state is kept: a list, `100,500,1000`, `every:100`, or `log:12` (the "
            "default). 0 and the last are always kept.",
            examples=[[100, 500, 1000], "every:100", "log:12"],
        ),
    ] = None
    name: Annotated[
        Annotated[
            str,
            StringConstraints(strip_whitespace=True, min_length=1, max_length=MAX_NAME, pattern=PRINTABLE),
        ]
        | None,
        Field(
            description="Name of the job and of its downloads, blanks around it left out; the mesh's name by default."
        ),
    ] = None
    tags: Annotated[
        list[Annotated[str, Field(pattern=TAG)]] | None,
        Field(
            max_length=20,
            description="Words to find the job by. `up:z` has the page show it with z upward.",
        ),
    ] = None


@dataclass(frozen=True, slots=True)
class JobPlan:
    """A request that has been checked: everything of a job but its mesh."""

    preset: str
    parameters: Parameters
    snapshots: tuple[int, ...]
    name: str | None
    tags: tuple[str, ...]

    def named(self, mesh: MeshRecord, name: str | None = None) -> str:
        """Return what the job will be called: as was asked, or like the file, or like the mesh."""
        return self.name or safe_stem(name or mesh.name)

    def spec(self, mesh: MeshRecord, identity: Identity, name: str | None = None) -> JobSpec:
        """Return the job this is, on a mesh, under an identity."""
        return JobSpec(
            id=identity.job_id,
            mesh_id=mesh.id,
            name=self.named(mesh, name),
            tags=self.tags,
            preset=self.preset,
            parameters=self.parameters.model_dump(mode="json"),
            snapshots_requested=self.snapshots,
            created_at=time_of(identity.job_id),
            request=identity.request,
        )

    def as_dict(self) -> dict[str, Any]:
        """Return what is asked, JSON-ready: equal for requests that mean the same."""
        return {
            "preset": self.preset,
            "parameters": self.parameters.model_dump(mode="json"),
            "snapshots": list(self.snapshots),
            "name": self.name,
            "tags": list(self.tags),
        }


def parse_json(text: bytes) -> JobRequest:
    """Read a request; raises `malformed-json`, `invalid-parameters`."""
    try:
        return JobRequest.model_validate_json(text, strict=True)
    except ValidationError as e:
        raise invalid_model(e) from e


def parse_form(fields: Mapping[str, Sequence[str]], mesh_id: str | None) -> JobRequest:
    """Read a request from form fields, on the mesh that came with it (its id is not known yet: any text) or on
    the one that the form names.
    """  # noqa: D205 (one sentence)
    values = _single(fields)
    if (mesh_id is not None) + ("mesh_id" in values) + ("from_snapshot" in values) != 1:
        raise invalid(
            "form/file", "one-mesh", "send a file, or the mesh_id of one sent before, or from_snapshot"
        )
    if mesh_id is None and "allow" in fields:
        raise invalid("form/allow", "no-file", "the switches belong to the upload of the mesh")
    parameters = _json(values.pop("parameters")) if "parameters" in values else {}
    if not isinstance(parameters, dict):
        raise invalid("form/parameters", "object", 'a JSON object is needed, such as {"step": 0.05}')
    own = {name: _json(values.pop(name)) for name in tuple(values) if name in _OWN_NAMES}
    if twice := sorted(own.keys() & parameters.keys()):
        raise invalid(f"form/{twice[0]}", "repeated", "given within `parameters` as well")
    request: dict[str, Any] = {
        name: value if name in _TEXTS else _json(value) for name, value in values.items()
    }
    request |= {"parameters": parameters | own}
    if mesh_id is not None:
        request["mesh_id"] = mesh_id
    if "tags" in fields:
        request["tags"] = _words(fields["tags"])
    if not isinstance(request.get("snapshots", ""), list):
        request["snapshots"] = values.get("snapshots")
    try:
        return JobRequest.model_validate_json(json.dumps(request), strict=True)
    except ValidationError as e:
        raise _as_form(invalid_model(e), own) from e


def parse_allow(values: Sequence[str], pointer: str) -> frozenset[str]:
    """Read the switches that let unusual meshes in, separated by commas or repeated."""
    words = _words(values)
    for word in words:
        if word not in ALLOW:
            raise invalid(pointer, "unknown", f"there is no {word[:40]!r}; choose of {', '.join(ALLOW)}")
    return frozenset(words)


def plan(request: JobRequest, settings: Settings) -> JobPlan:
    """Check a request against presets, bounds and each other; raises `invalid-parameters`."""
    if (request.mesh_id is None) == (request.from_snapshot is None):
        raise invalid("#/mesh_id", "one-mesh", "name a mesh: either mesh_id or from_snapshot")
    if request.preset is not None and request.preset not in PRESETS:
        raise invalid("#/preset", "unknown", f"there is no {request.preset[:40]!r}: {', '.join(PRESETS)}")
    overrides = _overrides(request)
    try:
        preset = chosen_preset(request.preset, overrides.get("method"))
        parameters = resolve(preset, overrides)
    except ValidationError as e:
        raise invalid_model(e, "#/parameters") from e
    except InvalidConfigError as e:
        raise invalid("#/parameters", "contradiction", str(e)) from e
    if parameters.iterations > settings.max_iterations:
        raise invalid(
            "#/iterations", "too-many", f"at most {settings.max_iterations}, not {parameters.iterations}"
        )
    wanted = DEFAULT_SNAPSHOTS if request.snapshots is None else request.snapshots
    try:
        snapshots = SnapshotPlan.parse(wanted, parameters.iterations).iterations
    except InvalidConfigError as e:
        raise invalid("#/snapshots", "plan", str(e)) from e
    tags = tuple(dict.fromkeys(request.tags or ()))
    return JobPlan(preset, parameters, snapshots, request.name, tags)


def plan_form(request: JobRequest, fields: Collection[str], settings: Settings) -> JobPlan:
    """Check a request that came in these form fields; raises `invalid-parameters`."""
    try:
        return plan(request, settings)
    except ProblemError as e:
        raise _as_form(e, fields) from e


def _overrides(request: JobRequest) -> dict[str, Any]:
    given = request.parameters
    overrides = given.model_dump(mode="json", exclude_unset=True) if given is not None else {}
    # null means "as the preset has it", but for annealing and unfolding, which null turns off
    overrides = {k: v for k, v in overrides.items() if v is not None or k in {"annealing", "unfolding"}}
    for name, short in (("iterations", request.iterations), ("method", request.method)):
        if short is not None and overrides.setdefault(name, short) != short:
            raise invalid(f"#/{name}", "contradiction", f"parameters.{name} is another one")
    return overrides


def _single(fields: Mapping[str, Sequence[str]]) -> dict[str, str]:
    errors = []
    for name, values in fields.items():
        if name not in _SINGLE | _OWN_NAMES | _LISTS:
            known = ", ".join(sorted(_SINGLE | _LISTS | {"file"}))
            errors.append(
                FieldError(f"form/{name[:80]}", "unknown", f"the fields are {known}, and every parameter")
            )
        elif len(values) > 1 and name not in _LISTS:
            errors.append(FieldError(f"form/{name}", "repeated", "this field can be sent once"))
    if errors:
        raise invalid_many(errors)
    return {name: values[0] for name, values in fields.items() if name not in _LISTS}


def _json(text: str) -> Any:  # noqa: ANN401 (whatever JSON holds)
    """Read a form value as JSON, and as plain text where it is none: both `measure=vtk` and `window=[30,70]` work."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return text


def _words(values: Sequence[str]) -> list[str]:
    return [word.strip() for value in values for word in value.split(",") if word.strip()]


def _as_form(problem: ProblemError, own: Collection[str]) -> ProblemError:
    """Let the pointers name the form's fields."""
    errors = []
    for error in problem.errors:
        pointer = str(error["pointer"]).replace("#", "form", 1)
        inner = pointer.removeprefix("form/parameters/")
        if inner != pointer and inner.split("/")[0] in own:
            pointer = f"form/{inner}"
        errors.append(FieldError(pointer, str(error["code"]), str(error["detail"])))
    return invalid_many(errors) if errors else problem
