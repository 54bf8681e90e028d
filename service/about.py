"""What the service says about itself."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, Final, Literal

from pydantic import Field

from service.context import Services
from service.problems import ProblemError
from service.requests import DEFAULT_SNAPSHOTS
from service.schemas import Answer
from service.uploads import check_space
from spherify import __version__
from spherify.formats import ALLOW, FORMATS_IN, FORMATS_OUT, media_type
from spherify.geometry.presets import DEFAULT_PRESET, PRESETS
from spherify.geometry.schedule import MAX_SNAPSHOTS
from spherify.jobs.errors import JobsError
from spherify.jobs.model import JobStatus
from spherify.parameters import (
    DEFAULT_METHOD,
    PARAMETERS_OF,
    Parameters,
    chosen_preset,
    parameters_of,
    parameters_schema,
)
from spherify.settings import Settings

OK: Final = "ok"


class LimitsOut(Answer):
    """What is taken at most."""

    max_upload_bytes: int
    max_vertices: int
    max_faces: int
    max_iterations: int
    max_snapshots: int
    upload_timeout_s: float
    wall_limit_s: float


class FormatOut(Answer):
    """A mesh format."""

    name: str
    media_type: str


class FormatsOut(Answer):
    """Formats that are read and written."""

    read: list[FormatOut]
    written: list[FormatOut]


class InfoOut(Answer):
    """The service."""

    name: str
    version: str
    limits: LimitsOut
    formats: FormatsOut
    allow: list[str] = Field(description="The switches that let unusual meshes in.")
    default_preset: str
    default_snapshots: str
    jobs: dict[JobStatus, int] | None = Field(
        description="Jobs by state; null while their store does not answer."
    )


class PresetOut(Answer):
    """A named set of parameters."""

    name: str
    title: str
    description: str
    default: bool = Field(description="Whether it is taken when none is named.")
    parameters: Parameters


class PresetsOut(Answer):
    """All presets, the default one first."""

    items: list[PresetOut]


class MethodOut(Answer):
    """A method, with the parameters it has."""

    name: str
    default: bool = Field(description="Whether it is taken when none is named.")
    preset: str = Field(description="Where its parameters start from when no preset is named.")
    parameters: list[str]


class ParametersOut(Answer):
    """The schema of `parameters`, those of each method, and the value of each in every preset."""

    parameters: dict[str, Any] = Field(
        alias="schema",
        description="JSON Schema, draft 2020-12, of the parameters of all methods; `x-methods` of each names those "
        "that have it.",
    )
    methods: list[MethodOut]
    defaults: dict[str, Parameters] = Field(description="By preset.")


class HealthOut(Answer):
    """The process lives."""

    status: Literal["ok"]


class ReadyOut(Answer):
    """Everything the service depends on answers."""

    status: Literal["ready"]
    checks: dict[str, str] = Field(examples=[{"jobs": OK, "meshes": OK, "queue": OK, "files": OK}])


def info_out(services: Services) -> InfoOut:
    """Describe the service."""
    settings = services.settings
    try:
        jobs = services.stores.jobs.counts()
    except JobsError:  # said in the answer: null
        jobs = None
    return InfoOut(
        name="Spherify",
        version=__version__,
        limits=LimitsOut(
            max_upload_bytes=settings.max_upload_bytes,
            max_vertices=settings.max_vertices,
            max_faces=settings.max_faces,
            max_iterations=settings.max_iterations,
            max_snapshots=MAX_SNAPSHOTS,
            upload_timeout_s=settings.upload_timeout_s,
            wall_limit_s=settings.wall_limit_s,
        ),
        formats=FormatsOut(read=_formats(FORMATS_IN), written=_formats(FORMATS_OUT)),
        allow=list(ALLOW),
        default_preset=DEFAULT_PRESET,
        default_snapshots=DEFAULT_SNAPSHOTS,
        jobs=jobs,
    )


def presets_out() -> PresetsOut:
    """Describe the presets."""
    presets = sorted(PRESETS.values(), key=lambda preset: preset.name != DEFAULT_PRESET)
    return PresetsOut(
        items=[
            PresetOut(
                name=preset.name,
                title=preset.title,
                description=preset.description,
                default=preset.name == DEFAULT_PRESET,
                parameters=parameters_of(preset.config),
            )
            for preset in presets
        ]
    )


def parameters_out(settings: Settings) -> ParametersOut:
    """Describe the parameters, with the bounds of this service."""
    schema = parameters_schema()
    schema["properties"]["iterations"]["maximum"] = min(
        settings.max_iterations, schema["properties"]["iterations"]["maximum"]
    )
    defaults = {name: parameters_of(preset.config) for name, preset in PRESETS.items()}
    methods = [
        MethodOut(
            name=name,
            default=name == DEFAULT_METHOD,
            preset=chosen_preset(None, name),
            parameters=list(model.model_fields),
        )
        for name, model in PARAMETERS_OF.items()
    ]
    return ParametersOut(schema=schema, methods=methods, defaults=defaults)


def probe(services: Services) -> dict[str, str]:
    """Ask every dependency; each is `ok`, or a sentence on what is wrong."""
    stores = services.stores
    probes: dict[str, Callable[[], object]] = {
        "jobs": stores.jobs.ping,
        "meshes": lambda: stores.meshes.find(limit=1),
        "queue": stores.queue.length,
        "files": lambda: _files(services),
    }
    checks = {}
    for name, ask in probes.items():
        try:
            ask()
        except (JobsError, ProblemError, OSError) as e:
            checks[name] = str(e) or type(e).__name__
        else:
            checks[name] = OK
    return checks


def _files(services: Services) -> None:
    folder = services.stores.blobs.scratch()
    check_space(folder, 0, services.settings.min_free_bytes)
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError("the data folder cannot be written to")
    services.stores.blobs.ping()


def _formats(names: tuple[str, ...]) -> list[FormatOut]:
    return [FormatOut(name=name, media_type=media_type(name)) for name in names]
