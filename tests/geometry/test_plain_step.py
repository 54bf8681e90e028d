"""What the benchmarks call plain numpy does what `paper` does."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.plain_step import PlainStep
from spherify.geometry.config import Stage
from spherify.geometry.kernels import get_engine
from spherify.geometry.presets import PRESETS
from spherify.geometry.samples import SAMPLES
from spherify.geometry.topology import Topology


@pytest.mark.parametrize("outward", [False, True])
def test_it_is_a_step_of_the_reference_engine(outward: bool) -> None:
    mesh = SAMPLES["head"].build(600)
    topology = Topology.of(len(mesh.vertices), mesh.faces)
    kernel = get_engine("reference").prepare(topology, PRESETS["paper"].config)
    expected = kernel.transform(mesh.vertices, Stage(1, int(not outward), int(outward)), 0.01, 0.0)
    assert expected is not None
    found = PlainStep(mesh)(mesh.vertices, 0.01, outward=outward)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)
    assert np.abs(expected - mesh.vertices).max() > 1e-3
