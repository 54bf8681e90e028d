"""Mean curvature flow, and conformalized mean curvature flow: what the transformation is compared with.

    ∂p/∂t = Δp = -2 H n_p,  H = ½ (κ_1 + κ_2) > 0 where convex: a sphere of radius r has √(r² - 4t) after the time t
    (M_t + δ L) p' = M_t p     one iteration: a step of backward Euler in the time δ, linear in p'

`mean-curvature` takes the stiffness L of the surface as it is now (Desbrun, Meyer, Schröder, Barr, "Implicit fairing
of irregular meshes", 1999); it pinches off necks and limbs in finite time, beyond which it has no meaning.
`conformal` keeps the stiffness L_0 of the start (Kazhdan, Solomon, Ben-Chen, "Can mean-curvature flow be modified to
be non-singular?", 2012), and so flows through what would be singular; long limbs it can draw out to a line.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from spherify.geometry import measures
from spherify.geometry.config import ImplicitFlowConfig
from spherify.geometry.laplacian import edge_weights, lumped_masses, stiffness_diagonal
from spherify.geometry.mesh import Floats, Ints
from spherify.geometry.methods.interface import Breakdown, Step
from spherify.geometry.metrics import Figures, figures_of
from spherify.geometry.progress import Layout, Memory, Progress
from spherify.geometry.roundness import Shape, shape_of
from spherify.geometry.sparse import SOLVER, SymmetricSolver
from spherify.geometry.topology import Topology

PLATEAU_RISE: Final = 1e-4  # a smaller rise of the best sphericity counts as none

# A triangle has pinched when its share of the area fell by this factor since the start. A ring that shrinks by
# mean curvature squares its smallness in every implicit step: it passes this bound a step or two before 1e-300.
PINCHED: Final = 1e-6
DRAWN_OUT: Final = 0.3  # of the best sphericity of a closed surface; what falls below is on its way to a line
_NAMED: Final = 6  # triangles and vertices named in a sentence


class ImplicitFlow:
    """One of the two flows on one mesh, see `spherify.geometry.methods.interface.Method`."""

    computed_by = SOLVER

    def __init__(self, topology: Topology, config: ImplicitFlowConfig) -> None:
        """Prepare it; the linear systems are set up when the flow begins."""
        self._topology = topology
        self._config = config
        n, held = topology.n_vertices, np.zeros(topology.n_vertices, dtype=np.bool_)
        if config.boundary == "fixed":
            held[topology.boundary_vertices] = True
        self._free = np.flatnonzero(~held)
        number = np.full(n, -1)
        number[self._free] = np.arange(len(self._free))
        a, b = number[topology.edges[:, 0]], number[topology.edges[:, 1]]
        self._inner = (a >= 0) & (b >= 0)
        self._solver = SymmetricSolver(len(self._free), np.stack([a, b], axis=1)[self._inner])
        self._time_step = 0.0
        self._shares = np.zeros(0)
        self._stiffness = np.zeros(0)

    @property
    def layout(self) -> Layout:
        """See `Method.layout`: the sphericity to be exceeded, and the iterations since it was."""
        return {"waiting": ((2,), np.float64)}

    def shape(self, V: Floats, *, whole: bool = False) -> Shape:
        """See `Method.shape`."""
        return shape_of(V, self._topology)

    def figures(self, V: Floats, centre: Floats) -> Figures:
        """See `Method.figures`; by numpy, which takes a fraction of what an iteration does."""
        return figures_of(V, self._topology, self._config.measure, centre)

    def scaled(self, V: Floats, centre: Floats, factor: float) -> Floats:
        """See `Method.scaled`."""
        return measures.scaled(V, centre, factor)

    def begin(self, V: Floats, shape: Shape) -> Memory:
        """See `Method.begin`: the unit of time is the area of the start."""
        self._time_step = self._config.time_step * shape.area
        self._shares = measures.face_areas(V, self._topology.faces) / shape.area
        self._stiffness = edge_weights(V, self._topology)
        return {"waiting": np.array([shape.sphericity, 0.0])}

    def step(self, progress: Progress) -> float:
        """Return √δ, the length over which one iteration smooths."""
        return float(np.sqrt(self._time_step))

    def settled(self, progress: Progress) -> bool:
        """See `Method.settled`: always."""
        del progress
        return True

    def stalled(self, progress: Progress) -> str | None:
        """See `Method.stalled`: ``patience`` iterations without a rise."""
        _, waited = progress.memory["waiting"]
        if self._config.patience == 0 or waited < self._config.patience:
            return None
        return (
            f"the best sphericity {progress.best_shape.sphericity:.6f} did not rise by {PLATEAU_RISE:g} "
            f"in {self._config.patience} iterations"
        )

    def remember(self, progress: Progress, shape: Shape, factor: float) -> Memory:
        """See `Method.remember`."""
        plateau, waited = progress.memory["waiting"]
        if shape.sphericity > plateau + PLATEAU_RISE:
            return {"waiting": np.array([shape.sphericity, 0.0])}
        return {"waiting": np.array([plateau, waited + 1])}

    def rescued(self, progress: Progress) -> None:
        """See `Method.rescued`."""

    def advance(self, progress: Progress) -> Step:
        """See `Method.advance`; what is drawn out, or pinches under ``mean-curvature``, is a `Breakdown`."""
        V, topology = progress.position, self._topology
        reached, best = progress.shape.sphericity, progress.best_shape.sphericity
        if topology.closed and reached < DRAWN_OUT * best:
            return Breakdown(f"drew the surface out: its sphericity fell from {best:.3f} to {reached:.3f}")
        masses = lumped_masses(measures.face_areas(V, topology.faces), topology)
        weights = self._stiffness if self._config.method == "conformal" else edge_weights(V, topology)
        moved = self._solved(V, masses, self._time_step * weights)
        if moved is None:
            return Breakdown(
                "led to a system of equations without a solution: part of the surface has no area"
            )
        if self._config.method == "mean-curvature":
            areas = measures.face_areas(moved, topology.faces)
            pinched = np.flatnonzero(areas / areas.sum() < PINCHED * self._shares)
            if len(pinched):
                return Breakdown(_pinch(pinched, topology.faces))
        return moved

    def _solved(self, V: Floats, masses: Floats, weights: Floats) -> Floats | None:
        """Solve (M + W) p' = M p for the vertices that move, ``weights`` (e,) being δ times those of the edges."""
        free, edges = self._free, self._topology.edges
        diagonal = masses + stiffness_diagonal(weights, self._topology)
        right = masses[:, None] * V
        if len(free) < len(V):  # what is held goes to the right side
            held = np.ones(len(V), dtype=np.bool_)
            held[free] = False
            for here, there in ((0, 1), (1, 0)):
                crossing = held[edges[:, there]]
                pull = weights[crossing, None] * V[edges[crossing, there]]
                right += measures.scatter(edges[crossing, here], pull, len(V))
        solution = self._solver.solve(diagonal[free], -weights[self._inner], right[free])
        if solution is None:
            return None
        moved = np.array(V, order="F")
        moved[free] = solution
        return moved


def _pinch(triangles: Ints, F: Ints) -> str:
    """Say which triangles pinched."""
    vertices = np.unique(F[triangles])
    return (
        f"pinched {_some('triangle', triangles)} of {len(F)}, at {_some('vertex', vertices, 'vertices')} (from 0), to "
        f"less than {PINCHED:g} of the share of the area they began with: there mean curvature flow becomes singular"
    )


def _some(one: str, numbers: Ints, several: str | None = None) -> str:
    """Name some numbers: ``triangle 7``, ``triangles 1, 2, … (9)``."""
    if len(numbers) == 1:
        return f"{one} {numbers[0]}"
    first = ", ".join(map(str, numbers[:_NAMED]))
    more = f", … ({len(numbers)} in all)" if len(numbers) > _NAMED else ""
    return f"{several or one + 's'} {first}{more}"
