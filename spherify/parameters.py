"""The parameters of a job as users write them: one description for the API, its schema, and the command line.

`ParameterOverrides` is what a user sends, everything optional; `resolve` fills it from a preset into
`Parameters`, in which nothing is left open: those of the run's method. Their `config` is the mathematics' own.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, TypeAlias, get_args

from pydantic import BaseModel, ConfigDict, Field, create_model
from pydantic.fields import FieldInfo

from spherify.geometry.config import (
    LATE,
    Annealing,
    Boundary,
    Config,
    FlowConfig,
    ImplicitFlowConfig,
    Measure,
    Method,
    Rescale,
    Stage,
    StepUnit,
    Unfolding,
)
from spherify.geometry.errors import InvalidConfigError
from spherify.geometry.presets import DEFAULT_PRESET, PRESETS

MAX_ITERATIONS: Final = 1_000_000
MAX_TIME_STEP: Final = 1.0  # of the area: a step beyond lies within rounding of the limit
METHODS: Final[tuple[Method, ...]] = get_args(Method)
DEFAULT_METHOD: Final = METHODS[0]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class StageParameters(_Strict):
    """`repeat` iterations, each of `k_in` inward and then `k_out` outward elementary steps."""

    repeat: Annotated[int, Field(ge=1, le=MAX_ITERATIONS, title="Iterations of this stage")]
    k_in: Annotated[int, Field(ge=0, le=100, title="Inward steps an iteration")]
    k_out: Annotated[int, Field(ge=0, le=100, title="Outward steps an iteration")]


class AnnealingParameters(_Strict):
    """Step and relaxation are multiplied by `factor` after `patience` iterations without progress."""

    patience: Annotated[int, Field(ge=1, le=MAX_ITERATIONS, title="Iterations without progress")]
    factor: Annotated[float, Field(gt=0, lt=1, title="Factor")]
    min_step: Annotated[
        float,
        Field(gt=0, title="Least step", description="Below it the run ends as `stalled`, round or not."),
    ]


class UnfoldingParameters(_Strict):
    """From `sphericity` on, or where nothing gets rounder: radii are evened out and folds undone, on the sphere."""

    sphericity: Annotated[
        float,
        Field(
            gt=0,
            lt=1,
            title="Sphericity",
            description=f"From this Ψ on; from less after {LATE} iterations, or where nothing gets rounder.",
        ),
    ]
    exponent: Annotated[
        float,
        Field(
            gt=0,
            le=8,
            title="Exponent",
            description="Neighbours weigh the area of the triangles at them to this power.",
        ),
    ]
    rounds: Annotated[int, Field(ge=1, le=1000, title="Rounds after each iteration")]


class _Shared(_Strict):
    """What every method is told."""

    method: Annotated[
        Method,
        Field(
            title="Method",
            description="`curvature`: the curvature transformation, what this project is about; to compare it with, "
            "`conformal`: conformalized mean curvature flow (Kazhdan, Solomon and Ben-Chen 2012), and "
            "`mean-curvature`: plain mean curvature flow, which pinches off necks and limbs. Each has parameters of "
            "its own, and presets.",
        ),
    ]
    iterations: Annotated[
        int,
        Field(
            ge=0,
            le=MAX_ITERATIONS,
            title="Iterations",
            description="Iterations at most; a stopping rule may end the run before.",
        ),
    ]
    measure: Annotated[
        Measure,
        Field(
            title="Curvature measure",
            description="`vtk`: pointwise, as vtkCurvatures computes it (the paper's pictures); `length`: length × "
            "dihedral angle (the paper's formula); `dual-area`: the textbook pointwise mean curvature. The flows do "
            "not depend on it; their figures do.",
        ),
    ]
    rescale: Annotated[
        Rescale,
        Field(
            title="Rescale",
            description="What is restored after each iteration. An open mesh has its area restored where the volume is "
            "asked for, and nothing where its boundary is fixed.",
        ),
    ]
    stop_radius_variation: Annotated[
        float,
        Field(
            ge=0,
            title="Round enough",
            description="Below this radius variation the run ends as `converged`, once no face looks inward or has "
            "vanished, and it does not get rounder by what it began on the sphere; 0 is off.",
        ),
    ]
    boundary: Annotated[
        Boundary,
        Field(
            title="Open boundary",
            description="Whether vertices on an open boundary move; closed meshes have none.",
        ),
    ]


class CurvatureParameters(_Shared):
    """Every parameter of a run of the curvature transformation, resolved."""

    method: Annotated[Literal["curvature"], _Shared.model_fields["method"]]
    schedule: Annotated[
        tuple[StageParameters, ...],
        Field(
            min_length=1,
            max_length=100,
            title="Schedule",
            description="Stages, repeated in turn until the iterations are done.",
        ),
    ]
    step: Annotated[float, Field(gt=0, title="Step", description="C of the paper, in units of `step_unit`.")]
    step_unit: Annotated[
        StepUnit,
        Field(
            title="Unit of the step",
            description="`absolute`: the file's own unit; else the mean edge at the start, or now.",
        ),
    ]
    window: Annotated[
        tuple[Annotated[float, Field(ge=0, le=100)], Annotated[float, Field(ge=0, le=100)]],
        Field(
            title="Percentile window",
            description="Percentiles of K that stand for the least and the greatest; [0, 100] is the paper's.",
        ),
    ]
    step_bound: Annotated[
        float,
        Field(
            ge=0,
            title="Step bound",
            description="No vertex moves further than this times the least altitude of its triangles; 0 is off.",
        ),
    ]
    relaxation: Annotated[
        float,
        Field(
            ge=0,
            le=1,
            title="Tangential relaxation",
            description="How far a vertex moves, within its tangent plane, to the middle of its neighbours; 0 is off.",
        ),
    ]
    relaxation_exponent: Annotated[
        float,
        Field(
            ge=0,
            le=10,
            title="Relaxation exponent",
            description="Neighbours weigh their area to this power; 0 is uniform.",
        ),
    ]
    momentum: Annotated[
        float,
        Field(
            ge=0,
            lt=1,
            title="Momentum",
            description="Most that is repeated of the last movement: k/(k + 3), k iterations after "
            "the last fall of Ψ, up to this; 0 is off.",
        ),
    ]
    annealing: Annotated[AnnealingParameters | None, Field(title="Annealing", description="null is off.")]
    unfolding: Annotated[
        UnfoldingParameters | None,
        Field(
            title="Unfolding",
            description="Closed meshes of genus 0: once nearly round, the radii are evened out, and directions are "
            "drawn to those of their neighbours until no face looks inward; then T goes on, and in the end directions "
            "climb to the greatest sphericity. null is off.",
        ),
    ]

    def config(self) -> FlowConfig:
        """Return the configuration of the run; raises `InvalidConfigError` where two values contradict."""
        values = {name: getattr(self, name) for name in type(self).model_fields}
        values["schedule"] = tuple(Stage(s.repeat, s.k_in, s.k_out) for s in self.schedule)
        if self.annealing is not None:
            values["annealing"] = Annealing(**self.annealing.model_dump())
        if self.unfolding is not None:
            values["unfolding"] = Unfolding(**self.unfolding.model_dump())
        return FlowConfig(**values)


class ImplicitFlowParameters(_Shared):
    """Every parameter of a run of a mean curvature flow, resolved."""

    method: Annotated[Literal["conformal", "mean-curvature"], _Shared.model_fields["method"]]
    time_step: Annotated[
        float,
        Field(
            gt=0,
            le=MAX_TIME_STEP,
            title="Time step",
            description="δ of an iteration, in units of the surface's area at the start; small steps are exact, "
            "large ones quick.",
        ),
    ]
    patience: Annotated[
        int,
        Field(
            ge=0,
            le=MAX_ITERATIONS,
            title="Patience",
            description="The run ends as `stalled` after so many iterations in which the best sphericity did not "
            "rise by 1e-4; 0 is off.",
        ),
    ]

    def config(self) -> ImplicitFlowConfig:
        """Return the configuration of the run."""
        return ImplicitFlowConfig(**self.model_dump())


Parameters: TypeAlias = Annotated[CurvatureParameters | ImplicitFlowParameters, Field(discriminator="method")]
"""Every parameter of a run, resolved: those of its method."""

PARAMETERS_OF: Final[Mapping[str, type[CurvatureParameters | ImplicitFlowParameters]]] = {
    "curvature": CurvatureParameters,
    "conformal": ImplicitFlowParameters,
    "mean-curvature": ImplicitFlowParameters,
}
"""By method."""


def _every_field() -> dict[str, tuple[object, FieldInfo]]:
    """Return type and field of every parameter of any method, in the order of a form: the method first."""
    fields: dict[str, tuple[object, FieldInfo]] = {}
    for model in (_Shared, *dict.fromkeys(PARAMETERS_OF.values())):
        for name, field in model.model_fields.items():
            fields.setdefault(name, (field.rebuild_annotation(), field))
    return fields


PARAMETER_NAMES: Final = tuple(_every_field())
"""Every parameter of any method."""

if TYPE_CHECKING:

    class ParameterOverrides(_Strict):
        """What a user changes of a preset; everything may be left out."""

else:  # derived, so that a parameter is described once
    ParameterOverrides = create_model(
        "ParameterOverrides",
        __base__=_Strict,
        __doc__="What a user changes of a preset; everything may be left out.",
        **{
            name: (annotation | None, Field(default=None, title=field.title, description=field.description))
            for name, (annotation, field) in _every_field().items()
        },
    )


def parameters_of(config: Config) -> CurvatureParameters | ImplicitFlowParameters:
    """Return the parameters that mean the same as a configuration."""
    return PARAMETERS_OF[config.method].model_validate(asdict(config))


def stored_parameters(values: Mapping[str, Any]) -> CurvatureParameters | ImplicitFlowParameters:
    """Read what a job has stored; jobs from before there were methods have the one there was."""
    method = values.get("method", DEFAULT_METHOD)
    return PARAMETERS_OF[method].model_validate({"method": method, **values})


def parameters_schema(ref_template: str = "#/$defs/{model}") -> dict[str, Any]:
    """Return the JSON Schema of every parameter; ``x-methods`` of a property are the methods that have it."""
    fields: dict[str, Any] = _every_field()
    schema = create_model("Parameters", __base__=_Strict, **fields).model_json_schema(
        ref_template=ref_template
    )
    for name, entry in schema["properties"].items():
        entry["x-methods"] = [method for method, model in PARAMETERS_OF.items() if name in model.model_fields]
    schema["required"] = list(_Shared.model_fields)
    return schema


def chosen_preset(preset: str | None, method: str | None) -> str:
    """Return the preset that is meant: the one named, else the first one of the method, else the default one.

    Raises:
        InvalidConfigError: there is no such preset or method, or the preset is of another method.

    """
    if method is not None and method not in METHODS:
        raise InvalidConfigError(f"there is no method {method!r}; there are {', '.join(METHODS)}")
    if preset is None:
        of_method = (name for name, entry in PRESETS.items() if entry.config.method == method)
        return DEFAULT_PRESET if method is None else next(of_method)
    if preset not in PRESETS:
        raise InvalidConfigError(f"there is no preset {preset!r}; there are {', '.join(PRESETS)}")
    if method not in {None, PRESETS[preset].config.method}:
        raise InvalidConfigError(
            f"the preset {preset} is of the method {PRESETS[preset].config.method}, not {method}: leave one out"
        )
    return preset


def resolve(preset: str, overrides: Mapping[str, Any]) -> CurvatureParameters | ImplicitFlowParameters:
    """Lay what a user changed over a preset.

    Raises:
        KeyError: no such preset.
        pydantic.ValidationError: a value outside its range, or an unknown name.
        InvalidConfigError: two values that contradict each other, or a parameter of another method.

    """
    config = PRESETS[preset].config
    model = PARAMETERS_OF[config.method]
    for name in overrides:
        if name in PARAMETER_NAMES and name not in model.model_fields:
            raise InvalidConfigError(
                f"the method {config.method} has no parameter {name}; it has {', '.join(model.model_fields)}"
            )
    # As JSON, of which strictness takes lists for tuples: true is no number, whoever says it.
    parameters = model.model_validate_json(json.dumps({**asdict(config), **overrides}), strict=True)
    parameters.config()
    return parameters
