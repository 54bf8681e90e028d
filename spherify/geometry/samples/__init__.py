"""The shapes of the paper's pictures, built at any resolution: closed, genus 0, outward, well-shaped triangles."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Final

from spherify.geometry.mesh import TriangleMesh
from spherify.geometry.samples import creatures
from spherify.geometry.samples.implicit import surface
from spherify.geometry.samples.solids import cube, cylinder, non_convex_sphere, stone


@dataclass(frozen=True, slots=True)
class Sample:
    """A shape with a name.

    Attributes:
        name: what it is asked for by.
        title: what it is.
        build: from a number of vertices to aim at to the mesh; it comes close, and is never coarser than the shape
            needs to stay closed and of genus 0. Same number, same mesh.

    """

    name: str
    title: str
    build: Callable[[int], TriangleMesh]


SAMPLES: Final[Mapping[str, Sample]] = {
    sample.name: sample
    for sample in (
        Sample("stone", "A weathered stone", stone),
        Sample("quadruped", "A cat-like animal, for the paper's puma", partial(surface, creatures.quadruped)),
        Sample("sphere-bar", "Two balls joined by a bar", partial(surface, creatures.sphere_bar)),
        Sample("cube", "A cube", cube),
        Sample("cylinder", "A cylinder with flat ends", cylinder),
        Sample("non-convex-sphere", "A sphere with bumps and dents", non_convex_sphere),
        Sample("head", "A head with a face, ears and a neck", partial(surface, creatures.head)),
    )
}
