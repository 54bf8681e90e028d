"""Movement and the next step's curvature in one sweep: the same bytes, and nothing is looked at before it is there."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest

from spherify.geometry.config import FlowConfig, Stage
from spherify.geometry.kernels import compiled, numbering
from spherify.geometry.kernels.compiled import CompiledEngine
from spherify.geometry.kernels.numbering import Numbering
from spherify.geometry.kernels.passes import sweep as sweeps
from spherify.geometry.kernels.passes.types import BACK, ON, Connectivity, Task
from spherify.geometry.mesh import TriangleMesh
from spherify.geometry.presets import PRESETS
from spherify.geometry.topology import Topology
from tests.geometry.shapes import jittered, open_bump, pinched, sample, uneven_sphere

PAPER, ROBUST = (PRESETS[name].config for name in ("paper", "robust"))
CONFIGS = {
    "paper": PAPER,
    "bounded": replace(PAPER, step_bound=0.001, measure="dual-area"),
    "weighed": replace(PAPER, relaxation=0.5, relaxation_exponent=0.5, window=(10.0, 90.0)),
    "robust": ROBUST,
}


def lonely(mesh: TriangleMesh) -> TriangleMesh:
    """Two of a mesh, apart, with vertices between them and at the end that no face has."""
    V, alone = np.array(mesh.vertices), np.zeros((3, 3))
    n = len(V) + len(alone)
    faces = np.concatenate([mesh.faces, mesh.faces + n])
    return TriangleMesh(np.concatenate([V, alone, V + 3, alone]), faces)


MESHES = {
    "sphere": uneven_sphere(7),
    "pinched": jittered(pinched(), 0.1),
    "open": jittered(open_bump(16), 0.01),
    "lonely": lonely(uneven_sphere(4)),
    "limbs": sample("quadruped", 700),
}


def topology_of(name: str) -> Topology:
    return Topology.of(len(MESHES[name].vertices), MESHES[name].faces)


def scattered(monkeypatch: pytest.MonkeyPatch) -> None:
    """Give vertices places at random, so that neighbours are anywhere."""
    monkeypatch.setattr(
        numbering._Rings, "by_levels", lambda rings: np.random.default_rng(5).permutation(len(rings.degrees))
    )


@pytest.mark.parametrize("order", ["by levels", "at random"])
@pytest.mark.parametrize("window", [8, 64])
@pytest.mark.parametrize("config", CONFIGS)
@pytest.mark.parametrize("name", MESHES)
def test_the_same_bytes_as_one_after_the_other(
    name: str, config: str, window: int, order: str, monkeypatch: pytest.MonkeyPatch
):
    if order == "at random":
        scattered(monkeypatch)
    monkeypatch.setattr(compiled, "WORTH_SHARING", 1)
    monkeypatch.setattr(numbering, "WINDOW", window)
    settings: FlowConfig = CONFIGS[config]
    topology, V = topology_of(name), np.array(MESHES[name].vertices)

    def moved(threads: int) -> np.ndarray[Any, Any]:
        kernel = CompiledEngine(threads).prepare(topology, settings)
        assert kernel._mode.at_once == (compiled.CACHED == 0)
        once = kernel.transform(V, Stage(1, 2, 2), 1e-3, settings.relaxation)
        again = kernel.transform(once, Stage(1, 0, 1), 1e-3, settings.relaxation)
        assert again is not None
        assert np.isfinite(again).all()
        return again

    apart = moved(1)
    monkeypatch.setattr(compiled, "CACHED", 0)
    assert all((moved(threads) == apart).all() for threads in (1, 2, 4))


@pytest.mark.parametrize("order", ["by levels", "at random"])
@pytest.mark.parametrize("name", MESHES)
def test_each_run_knows_how_far_its_neighbours_reach(name: str, order: str, monkeypatch: pytest.MonkeyPatch):
    if order == "at random":
        scattered(monkeypatch)
    monkeypatch.setattr(numbering, "WINDOW", 24)
    topology = topology_of(name)
    numbered = Numbering.of(topology, np.zeros(0, dtype=np.int64))
    runs = numbered.connectivity.runs.astype(np.int64)
    neighbours = neighbours_of(topology, numbered)
    run_of = np.repeat(np.arange(len(runs)), runs[:, 1] - runs[:, 0])
    for r, run in enumerate(runs):
        before = [run_of[q] for p in range(run[1]) for q in neighbours[p]] + [r]
        behind = [run_of[q] for p in range(run[0], len(run_of)) for q in neighbours[p]] + [r]
        assert run[ON] == max(before) + 1
        assert run[BACK] == min(behind)


def neighbours_of(topology: Topology, numbered: Numbering) -> list[set[int]]:
    """Return the places of the neighbours of the vertex at each place."""
    neighbours: list[set[int]] = [set() for _ in numbered.order]
    for a, b in numbered.place[topology.edges].tolist():
        neighbours[a].add(b)
        neighbours[b].add(a)
    return neighbours


class Event(NamedTuple):
    """What happens to a vertex, and after how many meetings."""

    kind: str
    vertex: int
    phase: int


@pytest.mark.parametrize("holds", [False, True])
@pytest.mark.parametrize("relaxation", [0.0, 0.5])
@pytest.mark.parametrize("parts", [1, 2, 5])
@pytest.mark.parametrize("name", MESHES)
def test_nothing_is_looked_at_before_it_is_there(
    name: str, parts: int, relaxation: float, holds: bool, monkeypatch: pytest.MonkeyPatch
):
    """The order in Python, by what the sweep calls: neighbours in another part have moved before a meeting."""
    monkeypatch.setattr(numbering, "WINDOW", 24)
    topology = topology_of(name)
    numbered = Numbering.of(topology, np.zeros(0, dtype=np.int64))
    neighbours, mesh = neighbours_of(topology, numbered), numbered.connectivity
    of_parts = [
        events(
            mesh,
            Task(0, *part, 1, 1, 1.0, relaxation, part=number, parts=parts),
            monkeypatch,
            holds=holds,
        )
        for number, part in enumerate(numbered.parts(parts))
    ]
    n, last = len(neighbours), "relaxed" if relaxation else "moved"
    attached = {p for p in range(n) if neighbours[p]}
    when = {(one.kind, one.vertex): one.phase for own in of_parts for one in own}
    assert {vertex for kind, vertex in when if kind == "moved"} == set(range(n))
    assert attached <= {vertex for kind, vertex in when if kind == "relaxed"} or not relaxation
    assert {vertex for kind, vertex in when if kind == "seen"} == set(range(n))
    assert len(when) == sum(map(len, of_parts)), "something was done twice"
    for own in of_parts:
        done = set()
        for kind, vertex, phase in own:
            needs = {"moved": "", "relaxed": "moved", "seen": last}[kind]
            for other in neighbours[vertex] | {vertex} if needs else ():
                assert (needs, other) in done or when[needs, other] < phase
            done.add((kind, vertex))


def events(mesh: Connectivity, task: Task, monkeypatch: pytest.MonkeyPatch, *, holds: bool) -> list[Event]:
    """Return what a part's sweep does, in its order."""
    happened: list[Event] = []
    meetings = [0]

    def note(kind: str, low: int, high: int) -> None:
        happened.extend(Event(kind, p, meetings[0]) for p in range(int(low), int(high)))

    def note_runs(kind: str, first: int, last: int) -> None:
        for r in range(first, last):
            note(kind, mesh.runs[r, 0], mesh.runs[r, 1])

    def meet(*_: object) -> None:
        meetings[0] += 1

    def move(_use: object, _along: object, _weighed: bool, low: int, high: int) -> None:
        note("moved", low, high)

    def see(*arguments: Any) -> None:
        run, fetch = arguments[6:]
        note_runs("seen", run, run + 1)
        assert fetch == 0 or runs[run, 0] < fetch < runs[task.last_run - 1, 1]
        assert fetch == 0 or not holds, "all has moved"

    runs = mesh.runs.astype(np.int64)
    plain = {
        name: getattr(sweeps, name).py_func
        for name in ("sweep", "borders", "begins", "entry_of", "reach_on", "reach_back", "move_on")
    }
    others = {
        "meet": meet,
        "move": move,
        "relax": lambda _mesh, _use, _fraction, first, last: note_runs("relaxed", first, last),
        "see_run": see,
        "weigh": lambda *_: None,
        "hold": lambda *_: None,
        "begin_vertices": lambda *_: None,
        "end_vertices": lambda *_: None,
    }
    with monkeypatch.context() as patched:
        for name, function in {**plain, **others}.items():
            patched.setattr(sweeps, name, function)
        mode, use, found = (Anything() for _ in range(3))
        sweeps.sweep(mesh, use, None, mode, task, found, True, False, True, False, holds)  # type: ignore[arg-type] # Python's
    return happened


class Anything:
    """Whatever is asked for: 1."""

    def __getattr__(self, _: str) -> int:
        return 1
