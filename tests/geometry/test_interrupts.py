"""Signals whose handler raises, as Ctrl+C does, while machine code computes."""

from __future__ import annotations

import signal
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from spherify.geometry.config import FlowConfig, Stage
from spherify.geometry.kernels.compiled import WORTH_SHARING, CompiledEngine
from spherify.geometry.samples.solids import icosphere
from spherify.geometry.topology import Topology


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
