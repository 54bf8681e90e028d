"""One flow on one mesh: how round it ends, how soon, and at what cost to the triangles.

Only the flow's own processor time is charged: neither what is measured here, nor machine code being made.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final
from unittest.mock import patch

import numpy as np
from lapy import TriaMesh  # type: ignore[import-untyped] # LaPy has no types
from lapy.diffgeo import tria_mean_curvature_flow  # type: ignore[import-untyped]
from scipy.sparse.linalg import MatrixRankWarning

from spherify.geometry import measures
from spherify.geometry.flow import flow
from spherify.geometry.kernels import Engine
from spherify.geometry.mesh import Floats, TriangleMesh
from spherify.geometry.metrics import metrics_of
from spherify.geometry.presets import PRESETS
from spherify.geometry.roundness import sphericity
from spherify.geometry.topology import Topology

LAPY: Final = "lapy"
LAPY_STEPS: Final = 30  # its default
MARKS: Final = (0.99, 0.999)  # sphericities whose time is noted
OUT_OF_TIME: Final = "time limit"
_ROUNDEST: Final = (
    1 + 1e-9
)  # no surface is rounder than a sphere; one drawn out to a line may seem so, by rounding

Watcher = Callable[[int, float], None]  # told the iterations done, and the sphericity there


@dataclass(frozen=True, slots=True)
class Run:
    """One flow on one mesh.

    Attributes:
        mesh: its name.
        flow: name of the preset, or LAPY.
        vertices: number of them.
        faces: number of them.
        sphericity: Ψ at the end.
        radius_variation: area-weighted standard deviation of |p - c| over its mean, at the end.
        inward_faces: number that look towards the centroid or have no area, at the end.
        least_area: of a triangle, over their mean, at the end.
        least_quality: least 4√3·A/Σl², at the end.
        iterations: done; after a collapse the end is the best state, which is an earlier one.
        seconds: of processor time.
        seconds_to: seconds to each of MARKS; None where it was not reached.
        ended: why.

    """

    mesh: str
    flow: str
    vertices: int
    faces: int
    sphericity: float
    radius_variation: float
    inward_faces: int
    least_area: float
    least_quality: float
    iterations: int
    seconds: float
    seconds_to: dict[float, float | None]
    ended: str

    @property
    def true_sphere(self) -> bool:
        """Ψ ≥ 0.995, at most one face in a thousand inward, and no triangle below a millionth of the mean area."""
        return (
            self.sphericity >= 0.995 and self.inward_faces <= 0.001 * self.faces and self.least_area >= 1e-6
        )


@dataclass(slots=True)
class Clock:
    """Processor time between each start and stop, and when each mark was passed.

    Attributes:
        limit: seconds a flow may take.
        watch: told after each iteration, while the clock stands.
        seconds: so far.
        seconds_to: those at which each of MARKS was passed; None before.

    """

    limit: float
    watch: Watcher
    seconds: float = 0.0
    seconds_to: dict[float, float | None] = field(default_factory=lambda: dict.fromkeys(MARKS))
    _began: float = 0.0

    def start(self) -> None:
        """Go on."""
        self._began = time.process_time()

    def stop(self) -> None:
        """Charge what passed since it went on."""
        self.seconds += time.process_time() - self._began

    def note(self, iterations: int, reached: float) -> bool:
        """Note the marks that this sphericity is the first to pass; return whether there is time left."""
        for mark, at in self.seconds_to.items():
            if at is None and reached >= mark:
                self.seconds_to[mark] = self.seconds
        self.watch(iterations, reached)
        return self.seconds <= self.limit


def run(
    name: str, mesh: TriangleMesh, flow_name: str, engine: Engine, *, limit: float, watch: Watcher
) -> Run:
    """Run one flow until it ends, or for ``limit`` seconds of its own processor time.

    Args:
        name: of the mesh.
        mesh: closed.
        flow_name: a preset, or LAPY.
        engine: that computes the curvature transformation.
        limit: looked at between iterations.
        watch: told after each iteration, at nobody's charge.

    """
    clock = Clock(limit, watch)
    if flow_name == LAPY:
        V, iterations, ended = _lapy(mesh, clock)
    else:
        V, iterations, ended = _preset(mesh, flow_name, engine, clock)
    topology = Topology.of(len(V), mesh.faces)
    found = metrics_of(V, topology, measure="dual-area", step=0.0)
    areas = measures.face_areas(V, mesh.faces)
    return Run(
        mesh=name,
        flow=flow_name,
        vertices=len(V),
        faces=len(mesh.faces),
        sphericity=found.sphericity,
        radius_variation=found.radius_variation,
        inward_faces=found.inward_faces,
        least_area=float(areas.min() / areas.mean()),
        least_quality=found.least_quality,
        iterations=iterations,
        seconds=clock.seconds,
        seconds_to=clock.seconds_to,
        ended=ended,
    )


def _preset(mesh: TriangleMesh, preset: str, engine: Engine, clock: Clock) -> tuple[Floats, int, str]:
    """Return where one of our presets ends, after how many iterations, and why."""
    clock.start()
    states = flow(mesh, PRESETS[preset].config, engine=engine)
    while True:
        state = next(states)
        clock.stop()
        in_time = clock.note(state.reached, state.sphericity)
        if state.stop_reason is not None:
            return state.vertices, state.reached, state.stop_reason.value
        if not in_time:
            return state.vertices, state.reached, OUT_OF_TIME
        clock.start()


class _StoppedError(Exception):
    """Leaves LaPy's loop, which has no other way out."""


class _Looker:
    """Stands in for `TriaMesh.normalize_`, which LaPy calls before the first step and after each, to look there."""

    def __init__(self, mesh: TriangleMesh, clock: Clock) -> None:
        self.positions: Floats = mesh.vertices  # the last that were a surface
        self.steps = -1
        self._faces = mesh.faces
        self._clock = clock
        self._normalise = TriaMesh.normalize_

    def look(self, surface: TriaMesh) -> None:
        """Normalise on the clock, measure off it."""
        self._normalise(surface)
        self._clock.stop()
        V: Floats = surface.v
        areas = measures.face_areas(V, self._faces)
        centroid = measures.area_centroid(V, self._faces, areas)
        reached = sphericity(float(areas.sum()), measures.volume(V, self._faces, centroid))
        if not reached <= _ROUNDEST:  # of what is not finite too
            raise _StoppedError("collapsed")
        self.positions, self.steps = V, self.steps + 1
        if not self._clock.note(self.steps, reached):
            raise _StoppedError(OUT_OF_TIME)
        self._clock.start()


def _lapy(mesh: TriangleMesh, clock: Clock) -> tuple[Floats, int, str]:
    """Return the same of LaPy's flow, with its defaults. What it makes of the connectivity before is not charged."""
    surface = TriaMesh(np.array(mesh.vertices), np.array(mesh.faces))
    looker = _Looker(mesh, clock)

    def look(surface: TriaMesh) -> None:  # a function, so that it becomes a method
        looker.look(surface)

    with warnings.catch_warnings(), patch.object(TriaMesh, "normalize_", look):
        warnings.simplefilter("ignore", MatrixRankWarning)  # told by what comes out, which is not finite
        clock.start()
        try:
            tria_mean_curvature_flow(surface, max_iter=LAPY_STEPS)
        except _StoppedError as stopped:
            return looker.positions, looker.steps, str(stopped)
        clock.stop()
    return looker.positions, looker.steps, "converged" if looker.steps < LAPY_STEPS else "iterations"
