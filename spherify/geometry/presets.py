"""The named configurations a user chooses from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from spherify.geometry.config import Annealing, Config, FlowConfig, ImplicitFlowConfig, Stage, Unfolding

ALGORITHM_2: Final = (Stage(100, 2, 2), Stage(100, 2, 1))  # Vartziotis, Algorithm 2
DEFAULT_PRESET: Final = "robust"


@dataclass(frozen=True, slots=True)
class Preset:
    """A configuration with a name, and a sentence on what to expect of it."""

    name: str
    title: str
    description: str
    config: Config


_PAPER: Final = FlowConfig(
    iterations=10_000,
    measure="vtk",
    schedule=ALGORITHM_2,
    step=0.25 / 100,  # C = 0.25 on the mesh scaled to a mean edge of 100
    step_unit="initial-mean-edge",
)

PRESETS: Final = {
    preset.name: preset
    for preset in (
        Preset(
            "robust",
            "Robust",
            "Round spheres from real meshes, animals with limbs included. The transformation of the paper, with steps "
            "that suit the size of each triangle; once nearly round, what has folded is turned outward again. "
            "Ends by itself.",
            FlowConfig(
                iterations=5_000,
                measure="dual-area",
                schedule=(Stage(1, 2, 2),),
                step=0.05,
                step_unit="mean-edge",
                window=(30.0, 70.0),
                step_bound=0.2,
                relaxation=0.5,
                relaxation_exponent=1.0,
                momentum=0.98,
                rescale="area",
                annealing=Annealing(patience=50, factor=0.5, min_step=1e-4),
                unfolding=Unfolding(sphericity=0.97, exponent=4.0, rounds=16),
                stop_radius_variation=1e-3,
            ),
        ),
        Preset(
            "paper",
            "Paper",
            "Algorithm 2 of the paper with its step read as 0.25 % of the mean edge, so that it works at any scale. "
            "Reaches spheres from blobs, bars and boxes; animals with limbs turn inside out, which is noticed: "
            "the run ends as collapsed with its best state.",
            _PAPER,
        ),
        Preset(
            "paper-absolute",
            "Paper, to the letter",
            "Algorithm 2 of the paper with C = 0.25 in the file's own unit: what happens depends on the mesh's scale.",
            FlowConfig(
                iterations=10_000, measure="vtk", schedule=ALGORITHM_2, step=0.25, step_unit="absolute"
            ),
        ),
        Preset(
            "conformal",
            "Conformal flow",
            "Conformalized mean curvature flow, to compare with: most meshes are round within 30 iterations, each of "
            "which solves a linear system; thin limbs shrink to triangles of no area.",
            ImplicitFlowConfig(
                iterations=500,
                method="conformal",
                time_step=0.01,
                patience=40,
                stop_radius_variation=1e-3,
            ),
        ),
        Preset(
            "mean-curvature",
            "Mean curvature flow",
            "Plain mean curvature flow, to compare with: rounds convex bodies; necks and limbs pinch off, which is "
            "noticed: the run ends as collapsed, with its best state and the triangles that pinched.",
            ImplicitFlowConfig(
                iterations=1_000,
                method="mean-curvature",
                time_step=5e-4,
                patience=200,
                stop_radius_variation=1e-3,
            ),
        ),
    )
}
