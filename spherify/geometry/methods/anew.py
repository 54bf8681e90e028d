"""From where directions are set anew, and the centre that a run ends about."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from spherify.geometry.kernels import Kernel
from spherify.geometry.mesh import Floats, Ints
from spherify.geometry.reinsertion import reinserted

NEARER: Final = (1.0, 0.5, 0.25, 0.1, 0.03, 0.01)  # shares of the way to the centroid that are tried


def set_anew(kernel: Kernel, F: Ints, starts: Iterable[Floats], centre: Floats) -> Floats | None:
    """Return (n, 3) what directions set anew lead to from the first of some states; None if from none.

    Args:
        kernel: of the mesh.
        F: (m, 3) its faces.
        starts: (n, 3) positions each; first are tried those that cover the sphere once, with few faces inward.
        centre: (3,) that directions are from.

    """

    def astray(V: Floats) -> tuple[bool, int]:
        return kernel.covering(V, centre).degree != 1, kernel.folds(V, centre)[0]

    different = {id(V): V for V in starts}.values()
    found = (reinserted(V, F, centre, kernel.energies) for V in sorted(different, key=astray))
    return next((V for V in found if V is not None), None)


def nearer(kernel: Kernel, V: Floats, centre: Floats, centroid: Floats) -> Floats:
    """Return the centroid (3,), a point on the way there or the centre, the first without faces of V (n, 3) inward."""
    points = (centre + share * (centroid - centre) for share in NEARER)
    return next((point for point in points if not kernel.figures(V, point).inward_faces), centre)
