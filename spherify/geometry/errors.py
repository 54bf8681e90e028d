"""Errors of the mathematics.

GeometryError
├── InvalidMeshError     arrays that are no triangle mesh
├── InvalidConfigError   a parameter outside its range, or two that contradict each other
└── InvalidCheckpointError  a checkpoint of another mesh, another configuration, or damaged
"""


class GeometryError(ValueError):
    """Something the mathematics cannot work on."""


class InvalidMeshError(GeometryError):
    """The arrays are no triangle mesh."""


class InvalidConfigError(GeometryError):
    """A parameter is outside its range."""


class InvalidCheckpointError(GeometryError):
    """The checkpoint belongs to another run, or is damaged."""
