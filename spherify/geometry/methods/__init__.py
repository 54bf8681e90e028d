"""Methods that morph a surface, behind one interface: the curvature transformation, and flows to compare it with."""

from __future__ import annotations

from spherify.geometry.config import Config, FlowConfig
from spherify.geometry.kernels import Engine
from spherify.geometry.methods.curvature import CurvatureTransformation
from spherify.geometry.methods.interface import Breakdown, Method, Standstill, Step
from spherify.geometry.topology import Topology

__all__ = ["Breakdown", "Method", "Standstill", "Step", "prepare"]


def prepare(topology: Topology, config: Config, engine: Engine, *, unit: float, later: bool) -> Method:
    """Prepare the method a configuration is of.

    Args:
        topology: of the mesh.
        config: parameters.
        engine: who computes the transformation; the flows have one engine only.
        unit: the length of the mesh's own unit in the run's frame.
        later: whether to leave what takes long until it is needed, if it ever is; the topology is kept until then.

    """
    if isinstance(config, FlowConfig):
        return CurvatureTransformation(topology, config, engine, unit=unit, later=later)
    # Loads scipy's solvers, which take longer than a small mesh does: only when they are asked for.
    from spherify.geometry.methods.implicit import ImplicitFlow  # noqa: PLC0415

    return ImplicitFlow(topology, config)
