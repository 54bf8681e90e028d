"""The compiled engine does what the reference does, in every mode, on every kind of mesh."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import asdict, replace
from functools import cache

import numpy as np
import pytest

from spherify.formats import read_mesh
from spherify.geometry.config import FlowConfig, Stage
from spherify.geometry.errors import InvalidConfigError
from spherify.geometry.flow import StopReason, flow
from spherify.geometry.frame import Frame
from spherify.geometry.kernels import ENGINES, get_engine
from spherify.geometry.mesh import TriangleMesh
from spherify.geometry.presets import PRESETS
from spherify.geometry.roundness import Wanted
from spherify.geometry.samples import SAMPLES
from spherify.geometry.samples.solids import icosphere
from spherify.geometry.topology import Topology
from tests.geometry.shapes import (
    ROUNDING,
    finned,
    icosahedron,
    jittered,
    octahedron,
    open_bump,
    sample,
    small_samples,
    tetrahedron,
    torus,
)
from tests.geometry.test_against_naive import MEASURES, MODES
from tests.shared import shared_mesh

PAPER, ROBUST = (PRESETS[name].config for name in ("paper", "robust"))
MESHES = {
    **small_samples(),
    **{f"{name}, 1,500": sample(name, 1500) for name in SAMPLES},
    "torus, 6,000": torus(100, 60),
    "open, 900": open_bump(30),
}
SHARED = (
    "spot.obj",
    "216Kleopatra.obj",
    "cylinder.stl",
    "sharp_sphere.off",
    "cat-low-resolution.obj",
    "sphere.3mf",
)


def both(mesh: TriangleMesh, config: FlowConfig):
    topology = Topology.of(len(mesh.vertices), mesh.faces)
    return tuple(get_engine(name).prepare(topology, config) for name in ("reference", "compiled"))


def assert_same_step(mesh: TriangleMesh, config: FlowConfig, tolerance: float = ROUNDING):
    """One elementary step each way, from the same place, and one T."""
    V = Frame.around(mesh.vertices).inside(mesh.vertices)
    reference, compiled = both(mesh, config)
    step = 0.05 * reference.shape(V).mean_edge
    for stage in (Stage(1, 1, 0), Stage(1, 0, 1)):
        expected = reference.transform(V, stage, step, config.relaxation)
        actual = compiled.transform(V, stage, step, config.relaxation)
        assert expected is not None
        assert actual is not None
        assert np.abs(expected - V).max() > 1e-6, "the mesh has to move for the comparison to mean anything"
        assert np.abs(actual - expected).max() <= tolerance * np.abs(expected).max()


@pytest.mark.parametrize("measure", MEASURES)
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", MESHES)
def test_one_step(name, mode, measure):
    assert_same_step(MESHES[name], FlowConfig(iterations=1, measure=measure, **MODES[mode]))


@pytest.mark.parametrize("name", ["open", "open, 900"])
def test_a_free_boundary(name):
    assert_same_step(MESHES[name], FlowConfig(iterations=1, boundary="free", **MODES["everything"]))


@pytest.mark.parametrize("preset", ["paper", "robust"])
@pytest.mark.parametrize("name", SHARED)
def test_real_meshes(name, preset):
    mesh = read_mesh(shared_mesh(name), name).mesh
    assert_same_step(mesh, PRESETS[preset].config)


@pytest.mark.parametrize("measure", MEASURES)
def test_a_sharp_rim(measure):
    """Its faces look against each other, for which their sines alone are those of a surface that bends little."""
    flat = sample("stone", 1500)
    V = flat.vertices - flat.vertices.mean(axis=0)
    rim = TriangleMesh(V * [1, 1, 0.02], flat.faces)
    assert_same_step(rim, FlowConfig(iterations=1, measure=measure))


@pytest.mark.parametrize("measure", MEASURES)
@pytest.mark.parametrize("frequency", [6, 20])
@pytest.mark.parametrize("seed", range(3))
def test_faces_that_lie_on_each_other(seed, frequency, measure):
    """Whether such a fold is convex, and where the normals at a vertex between them look, is not left to rounding."""
    mesh = finned(frequency, seed)
    reference, compiled = both(mesh, PAPER)
    expected, actual = (kernel.figures(mesh.vertices, np.zeros(3)) for kernel in (reference, compiled))
    assert expected.curvature_max > 20
    assert actual.curvature_max == pytest.approx(expected.curvature_max)
    assert_same_step(mesh, FlowConfig(iterations=1, measure=measure))


def test_figures_after_a_step_that_was_scaled_back():
    """What was measured before the scaling is not taken for what is after it."""
    mesh = sample("stone", 642)
    V, wanted = mesh.vertices, Wanted(edges=False, area=2.0)
    reference, compiled = both(mesh, PAPER)
    moved = compiled.transform(V, Stage(1, 2, 2), 1e-3, 0.0, measured=wanted)
    assert moved is not None
    assert compiled.shape(moved, wanted).area == pytest.approx(2.0)
    expected, actual = (kernel.figures(moved, np.zeros(3)) for kernel in (reference, compiled))
    assert actual.curvature_max == pytest.approx(expected.curvature_max)


@cache
def compiled_percentiles():
    """A pass by itself can be called by compiled code only."""
    from numba import njit

    from spherify.geometry.kernels.passes.selection import collect_part, count_part, percentiles

    @njit
    def compiled(K, window, use, cuts):
        where = (0, 0, 0, 0)
        for part in range(len(cuts) - 1):
            count_part(K, K.min(), K.max(), use, part, cuts[part], cuts[part + 1])
        for part in range(len(cuts) - 1):
            where = collect_part(K, window, use, cuts[part], cuts[part + 1])
        return percentiles(K, K.max(), window, where, use)

    return compiled


@pytest.mark.parametrize("parts", [1, 3])
@pytest.mark.parametrize("window", [(0, 100), (30, 70), (0.1, 99.9), (50, 50.001), (12.5, 87.5), (99, 100)])
@pytest.mark.parametrize("n", [4, 5, 48, 50, 600, 20_000])
@pytest.mark.parametrize("kind", ["even", "one far", "all but one equal", "few values", "tiny", "huge"])
def test_percentiles(kind, n, window, parts):
    from spherify.geometry.kernels.buffers import buffers

    rng = np.random.default_rng(n)
    K = {
        "even": lambda: rng.standard_normal(n),
        "one far": lambda: np.append(rng.standard_normal(n - 1), 1e12),
        "all but one equal": lambda: np.append(np.full(n - 1, 3.25), -1.0),
        "few values": lambda: np.append(rng.integers(0, 3, n - 1) / 3, 2.0),
        "tiny": lambda: np.append(rng.integers(0, 100, n - 1) * 5e-324, 5e-322),
        "huge": lambda: np.append(0.9e308 * rng.uniform(-1, 1, n - 1), 0.95e308),
    }[kind]()
    cuts = np.linspace(0, n, parts + 1).astype(np.uint32)
    use = buffers(n, 0, 1, parts)
    low, high = compiled_percentiles()(K, (float(window[0]), float(window[1])), use, cuts)
    with np.errstate(over="ignore"):
        assert [low, high] == list(np.percentile(K, window))


@pytest.mark.parametrize("config", [PAPER, ROBUST], ids=["by rings", "by faces"])
@pytest.mark.parametrize("name", MESHES)
def test_shape(name, config):
    mesh = MESHES[name]
    for V in (mesh.vertices, jittered(mesh, 0.01).vertices + 3.0):
        one, other = (kernel.shape(V) for kernel in both(mesh, config))
        assert other.area == pytest.approx(one.area, rel=ROUNDING)
        assert other.volume == pytest.approx(one.volume, rel=1e-10)
        assert other.mean_edge == pytest.approx(one.mean_edge, rel=ROUNDING)
        assert other.radius_variation == pytest.approx(one.radius_variation, rel=ROUNDING, abs=1e-14)
        np.testing.assert_allclose(other.centroid, one.centroid, rtol=0, atol=1e-13)


@pytest.mark.parametrize("measured", [False, True])
@pytest.mark.parametrize("amount", [0.0, 1e-4, 1e-3, 1e-2, 0.1])
def test_a_radius_variation_is_known_to_be_great_by_some_vertices(amount, measured):
    """It is never said of one that is less; and said wherever it is much greater, without looking at all of them."""
    mesh = icosphere(20)
    V = mesh.vertices * (1 + amount * np.random.default_rng(3).uniform(-1, 1, (len(mesh.vertices), 1)))
    kernel = get_engine("compiled").prepare(Topology.of(len(V), mesh.faces), PAPER)
    if measured:
        V = kernel.transform(V, Stage(1, 1, 0), 1e-9, 0.0, measured=Wanted(edges=False, variation=1e-3))
    whole = kernel.shape(V).radius_variation
    assert whole == pytest.approx(amount / 3**0.5, rel=0.1, abs=1e-6)
    for bound in (0.0, 1e-5, 0.999 * whole, 1.001 * whole, 2 * whole, 1.0):
        said = kernel.shape(V, Wanted(variation=bound)).radius_variation
        assert said == whole or (np.isnan(said) and bound <= whole)
        assert np.isnan(said) or not bound < whole / 20


@pytest.mark.parametrize("name", ["stone, 1,500", "open"])
def test_momentum(name):
    mesh = MESHES[name]
    V, previous = np.array(mesh.vertices), jittered(mesh, 0.01).vertices
    reference, compiled = both(mesh, ROBUST)
    expected = reference.transform(V, Stage(1, 1, 1), 1e-3, 0.5, previous=previous, momentum=0.7)
    actual = compiled.transform(V, Stage(1, 1, 1), 1e-3, 0.5, previous=previous, momentum=0.7)
    assert np.abs(actual - expected).max() <= ROUNDING * np.abs(expected).max()
    np.testing.assert_array_equal(
        actual, compiled.transform(V + 0.7 * (V - previous), Stage(1, 1, 1), 1e-3, 0.5)
    )


@pytest.mark.parametrize("measure", MEASURES)
@pytest.mark.parametrize("name", MESHES)
def test_figures(name, measure):
    """Also where faces look inward; which do is the same to the last one."""
    mesh, config = MESHES[name], replace(ROBUST, measure=measure)
    for V in (mesh.vertices, jittered(mesh, 0.4).vertices + 3.0):
        reference, compiled = both(mesh, config)
        centre = reference.shape(V).centroid
        one, other = asdict(reference.figures(V, centre)), asdict(compiled.figures(V, centre))
        assert other.pop("inward_faces") == one.pop("inward_faces")
        greatest = max(abs(one["curvature_min"]), abs(one["curvature_max"]))
        for of_curvature in ("curvature_min", "curvature_max"):
            assert other.pop(of_curvature) == pytest.approx(one.pop(of_curvature), abs=ROUNDING * greatest)
        assert other == pytest.approx(one, rel=ROUNDING)


@pytest.mark.parametrize("name", ["stone, 1,500", "open"])
def test_scaled(name):
    mesh = MESHES[name]
    V, centre = np.array(mesh.vertices), np.array([0.3, -0.2, 0.1])
    moved = [kernel.scaled(V, centre, 1.25) for kernel in both(mesh, ROBUST)]
    assert moved[0].tobytes(order="C") == moved[1].tobytes(order="C")
    np.testing.assert_allclose(moved[0], 1.25 * V - 0.25 * centre, rtol=0, atol=1e-15)


def test_a_mesh_without_area():
    mesh = tetrahedron()
    V = np.zeros((4, 3))
    kernels = both(mesh, ROBUST)
    one, other = (kernel.shape(V) for kernel in kernels)
    assert (other.area, other.volume, other.radius_variation) == (one.area, one.volume, one.radius_variation)
    one, other = (kernel.figures(V, np.zeros(3)) for kernel in kernels)
    assert other == one
    assert (one.inward_faces, one.least_quality, one.least_area, one.radius_ratio) == (4, 0, 0, 0)


@pytest.mark.parametrize("build", [tetrahedron, octahedron, icosahedron])
def test_constant_curvature(build):
    for kernel in both(build(), PRESETS["paper"].config):
        assert kernel.transform(np.array(build().vertices), Stage(1, 1, 1), 0.1, 0.0) is None


@pytest.mark.parametrize("measure", MEASURES)
def test_degenerate_faces(measure):
    """Faces folded to a line, to a point and onto their neighbours."""
    mesh = sample("stone", 200)
    V = np.array(mesh.vertices)
    F = mesh.faces
    V[F[0, 1]] = V[F[0, 0]]
    V[F[50]] = V[F[50]].mean(axis=0)
    V[F[90, 2]] = (V[F[90, 0]] + V[F[90, 1]]) / 2
    for mode in MODES:
        config = FlowConfig(iterations=1, measure=measure, **MODES[mode])
        reference, compiled = both(mesh, config)
        expected = reference.transform(V, Stage(1, 1, 0), 0.01, config.relaxation)
        actual = compiled.transform(V, Stage(1, 1, 0), 0.01, config.relaxation)
        assert np.isfinite(expected).all()
        assert np.abs(actual - expected).max() <= 1e-11
        found = [kernel.figures(V, np.zeros(3)).inward_faces for kernel in (reference, compiled)]
        assert found[0] == found[1] >= 3, "a face without area looks inward by either"


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e200])
@pytest.mark.parametrize("mode", ["paper", "everything"])
def test_positions_that_are_no_numbers(value, mode):
    mesh = sample("stone", 200)
    V = np.array(mesh.vertices)
    V[7, 1] = value
    config = FlowConfig(iterations=1, **MODES[mode])
    with np.errstate(all="ignore"):
        kernels = both(mesh, config)
        expected, actual = (
            kernel.transform(V, Stage(1, 2, 1), 0.01, config.relaxation) for kernel in kernels
        )
        figures = [repr(kernel.figures(V, np.zeros(3))) for kernel in kernels]
    assert figures[0] == figures[1]
    assert (actual is None) == (expected is None)
    if expected is not None:
        assert (np.isfinite(actual) == np.isfinite(expected)).all()


def test_same_bytes_twice_and_in_any_layout():
    mesh = sample("head", 1500)
    one = both(mesh, ROBUST)[1]
    other = both(mesh, ROBUST)[1]
    V = np.array(mesh.vertices)
    kept = V.copy()
    first = one.transform(V, Stage(1, 2, 2), 0.01, 0.5)
    one.transform(V * 1.1, Stage(1, 2, 2), 0.01, 0.5)
    assert (kept == V).all(), "what is handed in stays as it is"
    for again in (
        one.transform(V, Stage(1, 2, 2), 0.01, 0.5),
        other.transform(np.asfortranarray(V), Stage(1, 2, 2), 0.01, 0.5),
    ):
        assert again.tobytes(order="C") == first.tobytes(order="C")


@pytest.mark.parametrize("name", ["stone", "cube"])
def test_a_whole_run_ends_alike(name):
    """Rounding decides which way a run takes, but not where it ends."""
    mesh = sample(name, 500)
    ends = [list(flow(mesh, ROBUST, engine=engine))[-1] for engine in ("reference", "compiled")]
    assert ends[0].stop_reason in {StopReason.CONVERGED, StopReason.STALLED}
    assert ends[1].stop_reason is ends[0].stop_reason
    assert ends[1].best.sphericity == pytest.approx(ends[0].best.sphericity, abs=1e-4)


def test_a_collapse_is_the_same():
    mesh = sample("sphere-bar", 300)
    config = replace(PRESETS["paper"].config, step=0.5, iterations=200)
    one, other = (list(flow(mesh, config, engine=engine))[-1] for engine in ("reference", "compiled"))
    assert other.stop_reason is one.stop_reason is StopReason.COLLAPSED
    assert other.iteration == one.iteration


@pytest.mark.parametrize("config", [PAPER, ROBUST], ids=["paper", "robust"])
@pytest.mark.parametrize("mesh", [sample("non-convex-sphere", 252), open_bump(12)], ids=["closed", "open"])
def test_a_resumed_run_is_the_same_run(mesh, config):
    config = replace(config, iterations=24)
    states = list(flow(mesh, config, engine="compiled"))
    for at in (1, 7, 23):
        rest = list(flow(mesh, config, engine="compiled", resume=states[at].checkpoint()))
        assert [state.iteration for state in rest] == [state.iteration for state in states[at + 1 :]]
        for state, expected in zip(rest, states[at + 1 :], strict=True):
            assert state.vertices.tobytes() == expected.vertices.tobytes()
            assert state.metrics() == expected.metrics()


def test_figures_do_not_depend_on_what_lay_in_memory():
    """Memory that was another's may hold bits that trap when they are added, as a resumed run once found."""
    mesh = sample("non-convex-sphere", 252)
    kernel = get_engine("compiled").prepare(Topology.of(len(mesh.vertices), mesh.faces), PAPER)
    expected = kernel.figures(mesh.vertices, np.zeros(3))
    kernel._faces.space.sums.view(np.uint64)[:] = 0x7FF0_0000_0000_0001  # a signalling NaN
    assert kernel.figures(mesh.vertices, np.zeros(3)) == expected


def test_engines_by_name():
    assert ENGINES == ("reference", "compiled")
    assert tuple(get_engine(name).name for name in ENGINES) == ENGINES
    with pytest.raises(InvalidConfigError, match="reference, compiled"):
        get_engine("steam")


def test_numba_is_loaded_only_when_asked_for():
    code = (
        "import sys; from spherify.geometry.flow import flow; from spherify.geometry.kernels import get_engine\n"
        "assert not {'numba', 'scipy'} & set(sys.modules); get_engine('compiled'); assert 'numba' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_an_installation_that_cannot_be_written():
    """numba refuses to keep code where there is no place for it; then it is made anew, not refused."""
    code = (
        "from numba.core import caching; caching.CacheImpl._locator_classes = []\n"
        "from spherify.geometry.kernels.passes.jit import entry\n"
        "assert entry(lambda a: a + 1)(2) == 3"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
