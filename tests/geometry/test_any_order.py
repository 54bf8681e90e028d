"""A compiled kernel answers as a new one does, whatever it was asked before: nothing stale is in its buffers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from spherify.geometry.config import FlowConfig, Stage
from spherify.geometry.kernels import compiled, numbering
from spherify.geometry.kernels.compiled import CompiledEngine, CompiledKernel
from spherify.geometry.mesh import Floats, TriangleMesh
from spherify.geometry.presets import PRESETS
from spherify.geometry.roundness import ALL, Wanted
from spherify.geometry.samples.solids import icosphere
from spherify.geometry.topology import Topology
from spherify.geometry.unfolding import Unfolded
from tests.geometry.shapes import jittered, open_bump, pinched, uneven_sphere

PAPER, ROBUST = (PRESETS[name].config for name in ("paper", "robust"))
CONFIGS = {
    "paper": PAPER,  # whose steps go on from the curvature that a measurement has left
    "dual-area": replace(PAPER, measure="dual-area"),
    "bounded": replace(PAPER, step_bound=0.001),  # less than the step
    "weighed": replace(PAPER, relaxation=0.5, relaxation_exponent=0.5, window=(10.0, 90.0)),
    "robust": ROBUST,
}
MESHES = {
    "sphere": uneven_sphere(4),
    "pinched": jittered(pinched(), 0.1),  # measured by faces, as are open ones
    "open": jittered(open_bump(9), 0.01),
}
ENDS = Wanted(edges=False, variation=0.05)
CENTRE, ROUNDS = np.array([0.02, -0.01, 0.03]), 300
ONE_EACH, MORE = Stage(1, 1, 0), Stage(1, 2, 1)
Question = Callable[[CompiledKernel, Floats, Floats], Any]
QUESTIONS: list[Question] = [  # of positions and those before, the commonest first
    lambda kernel, V, _: kernel.figures(V, CENTRE),
    lambda kernel, V, _: kernel.shape(V),
    lambda kernel, V, _: kernel.transform(V, ONE_EACH, 1e-3, 0.0),
    lambda kernel, V, _: kernel.transform(V, MORE, 1e-3, 0.5),
    lambda kernel, V, W: kernel.transform(V, MORE, 1e-3, 0.0, previous=W, momentum=0.5),
    lambda kernel, V, _: kernel.transform(V, ONE_EACH, 1e-3, 0.0, measured=ENDS),
    lambda kernel, V, _: kernel.shape(V, ENDS),
    lambda kernel, V, W: kernel.transform(V, MORE, 1e-3, 0.5, previous=W, momentum=0.5, measured=ALL),
    lambda kernel, V, _: kernel.covering(V, CENTRE),
    lambda kernel, V, _: kernel.folds(V, CENTRE),
    lambda kernel, V, _: kernel.scaled(V, CENTRE, 1.001),
    lambda kernel, V, _: kernel.transform_radially(V, MORE, 1e-3, CENTRE),
    lambda kernel, V, W: kernel.ahead_along_radii(V, W, CENTRE, 0.5),
    lambda kernel, V, _: kernel.even_out(V, CENTRE, MORE),
]
ON_THE_SPHERE: list[Question] = [
    lambda kernel, V, _: kernel.unfold(V, CENTRE, np.zeros(len(V)), exponent=1.0, damping=0.5, rounds=2),
    lambda kernel, V, _: kernel.spread(V, CENTRE, 1),
    lambda kernel, V, W: kernel.ascend(V, W, CENTRE, 0.5),
    lambda kernel, V, _: kernel.centre_inside(V, CENTRE),
]


def said(answer: object) -> object:
    """Return an answer to the last bit."""
    if isinstance(answer, Unfolded):
        return [said(answer.positions), said(answer.log_weights), answer.inward, answer.least_area]
    return answer.tobytes(order="C") if isinstance(answer, np.ndarray) else repr(answer)


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("config", CONFIGS)
@pytest.mark.parametrize("name", MESHES)
def test_any_order_of_questions(name: str, config: str, threads: int, monkeypatch: pytest.MonkeyPatch):
    """Mostly of the positions it has made last, which may still be loaded; also of earlier ones, and of copies."""
    monkeypatch.setattr(compiled, "WORTH_SHARING", 1)
    monkeypatch.setattr(numbering, "WINDOW", 24)  # so that there are runs for all threads
    mesh: TriangleMesh = MESHES[name]
    settings: FlowConfig = CONFIGS[config]
    topology, random = Topology.of(len(mesh.vertices), mesh.faces), np.random.default_rng(len(config))
    questions = QUESTIONS + (ON_THE_SPHERE if name == "sphere" else [])
    positions = [np.array(mesh.vertices) * 1.01, np.array(mesh.vertices)]

    @cache
    def expected(number: int, which: int) -> object:
        kernel = CompiledEngine(1).prepare(topology, settings)
        return said(questions[which](kernel, positions[number].copy(), positions[number - 1].copy()))

    kernel = CompiledEngine(threads).prepare(topology, settings)
    for _ in range(ROUNDS):
        number = max(1, len(positions) - 1 - int(random.exponential(1.2)))
        which = min(int(random.exponential(len(questions) / 3)), len(questions) - 1)
        V = positions[number].copy() if random.random() < 0.05 else positions[number]
        answer = questions[which](kernel, V, positions[number - 1])
        assert said(answer) == expected(number, which)
        moved = answer.positions if isinstance(answer, Unfolded) else answer
        if isinstance(moved, np.ndarray) and moved.shape == V.shape and random.random() < 0.1:
            positions.append(moved)
    assert len(positions) > 4


@pytest.mark.parametrize("name", MESHES)
def test_positions_written_to_meanwhile_are_looked_at_again(name: str):
    mesh = MESHES[name]
    topology, V = Topology.of(len(mesh.vertices), mesh.faces), np.array(mesh.vertices)
    kernel, another = (CompiledEngine(1).prepare(topology, PAPER) for _ in range(2))
    V.setflags(write=False)
    kernel.shape(V)
    V.setflags(write=True)
    V *= 1.1
    assert said(kernel.shape(V)) == said(another.shape(V.copy()))
    V.setflags(write=False)
    assert said(kernel.figures(V, CENTRE)) == said(another.figures(V.copy(), CENTRE))


@pytest.mark.parametrize("name", MESHES)
def test_nobody_alters_a_shape_that_is_asked_for_again(name: str):
    mesh = MESHES[name]
    kernel = CompiledEngine(1).prepare(Topology.of(len(mesh.vertices), mesh.faces), PAPER)
    moved = kernel.transform(np.array(mesh.vertices), ONE_EACH, 1e-3, 0.0, measured=ALL)
    assert moved is not None
    before = kernel.shape(moved)
    with pytest.raises(ValueError, match="read-only"):
        before.centroid[0] += 1.0
    assert said(kernel.shape(moved)) == said(before)


def test_a_shape_whose_edges_are_no_number_is_not_one_without_edges():
    """Squares of such lengths are infinite: with edges the area is so too, without it is not a number."""
    mesh = icosphere(3)
    topology, V = Topology.of(len(mesh.vertices), mesh.faces), mesh.vertices * 1e160
    V.setflags(write=False)
    kernel, another = (CompiledEngine(1).prepare(topology, PAPER) for _ in range(2))
    for wanted in (ALL, Wanted(edges=False)):
        assert said(kernel.shape(V, wanted)) == said(another.shape(V.copy(), wanted))


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("name", MESHES)
def test_scaled_by_the_way_as_afterwards(name: str, threads: int, monkeypatch: pytest.MonkeyPatch):
    """To the last bit; what is measured by faces is left to whoever asks, as it came."""
    monkeypatch.setattr(compiled, "WORTH_SHARING", 1)
    monkeypatch.setattr(numbering, "WINDOW", 24)
    mesh, wanted = MESHES[name], Wanted(area=2.0)
    kernel, another = (
        CompiledEngine(t).prepare(Topology.of(len(mesh.vertices), mesh.faces), ROBUST) for t in (threads, 1)
    )
    V = np.array(mesh.vertices)
    by_the_way = kernel.transform(V, MORE, 1e-3, 0.5, measured=wanted)
    plain = another.transform(V, MORE, 1e-3, 0.5)
    assert by_the_way is not None
    assert plain is not None
    shape = another.shape(plain)
    factor = float(np.sqrt(wanted.area / shape.area))
    assert abs(factor - 1) > 0.01
    if name == "sphere":
        plain, shape = another.scaled(plain, shape.centroid, factor), shape.scaled(factor)
        assert shape.area == pytest.approx(wanted.area, rel=1e-14)
    assert said(by_the_way) == said(plain)
    assert said(kernel.shape(by_the_way, wanted)) == said(shape)
