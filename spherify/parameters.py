"""The parameters of a job as users write them: one description for the API, its schema, and the command line.

`ParameterOverrides` is what a user sends, everything optional; `resolve` fills it from a preset into
`Parameters`, in which nothing is left open; `Parameters.config` is the mathematics' own `FlowConfig`.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, create_model

from spherify.geometry.config import Annealing, Boundary, FlowConfig, Measure, Rescale, Stage, StepUnit
from spherify.geometry.presets import PRESETS

MAX_ITERATIONS = 1_000_000


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
        float, Field(gt=0, title="Least step", description="Below it the run ends as `stalled`.")
    ]


class Parameters(_Strict):
    """Every parameter of a run, resolved."""

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
            "dihedral angle (the paper's formula); `dual-area`: the textbook pointwise mean curvature.",
        ),
    ]
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
            ge=0, lt=1, title="Momentum", description="Share of the last movement that is repeated; 0 is off."
        ),
    ]
    rescale: Annotated[Rescale, Field(title="Rescale", description="What is restored after each iteration.")]
    annealing: Annotated[AnnealingParameters | None, Field(title="Annealing", description="null is off.")]
    stop_radius_variation: Annotated[
        float,
        Field(
            ge=0,
            title="Round enough",
            description="The run ends as `converged` below this radius variation, unless faces look inward; 0 is off.",
        ),
    ]
    boundary: Annotated[
        Boundary,
        Field(
            title="Open boundary",
            description="Whether vertices on an open boundary move; closed meshes have none.",
        ),
    ]

    def config(self) -> FlowConfig:
        """Return the configuration of the flow; raises `InvalidConfigError` where two values contradict."""
        values = {name: getattr(self, name) for name in type(self).model_fields}
        values["schedule"] = tuple(Stage(s.repeat, s.k_in, s.k_out) for s in self.schedule)
        if self.annealing is not None:
            values["annealing"] = Annealing(**self.annealing.model_dump())
        return FlowConfig(**values)

    @classmethod
    def of(cls, config: FlowConfig) -> Self:
        """Return the parameters that mean the same as a configuration."""
        return cls.model_validate(asdict(config))


if TYPE_CHECKING:

    class ParameterOverrides(_Strict):
        """What a user changes of a preset; everything may be left out."""

else:  # derived, so that a parameter is described once
    ParameterOverrides = create_model(
        "ParameterOverrides",
        __base__=_Strict,
        __doc__="What a user changes of a preset; everything may be left out.",
        **{
            name: (
                field.rebuild_annotation() | None,
                Field(default=None, title=field.title, description=field.description),
            )
            for name, field in Parameters.model_fields.items()
        },
    )


def resolve(preset: str, overrides: dict[str, Any]) -> Parameters:
    """Lay what a user changed over a preset.

    Raises:
        KeyError: no such preset.
        pydantic.ValidationError: a value outside its range, or an unknown name.
        InvalidConfigError: two values that contradict each other.

    """
    parameters = Parameters.model_validate({**asdict(PRESETS[preset].config), **overrides})
    parameters.config()
    return parameters
