"""The compiled engine: the steps of the reference as machine code, by numba.

The same numbers up to rounding (1e-12 relative after one step), many times as quick. Curvature that is not
finite is left to the reference, so that a mesh that breaks does so in the same way by either.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cached_property, partial
from operator import call
from typing import Any, Final, NamedTuple

import numpy as np

from spherify.geometry.config import FlowConfig, Stage
from spherify.geometry.kernels.buffers import buffers, scratch
from spherify.geometry.kernels.energies import energies
from spherify.geometry.kernels.faces import Faces
from spherify.geometry.kernels.numbering import Numbering
from spherify.geometry.kernels.passes import shape
from spherify.geometry.kernels.passes.ascent import ascend
from spherify.geometry.kernels.passes.directions import see
from spherify.geometry.kernels.passes.energy import energy
from spherify.geometry.kernels.passes.fans import walk
from spherify.geometry.kernels.passes.jit import code_for, kept
from spherify.geometry.kernels.passes.levels import by_levels
from spherify.geometry.kernels.passes.merging import faces, take_level
from spherify.geometry.kernels.passes.movement import unload
from spherify.geometry.kernels.passes.narrow import find
from spherify.geometry.kernels.passes.placing import put_back, relax
from spherify.geometry.kernels.passes.quality import judge
from spherify.geometry.kernels.passes.radii import along_radii
from spherify.geometry.kernels.passes.spreading import spread
from spherify.geometry.kernels.passes.step import work
from spherify.geometry.kernels.passes.types import (
    AHEAD,
    BEYOND,
    CENTRE,
    CONSTANT,
    EXTREMES,
    HOLD,
    INTEGRATE,
    MEASURES,
    MOVE,
    NOT_FINITE,
    RADII,
    RING,
    ROWS,
    SCALE,
    VARIATION,
    VERTICES,
    Found,
    Mode,
    Task,
)
from spherify.geometry.kernels.passes.unfolding import unfold
from spherify.geometry.kernels.positions import Positions
from spherify.geometry.kernels.reference import ReferenceKernel
from spherify.geometry.kernels.sphere import OnTheSphere
from spherify.geometry.kernels.team import Team
from spherify.geometry.kernels.thinning import CompiledThinning
from spherify.geometry.mesh import Floats
from spherify.geometry.metrics import Figures
from spherify.geometry.reinsertion import drawn
from spherify.geometry.roundness import ALL, Shape, Wanted
from spherify.geometry.topology import Topology

CURVED: Final = VERTICES + EXTREMES
BY_RINGS: Final = INTEGRATE + CENTRE + RADII + VARIATION
ENTRIES: Final[Sequence[Callable[..., Any]]] = (
    walk,
    by_levels,
    work,
    shape.measure,
    judge,
    along_radii,
    unfold,
    spread,
    ascend,
    energy,
    find,
    take_level,
    faces,
    put_back,
    relax,
    unload,
    see,
)
"""All that Python calls."""
OCTAHEDRON: Final = np.array(
    [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]
)
WORTH_SHARING: Final = 8_000  # vertices; below, handing out the parts takes as long as they do

CACHED: Final = 120_000  # vertices; of more, the caches of a processor do not hold what a step goes over


class Known(NamedTuple):
    """What is known of the positions loaded, as long as they stay.

    Attributes:
        rows: whether the rows are as they are.
        curved: of their curvature and normals, if those are in the buffers.
        shape: the surface, as far as it was
        wanted: by whoever asked.

    """

    rows: bool = False
    curved: Found | None = None
    shape: Shape | None = None
    wanted: Wanted = ALL


NOTHING: Final = Known()


class CompiledKernel:
    """T on one connectivity. Not to be called by two threads at once: its buffers are shared."""

    def __init__(self, topology: Topology, config: FlowConfig, threads: int = 1) -> None:
        held = topology.boundary_vertices if config.boundary == "fixed" else np.zeros(0, dtype=np.int64)
        n = topology.n_vertices
        self._of_mesh, self._config = topology.faces, config
        self._numbering = Numbering.of(topology, held)
        self._mesh = self._numbering.connectivity
        self._team = Team(threads if n >= WORTH_SHARING else 1)
        self._parts = self._numbering.parts(self._team.threads)
        self._use = buffers(n, len(held), len(self._mesh.runs), len(self._parts))
        self._scratch = [scratch() for _ in self._parts]
        self._mode = Mode(
            measure=MEASURES[config.measure],
            window=(float(config.window[0]), float(config.window[1])),
            step_bound=float(config.step_bound),
            relaxation_exponent=float(config.relaxation_exponent),
            at_once=n > CACHED,
        )
        self._faces = Faces(self._mesh.corners, self._parts, self._team, closed=topology.closed)
        self._has_rings = bool((self._mesh.runs[:, 2] == RING).all())
        # What T does next begins with the very rings of what is measured, if nothing is done in between.
        nothing_between = config.momentum == 0 and config.rescale == "none"
        plain = config.step_bound == 0 and config.relaxation == 0
        self._goes_on = nothing_between and plain
        self._known = NOTHING
        self._positions = Positions(self._use.position, self._numbering, self._parts, self._team)
        self._previous = Positions(self._use.previous, self._numbering, self._parts, self._team)
        mesh, use, mode = self._mesh, self._use, self._mode
        self._code = code_for(work, mesh, use, self._scratch[0], mode, self._task(0))
        self._sphere = OnTheSphere(
            self._numbering,
            self._positions,
            self._load,
            self._use,
            self._scratch,
            self._faces.space.area,
            self._parts,
            self._team,
        )
        self.ahead_along_radii = self._sphere.ahead
        self.even_out = self._sphere.even_out
        self.unfold = self._sphere.unfold
        self.spread = self._sphere.spread
        self.ascend = self._sphere.ascend
        self.energies = energies
        self.thinning = CompiledThinning
        self.covering = self._sphere.covering
        self.centre_inside = self._sphere.centre_inside
        self.folds = self._sphere.folds
        self._edge_count = len(topology.edges)
        self._single = self._numbering.place[topology.edges[topology.boundary_edges]]

    @cached_property
    def _reference(self) -> ReferenceKernel:
        """What goes on where curvature is not finite, made when first needed: it takes much memory."""
        return ReferenceKernel(Topology.of(len(self._numbering.order), self._of_mesh), self._config)

    def transform(
        self,
        V: Floats,
        stage: Stage,
        step: float,
        relaxation: float,
        *,
        previous: Floats | None = None,
        momentum: float = 0.0,
        measured: Wanted | None = None,
    ) -> Floats | None:
        """See `spherify.geometry.kernels.interface.Kernel.transform`."""
        known, ahead = self._load(V), previous is not None and momentum > 0
        if previous is not None and ahead:
            self._load_previous(previous)
            known = NOTHING
        if not self._has_rings:
            measured = None
        passes = CURVED + MOVE + HOLD + (0 if known.rows else ROWS) + (AHEAD if ahead else 0)
        more: dict[str, Any] = (
            {} if measured is None else {"variation": measured.variation, "area": measured.area}
        )
        if known.curved is not None and relaxation <= 0:  # which weighs areas, that are not known
            more |= {"known": True, "K_min": known.curved.K_min, "K_max": known.curved.K_max}
        task = self._task(
            passes + (0 if measured is None else self._measuring(measured)),
            k_in=stage.k_in,
            k_out=stage.k_out,
            step=float(step),
            relaxation=float(relaxation),
            momentum=float(momentum),
            **more,
        )
        found = (
            self._together(task) if known.curved is None or known.curved.end != NOT_FINITE else known.curved
        )
        if ahead:
            self._previous.hold(V)
        if found.end == CONSTANT:
            return None
        if found.end == NOT_FINITE:
            return self._reference.transform(V, stage, step, relaxation, previous=previous, momentum=momentum)
        moved = self._positions.unloaded()
        self._known = (
            Known(rows=True) if measured is None else self._seen(found, measured, scaled=measured.area > 0)[0]
        )
        return moved

    def transform_radially(self, V: Floats, stage: Stage, step: float, centre: Floats) -> Floats | None:
        """See `spherify.geometry.kernels.interface.Kernel.transform_radially`."""
        self._load(V)
        for along in [step] * stage.k_in + [-step] * stage.k_out:
            found = self._together(self._task(ROWS + CURVED, k_in=1))
            if found.end == CONSTANT:
                return None
            if found.end == NOT_FINITE:
                return self._reference.transform_radially(V, stage, step, centre)
            self._sphere.step(centre, found.K_min, found.K_max, along)
        return self._positions.unloaded()

    def shape(self, V: Floats, wanted: Wanted = ALL) -> Shape:
        """See `spherify.geometry.kernels.interface.Kernel.shape`."""
        known = self._load(V, to_move=False)
        if known.shape is not None and known.wanted == wanted:
            return known.shape
        if self._has_rings:
            passes = self._measuring(wanted) + (0 if known.rows else ROWS)
            task = self._task(passes, variation=wanted.variation)
            self._known, shape = self._seen(self._together(task), wanted)
        else:
            self._known = Known(known.rows)  # the memory of its curvature is needed
            shape = self._shape_of(self._faces.measure(self._use.position, self._use.curvature), wanted)
            self._known = Known(known.rows, None, shape, wanted)
        return shape

    def figures(self, V: Floats, centre: Floats) -> Figures:
        """See `spherify.geometry.kernels.interface.Kernel.figures`."""
        known = self._load(V, to_move=False)
        curved = known.curved
        if curved is None:
            passes = VERTICES + (0 if known.rows else ROWS)
            curved = self._together(self._task(passes, k_in=1))
            self._known = known._replace(rows=True, curved=curved)
        if curved.end == NOT_FINITE:
            return self._reference.figures(V, centre)
        return self._faces.figures(self._use.position, centre, curved)

    def scaled(self, V: Floats, centre: Floats, factor: float) -> Floats:
        """See `spherify.geometry.kernels.interface.Kernel.scaled`."""
        self._load(V)
        cx, cy, cz = centre.tolist()
        self._together(self._task(SCALE, centre=(cx, cy, cz), factor=float(factor)))
        return self._positions.unloaded()

    def _load_previous(self, previous: Floats) -> None:
        """Load what AHEAD goes on from, and leaves as what was loaded as positions."""
        if not self._use.previous.size:
            buffer = np.empty_like(self._use.position)
            self._previous = Positions(buffer, self._numbering, self._parts, self._team)
            # The last one: an interrupt before it leaves neither.
            self._use = self._use._replace(previous=buffer)
        self._previous.load(previous)

    def _load(self, V: Floats, *, to_move: bool = True) -> Known:
        """Load positions, see `Positions.load`; return what is known of them."""
        known, self._known = self._known, NOTHING  # of what is not loaded after an interrupt, nothing
        if not self._positions.load(V, to_move=to_move):
            known = NOTHING
        if not to_move:
            self._known = known
        return known

    def _measuring(self, wanted: Wanted) -> int:
        """Return the passes that measure, along with curvature and normals if the next step begins with them."""
        return BY_RINGS + (BEYOND if self._goes_on and not wanted.edges else 0)

    def _seen(self, found: Found, wanted: Wanted, *, scaled: bool = False) -> tuple[Known, Shape]:
        """Return what is known after `_measuring`, and the shape; ``scaled``: as positions were scaled then."""
        curved, shape = None, self._shape_of(self._use.whole, wanted)
        # As `step.scale_to` does; an area that is none has no square root.
        factor = math.sqrt(wanted.area / shape.area) if scaled and shape.area > 0 else 1.0
        if factor != 1:
            shape = shape.scaled(factor)
        elif self._goes_on and not wanted.edges:
            curved = found._replace(end=NOT_FINITE) if math.isnan(found.K_min) else found
        return Known(factor == 1, curved, shape, wanted), shape

    def _shape_of(self, measured: Floats, wanted: Wanted) -> Shape:
        """Return the shape of the positions loaded from the sums of their surface."""
        area, volume, _, _, _, lengths, variation, _ = measured.tolist()
        if len(self._single):  # the sum over the faces has these once, all others twice
            position = self._use.position
            a, b = position[:, self._single[:, 0]], position[:, self._single[:, 1]]
            lengths += float(np.sqrt(((b - a) ** 2).sum(axis=0)).sum())
        mean_edge = lengths / 2 / self._edge_count if wanted.edges else math.nan
        centroid = measured[2:5].copy()
        centroid.setflags(write=False)  # for whoever asks again
        return Shape(area, volume, centroid, mean_edge, variation)

    def _task(self, passes: int, **others: Any) -> Task:  # noqa: ANN401 - the rest of a Task
        """Return a task of the first part, of no elementary step unless told otherwise."""
        return Task(passes, *self._parts[0], parts=len(self._parts), **others)

    def _together(self, task: Task) -> Found:
        """Do something, each thread its part; what they have found, which is the same."""
        mesh, use, mode = self._mesh, self._use, self._mode
        if len(self._parts) == 1:
            return Found(*self._code(mesh, use, self._scratch[0], mode, task))
        tasks = [task._replace(part=number, **part._asdict()) for number, part in enumerate(self._parts)]
        # No line of Python on the way into the machine code, where the others wait for whoever has not come.
        parts = [
            partial(self._code, mesh, use, own, mode, part)
            for own, part in zip(self._scratch, tasks, strict=True)
        ]
        return Found(*self._team.each(call, parts)[0])


class CompiledEngine:
    """Machine code; made at the first call on a machine, and kept, see `passes.jit`."""

    name = "compiled"

    def __init__(self, threads: int = 1) -> None:
        self.threads = threads

    def prepare(self, topology: Topology, config: FlowConfig) -> CompiledKernel:
        """See `spherify.geometry.kernels.interface.Engine.prepare`."""
        return CompiledKernel(topology, config, self.threads)

    @property
    def ready(self) -> bool:
        """Whether the machine code is there: made by this process, or kept by an earlier one."""
        return all(map(kept, ENTRIES))

    def warm(self) -> None:
        """Make or load the machine code, which else the first step does; see `passes.jit` for where it is kept."""
        faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
        corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 2.0]])
        kernel = self.prepare(Topology.of(4, faces), FlowConfig(iterations=1, momentum=0.5))
        kernel.transform(corners, Stage(1, 1, 0), 0.1, 0.0)
        centre = kernel.shape(corners).centroid
        self.prepare(Topology.of(4, faces[:3]), FlowConfig(iterations=1)).shape(corners)  # open: by its faces
        kernel.figures(corners, centre)
        kernel.transform_radially(corners, Stage(1, 1, 0), 0.1, centre)
        kernel.ahead_along_radii(corners, corners, centre, 0.5)
        kernel.even_out(corners, centre, Stage(1, 1, 0))
        kernel.covering(corners, centre)
        kernel.unfold(corners, centre, np.zeros(4), exponent=1.0, damping=1.0, rounds=1)
        kernel.spread(corners, centre, 1)
        kernel.ascend(corners, corners, centre, 0.0)
        kernel.energies(faces, 1.0)(corners - centre)
        drawn(np.ones((6, 3)), OCTAHEDRON, kernel.thinning)
