"""Colours of vertices by a scalar field: the scales and the range that the web page draws with, as bytes in a file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from spherify.geometry.fields import FIELDS, FieldName
from spherify.geometry.mesh import Floats

# Control points in sRGB; service/web/src/core/colormap.ts has the same, and a test holds them together.
DIVERGING: Final = (
    (38, 74, 135),
    (84, 138, 196),
    (164, 201, 226),
    (240, 238, 233),
    (244, 190, 148),
    (218, 119, 76),
    (150, 46, 36),
)
SEQUENTIAL: Final = (
    (26, 28, 68),
    (44, 72, 122),
    (33, 121, 134),
    (56, 166, 122),
    (148, 203, 92),
    (244, 232, 112),
)
# The share of the vertices beyond either end of a scale. A limb that vanishes bends without bound: with the short tails
# of the others it would leave all the rest of a surface one colour.
TAILS: Final[dict[FieldName, float]] = {
    "curvature": 0.1,
    "distance": 0.02,
    "displacement": 0.02,
    "quality": 0.02,
}
LEAST_TAIL: Final = 0.02
SAMPLES: Final = 20_000  # values that the percentiles are taken of: every k-th vertex of a larger mesh


@dataclass(frozen=True, slots=True)
class VertexColours:
    """A colour a vertex, and what it says.

    Attributes:
        rgb: (n, 3) uint8, sRGB.
        field: what is coloured.
        low: the value at the first colour of the scale, and of everything below it.
        high: the value at the last colour, and of everything above it.

    """

    rgb: NDArray[np.uint8]
    field: FieldName
    low: float
    high: float

    @property
    def note(self) -> str:
        """Say in a line what the colours mean, as a file has no other legend."""
        return f"colour {self.field} ({FIELDS[self.field].unit}) from {self.low:.6g} to {self.high:.6g}"


def vertex_colours(field: FieldName, values: Floats) -> VertexColours:
    """Colour vertices by the values (n,) of a field at them."""
    single = values.astype(np.float32).astype(np.float64)  # what the page has of them
    diverging = FIELDS[field].diverging
    low, high = colour_range(single, diverging=diverging, tail=TAILS[field])
    return VertexColours(scale_colours(single, low, high, diverging=diverging), field, low, high)


def colour_range(values: Floats, *, diverging: bool, tail: float = LEAST_TAIL) -> tuple[float, float]:
    """Values at both ends of a scale: two percentiles, as a few slivers would else take all colours.

    Args:
        values: (n,); what is not finite does not count.
        diverging: then the range is symmetric where 0 lies within it.
        tail: the share of the values beyond either end; where all between the ends is the same, as on flat faces, at
            most LEAST_TAIL.

    """
    stride = max(1, -(-len(values) // SAMPLES))
    finite = np.sort(values[::stride][np.isfinite(values[::stride])])
    if len(finite) == 0:
        return 0.0, 1.0

    def at(share: float) -> float:
        return float(finite[int(share * (len(finite) - 1) + 0.5)])

    for share in (tail, LEAST_TAIL):
        low, high = at(share), at(1 - share)
        most = max(abs(low), abs(high))
        if diverging and low < 0 < high:
            return -most, most
        if high - low > 1e-12 * most:
            return low, high
    middle = at(0.5)  # the same everywhere: the middle of the scale
    half = abs(middle) * 1e-3 or 1.0
    return middle - half, middle + half


def scale_colours(values: Floats, low: float, high: float, *, diverging: bool) -> NDArray[np.uint8]:
    """(n, 3) uint8 sRGB of values (n,): between its control points a scale is linear; NaN has the first colour."""
    points = np.array(DIVERGING if diverging else SEQUENTIAL, np.float64)
    share = np.nan_to_num((values - low) / (high - low), nan=0.0).clip(0, 1) * (len(points) - 1)
    places = np.arange(len(points))
    channels = [np.interp(share, places, points[:, channel]) for channel in range(3)]
    rgb: NDArray[np.uint8] = np.rint(np.column_stack(channels)).astype(np.uint8)
    return rgb


def linear_light(rgb: NDArray[np.uint8]) -> NDArray[np.float32]:
    """(n, 3) linear light from 0 to 1 of sRGB bytes (IEC 61966-2-1), which glTF wants."""
    share = rgb / 255.0
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return linear.astype(np.float32)
