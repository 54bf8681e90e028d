"""Signals whose handler raises, as Ctrl+C does: while machine code computes, and anywhere on the way to and from it."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from functools import cache, partial
from types import FrameType
from typing import Any

import numpy as np
import pytest

from spherify.geometry.config import FlowConfig, Stage
from spherify.geometry.kernels import compiled, numbering
from spherify.geometry.kernels.compiled import WORTH_SHARING, CompiledEngine, CompiledKernel
from spherify.geometry.mesh import Floats
from spherify.geometry.presets import PRESETS
from spherify.geometry.roundness import Wanted
from spherify.geometry.samples.solids import icosphere
from spherify.geometry.topology import Topology
from tests.geometry.shapes import jittered, open_bump, uneven_sphere


@pytest.fixture
def interrupted():
    """Have the timer of the process raise."""

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, stop)
    yield
    signal.setitimer(signal.ITIMER_REAL, 0)
    signal.signal(signal.SIGALRM, before)


def until_interrupted(do: Callable[[], object], microseconds: int) -> None:
    """Do something again and again until the timer says that so much time has passed.

    It says so again a second later: what is raised within a callback of the garbage collector, as libraries for tests
    have one, Python lets go.
    """
    signal.setitimer(signal.ITIMER_REAL, microseconds * 1e-6, 1.0)
    try:
        while True:
            do()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


@pytest.mark.usefixtures("interrupted")
@pytest.mark.parametrize("threads", [1, 2, 3])
def test_an_interrupt_gets_through_and_leaves_a_kernel_that_works(threads):
    """It comes at another moment each time: on the way into the passes, within them, and behind them."""
    mesh, stage = icosphere(30), Stage(1, 1, 1)
    assert len(mesh.vertices) > WORTH_SHARING
    kernel = CompiledEngine(threads).prepare(
        Topology.of(len(mesh.vertices), mesh.faces), FlowConfig(iterations=1)
    )
    start = mesh.vertices * [1.0, 1.2, 0.9]
    moved = kernel.transform(start, stage, 0.01, 0.0)
    for microseconds in range(100, 2500, 20):
        with pytest.raises(KeyboardInterrupt):
            until_interrupted(partial(kernel.transform, start, stage, 0.01, 0.0), microseconds)
    again = kernel.transform(start, stage, 0.01, 0.0)
    assert moved is not None
    assert again is not None
    np.testing.assert_array_equal(again, moved)


Question = Callable[[CompiledKernel, Floats, Floats], Any]
ENDS, SCALED = Wanted(edges=False, variation=0.05), Wanted(area=2.0)
CENTRE, ONE_EACH = np.array([0.02, -0.01, 0.03]), Stage(1, 1, 0)
QUESTIONS: dict[str, Question] = {  # of positions and those before
    "shape": lambda kernel, V, _: kernel.shape(V),
    "shape without edges": lambda kernel, V, _: kernel.shape(V, ENDS),
    "figures": lambda kernel, V, _: kernel.figures(V, CENTRE),
    "T": lambda kernel, V, _: kernel.transform(V, ONE_EACH, 1e-3, 0.0, measured=ENDS),
    "momentum": lambda kernel, V, W: kernel.transform(
        V, ONE_EACH, 1e-3, 0.0, previous=W, momentum=0.5, measured=SCALED
    ),
}
MESHES = {"closed": uneven_sphere(2), "open": jittered(open_bump(4), 0.01)}  # which is measured by its faces
# What hands out parts is left out: handlers of signals run at some of its places only, and it counts on that.
FILES = ("compiled.py", "positions.py", "faces.py")


class Interrupt:
    """A tracer that interrupts a kernel's Python before an instruction, which it counts from 1."""

    def __init__(self, instruction: int) -> None:
        self.left = instruction

    def __call__(self, frame: FrameType, event: str, _: object) -> Interrupt | None:
        if not frame.f_code.co_filename.endswith(FILES) or "kernels" not in frame.f_code.co_filename:
            return None
        frame.f_trace_opcodes = True
        self.left -= event == "opcode"
        if event == "opcode" and self.left == 0:
            raise KeyboardInterrupt
        return self


def is_interrupted(do: Callable[[], object], instruction: int) -> bool:
    """Do something until that instruction, if it comes so far."""
    before = sys.gettrace()
    sys.settrace(Interrupt(instruction))
    try:
        do()
    except KeyboardInterrupt:
        return True
    finally:
        sys.settrace(before)
    return False


def said(answer: object) -> object:
    """Return an answer to the last bit."""
    return answer.tobytes(order="C") if isinstance(answer, np.ndarray) else repr(answer)


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("question", QUESTIONS)
@pytest.mark.parametrize("name", MESHES)
def test_nothing_is_known_of_what_an_interrupt_has_left(
    name: str, question: str, threads: int, monkeypatch: pytest.MonkeyPatch
):
    """Wherever it comes, with the same positions as before or others: a new one would say the same next."""
    monkeypatch.setattr(compiled, "WORTH_SHARING", 1)
    monkeypatch.setattr(numbering, "WINDOW", 8)
    mesh = MESHES[name]
    topology = Topology.of(len(mesh.vertices), mesh.faces)
    positions = [np.array(mesh.vertices), mesh.vertices * [1.0, 1.2, 0.9]]
    for V in positions:
        V.setflags(write=False)

    def prepared() -> CompiledKernel:
        return CompiledEngine(threads).prepare(topology, PRESETS["paper"].config)

    @cache
    def expected(asked: str, which: int) -> object:
        return said(QUESTIONS[asked](prepared(), positions[which], positions[1 - which]))

    kernel, asked_next = prepared(), ("T", "shape without edges", "figures", "shape")
    for which in (1, 0):
        V, W = positions[which], positions[1 - which]
        instruction = 1
        while is_interrupted(partial(QUESTIONS[question], kernel, V, W), instruction):
            asked = asked_next[instruction % len(asked_next)]
            for one in (which, 1 - which):
                assert said(QUESTIONS[asked](kernel, positions[one], positions[1 - one])) == expected(
                    asked, one
                )
            kernel.figures(positions[0], CENTRE)
            instruction += threads  # not each one again, for time
        assert instruction > 100
