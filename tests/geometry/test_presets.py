"""What the presets are for: the paper's pictures, its failures caught, and spheres from real animals.

The literal method at its own pace takes thousands of iterations. Its step is a fraction of the mean edge, the mesh
being seen at a mean edge of 100; here it is seen at 25 where that does not change the outcome.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import pytest

from spherify.geometry.config import Stage
from spherify.geometry.flow import flow
from spherify.geometry.measures import norm
from spherify.geometry.presets import ALGORITHM_2, DEFAULT_PRESET, PRESETS
from tests.geometry.shapes import read_obj, sample

PAPER = PRESETS["paper"].config
ROBUST = PRESETS["robust"].config


def seen_at(mean_edge):
    """The paper's step of 0.25 on the mesh scaled to this mean edge."""
    return replace(PAPER, step=0.25 / mean_edge)


def first_state(mesh, config, sphericity, within):
    """The first state at least that round, if there is one."""
    states = islice(flow(mesh, config), within + 1)
    return next((state for state in states if state.sphericity >= sphericity), None)


def test_what_the_presets_are():
    assert DEFAULT_PRESET in PRESETS
    assert (Stage(100, 2, 2), Stage(100, 2, 1)) == ALGORITHM_2
    assert (PAPER.step, PAPER.step_unit, PAPER.measure) == (0.0025, "initial-mean-edge", "vtk")
    letter = PRESETS["paper-absolute"].config
    assert replace(letter, step=PAPER.step, step_unit=PAPER.step_unit) == PAPER
    assert (letter.step, letter.step_unit) == (0.25, "absolute")


def test_the_paper_to_the_letter_is_the_same_method_at_one_scale():
    """A mesh whose mean edge is 100 moves alike under both presets."""
    mesh = sample("stone", 200)
    edge = next(iter(flow(mesh, replace(PAPER, step=1.0)))).step
    mesh = mesh.with_vertices(mesh.vertices * (100 / edge))
    for one, other in zip(
        islice(flow(mesh, PAPER), 4), islice(flow(mesh, PRESETS["paper-absolute"].config), 4), strict=True
    ):
        assert one.vertices == pytest.approx(other.vertices, abs=1e-9)
        assert one.step == pytest.approx(0.25)


class TestTheLiteralMethod:
    def test_cube(self):
        assert first_state(sample("cube", 1352), PAPER, 0.999, within=700) is not None

    # 0.999 is beyond 642 vertices: a perfect sphere of so few has 0.9989. At 2,562 vertices both get there.
    @pytest.mark.parametrize(("name", "sphericity"), [("sphere-bar", 0.9945), ("non-convex-sphere", 0.997)])
    def test_bodies_with_dents_and_waists(self, name, sphericity):
        assert first_state(sample(name, 642), seen_at(25), sphericity, within=700) is not None

    def test_lengths_as_curvature_unmake_a_round_sphere(self):
        """Why ``vtk`` is the default: with l·θ a round sphere of uneven triangles is no fixed point."""
        bar = sample("sphere-bar", 300)
        sphere = bar.with_vertices(bar.vertices / norm(bar.vertices)[:, None])
        ratio = {}
        for measure in ("vtk", "length"):
            *_, last = flow(sphere, replace(seen_at(25), measure=measure, iterations=150))
            ratio[measure] = last.metrics().radius_ratio
        assert ratio["length"] < 0.9 < ratio["vtk"]


class TestRobust:
    def test_a_real_animal_reaches_a_sphericity_of_0_999(self):
        state = first_state(read_obj("spot.obj"), ROBUST, 0.999, within=400)
        assert state is not None
        assert state.metrics().inward_faces == 0
