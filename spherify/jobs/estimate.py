"""What a job will take before it has begun: seconds, memory and room on the disk, from its size alone.

The figures are those of benchmarks/README.md on one core of a server processor, rounded up: good to a factor of two or
three on another machine, and for a run that does all its iterations. Most end before.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from spherify.geometry.config import FlowConfig, ImplicitFlowConfig

STEP_S: Final = 50e-9  # of one elementary step, a vertex: measures, normals, move
SMOOTHING_S: Final = 30e-9  # with relaxation, momentum, window and bound besides
SOLVE_S: Final = (
    10e-6  # of one iteration of an implicit flow, a vertex: assembly, factorisation, three solutions
)
FIGURES_S: Final = 20e-9  # measuring the surface once an iteration, a vertex
STATE_S: Final = 0.4e-6  # writing a state, a vertex
START_S: Final = 0.3  # a process, the connectivity
STATE_BYTES: Final = 104  # a vertex: positions, movement, the best state so far, weights
PROCESS_BYTES: Final = 200_000_000
VERTEX_BYTES: Final = 700
SOLVER_BYTES: Final = 4_000  # a vertex: the factors of a sparse matrix


@dataclass(frozen=True, slots=True)
class Estimate:
    """What a job takes at most.

    Attributes:
        seconds: of computing, once a worker has taken it.
        memory_bytes: of the process that computes.
        storage_bytes: of its kept states.

    """

    seconds: float
    memory_bytes: int
    storage_bytes: int


def estimate(
    config: FlowConfig | ImplicitFlowConfig, iterations: int, vertices: int, states: int
) -> Estimate:
    """Estimate a job of so many iterations that keeps so many states."""
    if isinstance(config, FlowConfig):
        stages = sum(stage.repeat for stage in config.schedule)
        steps = sum(stage.repeat * (stage.k_in + stage.k_out) for stage in config.schedule) / stages
        smooth = config.relaxation > 0 or config.momentum > 0
        iteration_s, more_bytes = steps * (STEP_S + smooth * SMOOTHING_S), 0
    else:
        iteration_s, more_bytes = SOLVE_S, SOLVER_BYTES
    seconds = START_S + vertices * (iterations * (iteration_s + FIGURES_S) + states * STATE_S)
    memory = PROCESS_BYTES + vertices * (VERTEX_BYTES + more_bytes)
    return Estimate(seconds, memory, states * vertices * STATE_BYTES)
