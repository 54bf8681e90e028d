"""What a run takes above the mesh: bytes a vertex, in every phase; and nothing new within a pass."""

from __future__ import annotations

import subprocess
import sys
import tracemalloc
from collections.abc import Callable

import numpy as np
import pytest
from numba.core.runtime import _nrt_python, rtsys

from spherify.geometry.config import Stage
from spherify.geometry.kernels.compiled import WORTH_SHARING, CompiledEngine
from spherify.geometry.kernels.passes import directions, radii, spreading, unfolding
from spherify.geometry.kernels.passes.ascent import BACK, ascend
from spherify.geometry.kernels.passes.directions import see
from spherify.geometry.kernels.passes.radii import along_radii
from spherify.geometry.kernels.passes.spreading import spread
from spherify.geometry.kernels.passes.unfolding import unfold
from spherify.geometry.presets import PRESETS
from spherify.geometry.samples import SAMPLES
from spherify.geometry.topology import Topology
from spherify.geometry.unfolding import SMOOTHINGS
from tests.geometry.shapes import sample

ROBUST = PRESETS["robust"].config
MOST = 600  # bytes a vertex
EVERY_PHASE = """
import ctypes, sys; from dataclasses import replace; from pathlib import Path
import numpy as np
from spherify.geometry.flow import flow; from spherify.geometry.kernels import get_engine
from spherify.geometry.mesh import TriangleMesh
from spherify.geometry.methods.control import Control, Phase
from spherify.geometry.presets import PRESETS

def memory(which):
    return int(Path('/proc/self/status').read_text().split(which + ':')[1].split()[0]) * 1024

engine = get_engine('compiled'); engine.warm()
with np.load(sys.argv[1]) as arrays:
    mesh = TriangleMesh(arrays['vertices'], arrays['faces'])
ctypes.CDLL(None).malloc_trim(0)  # or what was freed before would be used, and not be seen
before = memory('VmRSS')
def tell(what):
    print(f"{what}: {(memory('VmHWM') - before) / len(mesh.vertices):.0f}")

states = flow(mesh, replace(PRESETS['robust'].config, iterations=10**6), engine=engine)
here = [next(states), next(states), next(states)][-1]
tell('T')
outside = here._progress.best_shape._replace(centroid=np.array([3.0, 0.0, 0.0]))
for what, phase, since, inward, least_area, shape in (
    ('looking whether it is covered once', Phase.NORMALS, 130, 0, 0.5, None),
    ('going on from the roundest state', Phase.FOLDED, 13, 0, 0.5, None),
    ('looking for a point inside', Phase.FOLDED, 13, 0, 0.5, outside),
    ('evening out', Phase.SPHERE, 13, 0, 0.5, None),
    ('unfolding', Phase.SPHERE, 20, 5, 0.5, None),
    ('spreading', Phase.SPHERE, 13, 0, 1e-8, None),
    ('smoothing', Phase.SMOOTHING, 20, 0, 0.5, None),
    ('climbing', Phase.STAR, 20, 0, 0.5, None),
):
    control = Control(0.5, 1.0, 0.5, 0, phase, 1.0, inward, least_area)
    begun = replace(here._progress, iteration=since, memory={**here._progress.memory, 'control': np.array(control)})
    begun = begun if shape is None else replace(begun, best_shape=shape)
    states = here._run.states(begun, fresh=True)
    for _ in range(3):
        state = next(states)
        state.metrics()
    assert state.iteration == since + 2
    tell(what)
"""
"""Each phase is begun where T has led to, as if the run had come to it: no mesh of that size gets there in a second."""


def test_memory_above_the_mesh_in_every_phase(tmp_path):
    """The most that the whole process ever had, connectivity, best state and what numpy takes on the way included."""
    mesh = SAMPLES["stone"].build(100_000)  # not in the process itself, which would keep room that this took
    np.savez(tmp_path / "mesh.npz", vertices=mesh.vertices, faces=mesh.faces)
    command = [sys.executable, "-c", EVERY_PHASE, str(tmp_path / "mesh.npz")]
    run = subprocess.run(command, check=True, capture_output=True, text=True)
    told = dict(line.split(": ") for line in run.stdout.splitlines())
    assert len(told) == 9
    assert all(100 < float(bytes_) < MOST for bytes_ in told.values()), told


@pytest.fixture(scope="module")
def small():
    mesh = sample("head", 1500)
    V = np.array(mesh.vertices)
    kernel = CompiledEngine().prepare(Topology.of(len(V), mesh.faces), ROBUST)
    return kernel, V, kernel.shape(V).centroid


def allocations(call: Callable[[], object]) -> int:
    """How often memory is allocated by machine code; handing over an array counts as one."""
    _nrt_python.memsys_enable_stats()
    try:
        before = rtsys.get_allocation_stats()
        call()
        return rtsys.get_allocation_stats().alloc - before.alloc
    finally:
        _nrt_python.memsys_disable_stats()


def test_no_allocation_within_the_loop(small):
    kernel, V, _ = small
    for_a_call = allocations(lambda: kernel.transform(V, Stage(1, 1, 1), 1e-6, 0.5))
    assert allocations(lambda: kernel.transform(V, Stage(1, 50, 50), 1e-6, 0.5)) == for_a_call


@pytest.mark.parametrize(
    ("entry", "arguments", "everything"),
    [
        (along_radii, (0.5, 1.0, 1e-3), radii.AHEAD + radii.STEP + radii.MEASURE + radii.EVEN),
        (unfold, (4.0, 1.0, -np.inf, (0, SMOOTHINGS), (0, 50)), unfolding.ALL),
        (spread, (50,), spreading.ALL),
        (ascend, (0.9, 0.5), 2 * BACK - 1),
        (see, (), directions.DIRECT + directions.FOLDS + directions.COVER),
    ],
)
def test_no_allocation_on_the_sphere(small, entry, arguments, everything):
    """All passes of an entry allocate as often as none of them does, whatever they are."""
    kernel, V, centre = small
    kernel.folds(V, centre)
    kernel._sphere._positions.take(V, kernel._use.moved)
    sphere, c = kernel._sphere, tuple(centre.tolist())
    handed = {
        along_radii: (sphere._use, sphere._sums[0], c),
        unfold: (sphere._mesh, sphere._use, sphere._scratch[0], sphere._of_faces, sphere._sums[0], c),
        spread: (sphere._mesh, sphere._use, sphere._sums[0], c),
        ascend: (sphere._mesh, sphere._use, sphere._scratch[0], sphere._of_faces, sphere._sums[0], c),
        see: (sphere._mesh, sphere._use, sphere._sums[0], c),
    }[entry]
    before = kernel._use.position.copy(), sphere._whole.copy()
    for_none = allocations(lambda: entry(*handed, *arguments, 0, sphere._spans[0]))
    assert allocations(lambda: entry(*handed, *arguments, everything, sphere._spans[0])) == for_none
    assert not all(map(np.array_equal, before, (kernel._use.position, sphere._whole))), "nothing was done"


@pytest.mark.parametrize("threads", [1, 2])
def test_nothing_but_the_result_is_allocated(threads):
    """Not by numpy either: what a call takes at most is what it returns."""
    mesh = sample("stone", WORTH_SHARING + 3000)
    kernel, V = (
        CompiledEngine(threads).prepare(Topology.of(len(mesh.vertices), mesh.faces), ROBUST),
        np.asfortranarray(mesh.vertices),
    )
    n, centre, stage = len(V), kernel.shape(V).centroid, Stage(1, 2, 2)
    weights, little = np.zeros(n), 60_000
    for call, numbers in (
        (lambda: kernel.transform(V, stage, 1e-4, 0.5), 3),
        (lambda: kernel.transform_radially(V, stage, 1e-4, centre), 3),
        (lambda: kernel.ahead_along_radii(V, V, centre, 0.5), 3),
        (lambda: kernel.even_out(V, centre, stage), 3),
        (lambda: kernel.unfold(V, centre, weights, exponent=4.0, damping=1.0, rounds=2), 4),
        (lambda: kernel.spread(V, centre, 2), 3),
        (lambda: kernel.ascend(V, V, centre, 0.5), 3),
        (lambda: kernel.covering(V, centre), 0),
        (lambda: kernel.folds(V, centre), 0),
        (lambda: kernel.shape(V), 0),
        (lambda: kernel.figures(V, centre), 0),
    ):
        call()  # what is loaded at the first call is no part of it
        tracemalloc.start()
        try:
            call()
            assert tracemalloc.get_traced_memory()[1] < numbers * n * 8 + little
        finally:
            tracemalloc.stop()
