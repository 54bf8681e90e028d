"""Which engine computes, with how many threads, and from when on it can."""

from __future__ import annotations

import ast
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from spherify.geometry import measures
from spherify.geometry.config import Stage
from spherify.geometry.errors import InvalidCheckpointError, InvalidConfigError
from spherify.geometry.flow import engine_for, flow
from spherify.geometry.kernels import default_engine, get_engine
from spherify.geometry.kernels.compiled import WORTH_SHARING, CompiledEngine
from spherify.geometry.kernels.passes import jit
from spherify.geometry.presets import PRESETS
from spherify.geometry.samples.solids import icosphere
from spherify.geometry.topology import Topology
from spherify.geometry.unfolding import Unfolded
from tests.geometry.shapes import open_bump, sample

PAPER, ROBUST = (PRESETS[name].config for name in ("paper", "robust"))
WITHOUT_NUMBA = (
    "import sys; sys.modules['numba'] = None\n"  # importing it fails, as where it is not installed
)


@pytest.fixture(scope="module")
def large():
    mesh = sample("stone", WORTH_SHARING + 3000)
    return mesh, Topology.of(len(mesh.vertices), mesh.faces)


@pytest.fixture(scope="module")
def nearly_round():
    """An uneven sphere of which a patch nearly vanishes."""
    mesh = icosphere(48)
    assert len(mesh.vertices) > WORTH_SHARING
    random, V = np.random.default_rng(4), np.array(mesh.vertices)
    V += 0.2 / 48 * random.uniform(-1, 1, V.shape)
    about = np.hypot(V[:, 0], V[:, 2])
    V[:, ::2] *= np.where(V[:, 1] > 0, np.clip(about / 0.2, 0.03, 1) ** 3, 1)[:, None]
    V = measures.normalised(V) * (1 + 0.01 * random.uniform(-1, 1, (len(V), 1)))
    return Topology.of(len(V), mesh.faces), V


@pytest.mark.parametrize("exponent", [0.0, 1.0, 1.5])
@pytest.mark.parametrize("preset", ["paper", "robust"])
def test_the_same_bytes_with_any_number_of_threads(large, preset, exponent):
    mesh, topology = large
    V = np.array(mesh.vertices)
    config = replace(PRESETS[preset].config, relaxation_exponent=exponent)
    kernels = [CompiledEngine(threads).prepare(topology, config) for threads in (1, 2, 3)]
    moved = [kernel.transform(V, Stage(1, 2, 1), 1e-3, config.relaxation) for kernel in kernels]
    assert np.abs(moved[0] - V).max() > 1e-5
    shapes = [kernel.shape(moved[0]) for kernel in kernels]
    figures = [kernel.figures(moved[0], shapes[0].centroid) for kernel in kernels]
    for positions, shape, others in zip(moved[1:], shapes[1:], figures[1:], strict=True):
        assert positions.tobytes(order="C") == moved[0].tobytes(order="C")
        assert repr(shape) == repr(shapes[0])
        assert others == figures[0]


@pytest.mark.parametrize("exponent", [1.0, 1.5])
@pytest.mark.parametrize("threads", [1, 2])
def test_the_same_bytes_after_a_row_of_figures(large, threads, exponent):
    """Whose curvature the next step could begin with, but for the areas that its relaxation weighs."""
    mesh, topology = large
    config = replace(PAPER, relaxation=0.5, relaxation_exponent=exponent)
    moved = []
    for looked_at in (False, True):
        kernel = CompiledEngine(threads).prepare(topology, config)
        V = kernel.transform(np.array(mesh.vertices), Stage(1, 1, 0), 1e-3, config.relaxation)
        if looked_at:
            kernel.figures(V, np.zeros(3))
        moved.append(kernel.transform(V, Stage(1, 1, 0), 1e-3, config.relaxation))
    assert np.isfinite(moved[0]).all()
    assert moved[0].tobytes() == moved[1].tobytes()


@pytest.mark.parametrize("crumpled", [False, True])
def test_the_same_bytes_on_the_sphere(nearly_round, crumpled):
    """Whatever is done to directions and radii, moves that are cut and triangles drawn apart among it."""
    topology, V = nearly_round
    V, centre, stage = np.array(V), np.zeros(3), Stage(1, 2, 1)
    if crumpled:
        V[V[:, 2] > 0.9, :2] *= -1
    random = np.random.default_rng(5)
    previous, weights = V + 2e-4 * random.normal(size=V.shape), random.uniform(-3, 0, len(V))
    said = []
    for threads in (1, 2, 3):
        kernel = CompiledEngine(threads).prepare(topology, ROBUST)
        found = [kernel.unfold(V, centre, weights, exponent=4.0, damping=0.5, rounds=3)]
        if not crumpled:  # these are for what looks outward
            found.append(kernel.spread(V, centre, 2))
            found.append(Unfolded(kernel.ascend(V, previous, centre, 0.9), weights, 0, 0.0))
        moved = [
            kernel.transform_radially(V, stage, 1e-3, centre),
            kernel.ahead_along_radii(V, previous, centre, 0.7),
            kernel.even_out(V, centre, stage),
            *(one.positions for one in found),
        ]
        assert all(np.abs(positions - V).max() > 1e-6 for positions in moved)
        said.append(
            [
                *(positions.tobytes(order="C") for positions in moved),
                *((one.inward, one.least_area, one.log_weights.tobytes()) for one in found),
                *(kernel.covering(V, centre), kernel.folds(V, centre)),
                str(kernel.centre_inside(V, np.array([3.0, 0.0, 0.0]))),
            ]
        )
    assert all(a == b == c for a, b, c in zip(*said, strict=True))


@pytest.mark.parametrize("config", [PAPER, ROBUST], ids=["paper", "robust"])
def test_positions_that_are_still_loaded_are_only_those_seen_last(config):
    """What is asked in between changes no byte, and leaves loaded what was; nor does what is known of its curvature."""
    mesh, T, centre = sample("stone", 500), Stage(1, 1, 1), np.array([0.1, 0.0, 0.0])
    topology = Topology.of(len(mesh.vertices), mesh.faces)
    kernel, V, relaxation = (
        CompiledEngine().prepare(topology, config),
        np.array(mesh.vertices),
        config.relaxation,
    )

    def fresh():
        return CompiledEngine().prepare(topology, config)

    def assert_same(positions, expected):
        assert positions.tobytes(order="C") == expected.tobytes(order="C")

    first = kernel.transform(V, T, 1e-3, relaxation)
    assert repr(kernel.shape(first)) == repr(fresh().shape(first))
    assert repr(kernel.shape(V)) == repr(fresh().shape(V))
    assert kernel.figures(first, centre) == fresh().figures(first, centre)
    second = kernel.transform(first, T, 1e-3, relaxation)
    assert_same(second, fresh().transform(np.array(first), T, 1e-3, relaxation))
    scaled = kernel.scaled(second, centre, 1.1)
    assert kernel.figures(scaled, centre) == fresh().figures(scaled, centre)
    assert kernel.figures(second, centre) == fresh().figures(second, centre)
    assert_same(kernel.scaled(second, centre, 1.1), scaled)
    third = kernel.transform(scaled, T, 1e-3, relaxation)
    assert_same(third, fresh().transform(np.array(scaled), T, 1e-3, relaxation))
    assert_same(third, kernel.transform(scaled, T, 1e-3, relaxation))
    with pytest.raises(ValueError, match="read-only"):
        third[0] = 0.0
    kernel.shape(third)
    assert kernel.figures(scaled, centre) == fresh().figures(scaled, centre)
    assert_same(kernel.transform(third, T, 1e-3, relaxation), fresh().transform(third, T, 1e-3, relaxation))


def test_momentum_goes_on_from_what_was_moved_last():
    """Positions of the iteration before are kept, and loaded where they are others."""
    mesh, T = sample("stone", 500), Stage(1, 1, 1)
    topology = Topology.of(len(mesh.vertices), mesh.faces)
    kernel, states = CompiledEngine().prepare(topology, ROBUST), [np.array(mesh.vertices)] * 2
    for momentum in (0.0, 0.25, 0.4, 0.0, 0.25, 0.4):
        previous, here = states[-2:]
        states.append(kernel.transform(here, T, 1e-3, 0.5, previous=previous, momentum=momentum))
        fresh = CompiledEngine().prepare(topology, ROBUST)
        expected = fresh.transform(here.copy(), T, 1e-3, 0.5, previous=previous.copy(), momentum=momentum)
        assert states[-1].tobytes(order="C") == expected.tobytes(order="C")


def test_positions_that_are_written_to_are_loaded_again():
    mesh = sample("stone", 500)
    kernel = CompiledEngine().prepare(Topology.of(len(mesh.vertices), mesh.faces), ROBUST)
    V = np.array(mesh.vertices)
    seen = V.view()
    seen.setflags(write=False)
    for positions in (V, seen):
        before = kernel.shape(positions).area
        V *= 2
        assert kernel.shape(positions).area == pytest.approx(4 * before)


def test_threads_on_an_open_mesh_that_is_held():
    mesh = open_bump(160)
    assert len(mesh.vertices) > WORTH_SHARING
    topology = Topology.of(len(mesh.vertices), mesh.faces)
    V = np.array(mesh.vertices)
    one, two = (
        CompiledEngine(t).prepare(topology, ROBUST).transform(V, Stage(1, 1, 1), 1e-4, 0.5) for t in (1, 2)
    )
    assert (one == two).all()
    assert (one[topology.boundary_vertices] == V[topology.boundary_vertices]).all()


def test_the_end_is_the_same_with_threads(large):
    mesh, topology = large
    V = np.array(mesh.vertices)
    V[7, 1] = np.nan
    kernels = [CompiledEngine(threads).prepare(topology, ROBUST) for threads in (1, 2)]
    with np.errstate(all="ignore"):
        one, two = (kernel.transform(V, Stage(1, 1, 1), 1e-3, 0.5) for kernel in kernels)
    assert np.array_equal(one, two, equal_nan=True)


def test_compiled_is_the_default():
    assert default_engine().name == "compiled"
    mesh, config = sample("stone", 200), replace(ROBUST, iterations=2)
    by_default = list(flow(mesh, config))[-1].vertices
    assert (by_default == list(flow(mesh, config, engine="compiled"))[-1].vertices).all()


def test_where_numba_cannot_be_loaded():
    code = (
        WITHOUT_NUMBA + "from spherify.geometry.kernels import default_engine, get_engine\n"
        "said = []\n"
        "assert default_engine(2, said.append).name == 'reference'\n"
        "assert len(said) == 1 and 'numba' in said[0] and '\\n' not in said[0], said\n"
        "from spherify.geometry.errors import InvalidConfigError\n"
        "try: get_engine('compiled')\n"
        "except InvalidConfigError as e: assert 'numba' in str(e)\n"
        "else: raise SystemExit('not refused')"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_reference_has_one_thread():
    with pytest.raises(InvalidConfigError, match="one thread"):
        get_engine("reference", threads=2)
    said = []
    engine_for(sample("stone", 200), ROBUST, None, engine="reference", threads=2, say=said.append)
    assert said == ["the reference engine computes with one thread, not with 2"]


@pytest.mark.parametrize("engine", ["reference", "compiled"])
def test_a_run_stays_with_the_engine_that_began_it(engine):
    mesh, config = sample("stone", 200), replace(ROBUST, iterations=6)
    states = list(flow(mesh, config, engine=engine))
    checkpoint = states[2].checkpoint()
    assert engine_for(mesh, config, checkpoint).name == engine
    for asked in ("reference", "compiled", None):
        chosen = engine_for(mesh, config, checkpoint, engine=asked)
        assert chosen.name == engine, "what is begun decides, not what is asked for"
    rest = list(flow(mesh, config, resume=checkpoint))
    assert rest[-1].vertices.tobytes() == states[-1].vertices.tobytes()


def test_a_new_run_is_by_whoever_is_asked():
    mesh, config = sample("stone", 200), replace(ROBUST, iterations=6)
    assert engine_for(mesh, config, None, engine="reference").name == "reference"
    assert engine_for(mesh, config, None, engine="compiled", threads=2).threads == 2


def test_a_run_of_the_compiled_engine_is_not_gone_on_with_by_the_other():
    """As on a worker without numba: the checkpoint is refused, and the run begun anew."""
    mesh, config = sample("stone", 200), replace(ROBUST, iterations=6)
    checkpoint = list(flow(mesh, config, engine="compiled"))[2].checkpoint()
    with pytest.raises(InvalidCheckpointError, match="another engine"):
        flow(mesh, config, engine="reference", resume=checkpoint)


def test_machine_code_is_made_once(tmp_path):
    """Warmed in one process, at hand in the next, where the folder can be written and where it cannot be any more."""
    code = (
        "import sys; from spherify.geometry.kernels.passes.jit import entry, kept\n"
        "from spherify.geometry.kernels.passes import fans\n"
        "print(kept(fans.walk)); import numpy as np\n"
        "from spherify.geometry.kernels.numbering import Numbering\n"
        "from spherify.geometry.topology import Topology\n"
        "Numbering.of(Topology.of(4, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])), np.zeros(0, dtype=int))\n"
        "print(kept(fans.walk), sum(fans.walk.stats.cache_hits.values()), sum(fans.walk.stats.cache_misses.values()))"
    )

    def said() -> list[str]:
        run = subprocess.run(
            [sys.executable, "-c", code],
            env={"NUMBA_CACHE_DIR": str(tmp_path), "PATH": "/usr/bin"},
            check=True,
            capture_output=True,
            text=True,
        )
        return run.stdout.split()

    assert said() == ["False", "True", "0", "1"]
    assert said() == ["True", "True", "1", "0"]
    tmp_path.chmod(0o500)
    assert said() == ["True", "True", "1", "0"]
    tmp_path.chmod(0o700)


def test_nothing_is_compiled_in_a_run_once_warm():
    """Not even what comes late, the unfolding: in a container there would be no place to keep it."""
    code = (
        "from dataclasses import replace; from spherify.geometry.flow import flow\n"
        "from spherify.geometry.kernels.compiled import ENTRIES, CompiledEngine\n"
        "from spherify.geometry.presets import PRESETS; from spherify.geometry.samples import SAMPLES\n"
        "engine = CompiledEngine(); engine.warm(); assert engine.ready\n"
        "warm = [entry.signatures for entry in ENTRIES]; assert all(map(len, warm)), warm\n"
        "config = replace(PRESETS['robust'].config, iterations=40)\n"
        "*_, last = flow(SAMPLES['quadruped'].build(1000), config, engine=engine)\n"
        "assert last.checkpoint()['log_weights'].any(), 'the unfolding did not begin'\n"
        "assert [entry.signatures for entry in ENTRIES] == warm"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_kept_code_is_loaded_without_what_compiles():
    """numba's implementations of everything, with scipy's linear algebra: as long to import as a small mesh takes."""
    get_engine("compiled").warm()
    code = (
        "import sys; from spherify.geometry.kernels.compiled import ENTRIES, CompiledEngine\n"
        "CompiledEngine().warm(); assert all(entry.signatures for entry in ENTRIES)\n"
        "assert not {'numba.np.arraymath', 'scipy.linalg'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_other_sources_are_other_machine_code():
    """Every file whose constants the passes take counts among their sources."""
    taken = set()
    for path in (jit.GEOMETRY / "kernels" / "passes").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("spherify."):
                taken.add(node.module)
    outside = {name for name in taken if not name.startswith("spherify.geometry.kernels.passes.")}
    assert outside == {f"spherify.geometry.{name.removesuffix('.py')}" for name in jit.CONSTANTS_OF}
