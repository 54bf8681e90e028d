"""The flow: a generator of states, from the mesh as it came to the reason it ended.

    for state in flow(mesh, config):
        …

The caller decides what to keep and when to leave; nothing here knows of files, clocks or jobs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property, partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from spherify.geometry.config import Config
from spherify.geometry.errors import InvalidMeshError
from spherify.geometry.frame import Frame
from spherify.geometry.kernels import ENGINES, Engine, default_engine, get_engine
from spherify.geometry.mesh import Floats, TriangleMesh
from spherify.geometry.methods import Breakdown, Standstill, prepare
from spherify.geometry.metrics import Metrics
from spherify.geometry.progress import Progress, fingerprint_of
from spherify.geometry.quality import all_outward
from spherify.geometry.roundness import Shape, nearly_round, shape_of
from spherify.geometry.topology import Topology

VANISHED: Final = (
    2e-6  # share of the mean area below which a triangle is as good as none; with room to a millionth
)
ROUNDING: Final = 1e-15  # of the factor of a rescaling


class StopReason(StrEnum):
    """Why a run ended."""

    ITERATIONS = "iterations"  # all were done
    CONVERGED = "converged"  # below config.stop_radius_variation, and no face looks inward or has vanished
    STALLED = "stalled"  # annealed down to config.annealing.min_step; a flow: config.patience iterations without a rise
    CONSTANT_CURVATURE = "constant-curvature"  # K_max = K_min leaves t undefined: the mesh does not move
    COLLAPSED = "collapsed"  # the next state was not finite, inside out or pinched; the best is the result
    CANCELLED = "cancelled"  # the caller left; never set here
    DEADLINE = "deadline"  # the caller ran out of time; never set here


@dataclass(frozen=True, slots=True)
class Best:
    """The valid state of the highest sphericity so far.

    Attributes:
        iteration: iterations done at it.
        vertices: (n, 3) its positions, read-only.
        sphericity: its Ψ.

    """

    iteration: int
    vertices: Floats
    sphericity: float


@dataclass(frozen=True, eq=False, slots=True)
class FlowState:
    """One state of a run; it stays what it is when the run goes on.

    Attributes:
        stop_reason: set on the last state only.
        stop_detail: a sentence about it, set together with it.

    """

    _run: _Run
    _progress: Progress
    stop_reason: StopReason | None = None
    stop_detail: str | None = None

    @property
    def iteration(self) -> int:
        """Iterations done. After a collapse that of the best state, which this then is."""
        return self._progress.iteration

    @property
    def reached(self) -> int:
        """Iterations the run has done: more than ``iteration`` after a collapse, which leads back to the best state."""
        broke_at = self._progress.broke_at
        return self._progress.iteration if broke_at is None else broke_at - 1

    @property
    def vertices(self) -> Floats:
        """(n, 3) positions in the unit of the mesh, read-only, finite and not inside out."""
        return self._run.positions(self._progress.iteration, self._progress.position)

    @property
    def sphericity(self) -> float:
        """Ψ of these positions."""
        return self._progress.shape.sphericity

    @property
    def step(self) -> float:
        """C of the next iteration, a length in the unit of the mesh."""
        return self._run.method.step(self._progress) * self._run.frame.scale

    @property
    def best_iteration(self) -> int:
        """Iterations done at the best valid state so far; unlike `best` without writing its positions out."""
        return self._progress.best_iteration

    @property
    def best(self) -> Best:
        """The best valid state so far, this one included."""
        at = self._progress
        return Best(
            at.best_iteration,
            self._run.positions(at.best_iteration, at.best_position),
            at.best_shape.sphericity,
        )

    def metrics(self) -> Metrics:
        """Compute all figures of this state."""
        return self._run.metrics(self._progress)

    def checkpoint(self) -> dict[str, NDArray[Any]]:
        """Return the whole state of the run as named arrays, for ``flow(…, resume=…)``.

        ``vertices`` holds the positions in the unit of the mesh, for readers; resuming does not need it.
        """
        return {"vertices": self.vertices, **self._progress.arrays(self._run.fingerprint)}


def flow(
    mesh: TriangleMesh,
    config: Config,
    *,
    engine: Engine | str | None = None,
    resume: Mapping[str, NDArray[Any]] | None = None,
) -> Iterator[FlowState]:
    """Run a method and yield each state, the mesh as it came (iteration 0) first.

    The last state carries the reason the run ended. A run that cannot go on (``collapsed``,
    ``constant-curvature``) ends with a state that was yielded before: its best one, or its last.

    Args:
        mesh: edge-manifold and consistently oriented, outward if closed; vertices all in a face.
        config: parameters of the run.
        engine: who computes, or its name; by default the one of the checkpoint, else `default_engine`.
        resume: `FlowState.checkpoint` of a run of the same mesh, parameters (but for ``iterations``) and engine:
            the states after it follow, bit for bit those of a run that was never interrupted. Of a run that has
            ended, its last state follows once more.

    Raises:
        InvalidMeshError: at once, if the mesh is none of the above.
        InvalidCheckpointError: at once, if the checkpoint belongs to another run or is damaged.
        InvalidConfigError: at once, if there is no engine of that name, or it cannot be loaded.

    """
    if engine is None:
        engine = engine_for(mesh, config, resume)
    run = _Run(mesh, config, get_engine(engine) if isinstance(engine, str) else engine)
    if resume is None:
        return run.states(run.start, fresh=True)
    progress = Progress.restored(resume, run.fingerprint, len(mesh.vertices), run.method.layout)
    return run.states(progress, fresh=False)


def engine_for(
    mesh: TriangleMesh,
    config: Config,
    resume: Mapping[str, NDArray[Any]] | None,
    *,
    engine: str | None = None,
    threads: int = 1,
    say: Callable[[str], None] = lambda _: None,
) -> Engine:
    """Return who computes a run: whoever computed its checkpoint, so that all of it is by one.

    Args:
        mesh: of the run.
        config: of the run.
        resume: its checkpoint; None before there is one.
        engine: who computes a new run; None is `default_engine`.
        threads: it computes with, where it can.
        say: told in one line if the compiled engine cannot be loaded, or the threads cannot be had.

    Raises:
        InvalidConfigError: there is no engine of that name, or it cannot be loaded.

    """
    if resume is not None and "fingerprint" in resume:
        for name in ENGINES:
            if np.array_equal(resume["fingerprint"], fingerprint_of(mesh, config, name)):
                engine = name
    if engine == "reference":
        if threads > 1:
            say(f"the reference engine computes with one thread, not with {threads}")
        return get_engine(engine)
    return (
        default_engine(threads, say) if engine is None or resume is not None else get_engine(engine, threads)
    )


class _Run:
    """What stays the same during a run, and the rules that lead from one state to the next."""

    def __init__(self, mesh: TriangleMesh, config: Config, engine: Engine) -> None:
        self._mesh = mesh
        self._config = config
        topology = _checked_topology(mesh)
        self._closed = topology.closed
        self._rescale = config.rescale
        if not self._closed:
            # Vertices that must stay cannot be rescaled; and an open surface has no volume to restore.
            self._rescale = "none" if config.boundary == "fixed" or config.rescale == "none" else "area"
        self.frame = Frame.around(mesh.vertices)
        # Of what is round already nothing is computed, nor prepared for it, which takes ten times as long.
        already = nearly_round(self.frame.inside(mesh.vertices), np.zeros(3))  # squares overflow outside
        self.method = prepare(topology, config, engine, unit=1 / self.frame.scale, later=already)
        measure = partial(shape_of, topology=topology) if already else self.method.shape
        del topology  # which takes as much memory as what was made of it
        position = self.frame.inside(mesh.vertices)
        shape = measure(position)
        if not self._valid(shape):
            raise InvalidMeshError(
                f"the mesh encloses a volume of {shape.volume:.3g} (in its bounding box of about 1): "
                "its faces must be counter-clockwise seen from outside and enclose some volume"
            )
        self.start = Progress.first(position, shape, self.method.begin(position, shape))

    @cached_property
    def fingerprint(self) -> NDArray[np.uint8]:
        """See `fingerprint_of`; read when a checkpoint is."""
        return fingerprint_of(self._mesh, self._config, self.method.computed_by)

    def states(self, progress: Progress, *, fresh: bool) -> Iterator[FlowState]:
        """Yield states until a reason to stop is met; ``progress`` itself first if ``fresh``, or if it is the last."""
        while True:
            reason, detail = self._end(progress)
            if reason is not None:
                yield FlowState(self, progress, reason, detail)
                return
            if fresh:
                yield FlowState(self, progress)
            moved = self._advanced(progress)
            if isinstance(moved, Standstill):
                yield FlowState(self, progress, StopReason.CONSTANT_CURVATURE, moved.detail)
                return
            progress, fresh = moved, True

    def positions(self, iteration: int, U: Floats) -> Floats:
        """Return positions of the frame in the unit of the mesh; exactly the mesh's own before the first iteration."""
        return self._mesh.vertices if iteration == 0 else self.frame.outside(U)

    def metrics(self, progress: Progress) -> Metrics:
        """Return the figures of a state, in the unit of the mesh."""
        shape = progress.shape
        if math.isnan(shape.radius_variation):  # which a run did not need to know
            whole = self.method.shape(progress.position, whole=True)
            shape = shape._replace(radius_variation=whole.radius_variation)
        return Metrics.of(
            shape,
            self.method.figures(progress.position, progress.shape.centroid),
            measure=self._config.measure,
            step=self.method.step(progress),
            scale=self.frame.scale,
        )

    def _end(self, progress: Progress) -> tuple[StopReason | None, str | None]:
        """Decide whether a state is the last, and why."""
        config, shape = self._config, progress.shape
        if progress.broke_at is not None:
            return StopReason.COLLAPSED, (
                f"iteration {progress.broke_at} {progress.broke_how}; "
                f"the result is the best state, that of iteration {progress.iteration}"
            )
        equal_radii = shape.radius_variation < config.stop_radius_variation
        if equal_radii and self.method.settled(progress) and self._true(progress):
            return StopReason.CONVERGED, (
                f"the radius variation {shape.radius_variation:.2e} is below {config.stop_radius_variation:g}, "
                "and no face looks inward or has vanished"
            )
        if (stalled := self.method.stalled(progress)) is not None:
            return StopReason.STALLED, stalled
        if progress.iteration >= config.iterations:
            return StopReason.ITERATIONS, f"all {config.iterations} iterations were done"
        return None, None

    def _advanced(self, progress: Progress) -> Progress | Standstill:
        """Return the state one iteration later, or that there is none."""
        # A mesh that breaks passes through overflow; it is caught below, by what comes out.
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            moved = self.method.advance(progress)
            if isinstance(moved, Standstill):
                return moved
            if isinstance(moved, Breakdown):
                return progress.broken(moved.detail)
            shape = self.method.shape(moved)
            if not self._valid(shape) and (rescued := self.method.rescued(progress)) is not None:
                moved, shape = rescued, self.method.shape(rescued)
            if not self._valid(shape):
                return progress.broken("turned the mesh inside out or left the finite numbers")
        factor = self._rescaling(shape)
        if abs(factor - 1) > ROUNDING:  # nothing is left to do where the method has done it
            moved = self.method.scaled(moved, shape.centroid, factor)
            shape = shape.scaled(factor)
        moved.setflags(write=False)
        best = (progress.best_iteration, progress.best_position, progress.best_shape)
        if shape.sphericity > progress.best_shape.sphericity:
            best = (progress.iteration + 1, moved, shape)
        return Progress(
            progress.iteration + 1, moved, shape, self.method.remember(progress, shape, factor), *best
        )

    def _true(self, progress: Progress) -> bool:
        """Whether no face looks towards the centroid or has all but vanished, which no radius shows."""
        shape = progress.shape
        if progress.iteration == 0:  # by numpy: see the start's shape
            seen = shape.outward and shape.least_area > 2 * VANISHED
            return seen or all_outward(progress.position, self._mesh.faces, shape.centroid, VANISHED)
        figures = self.method.figures(progress.position, shape.centroid)
        return figures.inward_faces == 0 and figures.least_area >= VANISHED

    def _rescaling(self, shape: Shape) -> float:
        """Return the factor that restores the area or volume of the start."""
        if self._rescale == "area":
            return float(np.sqrt(self.start.shape.area / shape.area))
        if self._rescale == "volume":
            return float(np.cbrt(self.start.shape.volume / shape.volume))
        return 1.0

    def _valid(self, shape: Shape) -> bool:
        """Whether a state may be shown: finite, with some area and, if closed, a positive volume."""
        return shape.finite and shape.area > 0 and (shape.volume > 0 or not self._closed)


def _checked_topology(mesh: TriangleMesh) -> Topology:
    """Build the topology, and refuse meshes on which the transformation has no meaning."""
    if not len(mesh.faces):
        raise InvalidMeshError("the mesh has no faces")
    topology = Topology.of(len(mesh.vertices), mesh.faces)
    for found, what in (
        (topology.nonmanifold_edges, "edges with more than two faces"),
        (topology.misoriented_edges, "edges along which both faces run in the same direction"),
        (topology.unreferenced_vertices, "vertices in no face"),
    ):
        if len(found):
            raise InvalidMeshError(f"the mesh has {len(found)} {what}")
    return topology
