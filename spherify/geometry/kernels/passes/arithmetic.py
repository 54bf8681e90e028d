"""Square roots and angles that vectorise, from operations that round the same on every machine.

`fma` is one rounding, in hardware or not, so that nothing depends on what a compiler may contract.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, cast

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from spherify.geometry.kernels.passes.jit import inner

# The first guess of 1/√x: half the exponent, negated. The constant is Lomont's, "Fast inverse square root" (2003),
# for doubles; the guess is within 3.5 %.
GUESS = np.int64(0x5FE6EB50C7B537A9)
TAN_EIGHTH = math.sqrt(2) - 1  # tan(π/8)
HALF_PI = math.pi / 2
QUARTER_PI = math.pi / 4


def _fma(_context: Any, _a: Any, _b: Any, _c: Any) -> Any:  # noqa: ANN401 - numba's own types
    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401 - as above
        return builder.fma(*arguments)

    return types.float64(types.float64, types.float64, types.float64), generate


def _bits_of(_context: Any, _number: Any) -> Any:  # noqa: ANN401 - numba's own types
    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401 - as above
        return builder.bitcast(arguments[0], ir.IntType(64))

    return types.int64(types.float64), generate


def _from_bits(_context: Any, _bits: Any) -> Any:  # noqa: ANN401 - numba's own types
    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401 - as above
        return builder.bitcast(arguments[0], ir.DoubleType())

    return types.float64(types.int64), generate


fma = cast(Callable[[float, float, float], float], intrinsic(_fma))
"""a·b + c, rounded once."""
bits_of = cast(Callable[[float], np.int64], intrinsic(_bits_of))
"""The bits of a double, read as an integer."""
from_bits = cast(Callable[[np.int64], float], intrinsic(_from_bits))
"""An integer, read as the bits of a double."""


@inner
def inverse_root(x: float) -> float:
    """1/√x for x > 0, to some 3e-16; a large finite number for 0.

    A guess by the exponent, improved twice by a series in 1 - x·y². In vector registers this takes a third of the time
    of a division by a square root.
    """
    y = from_bits(GUESS - (bits_of(x) >> np.int64(1)))
    r = fma(-(x * y), y, 1.0)
    y = fma(y, r * fma(r, fma(r, 0.3125, 0.375), 0.5), y)  # off by 35/128 r⁴ < 7e-6
    r = fma(-(x * y), y, 1.0)
    return fma(y, r * fma(r, 0.375, 0.5), y)


@inner
def arctangent_over(sine: float, cosine: float, by: float) -> tuple[float, float]:
    """Return θ = atan2(sine, cosine), which is within ±π/8, and 1/by; one division serves both.

    The polynomial of fdlibm (s_atan.c, Sun Microsystems) is good to the last bits up to there.
    """
    inverse = 1.0 / (cosine * by)
    u = sine * by * inverse
    q = u * u
    p = fma(1.62858201153657823623e-02, q, -3.65315727442169155270e-02)
    p = fma(p, q, 4.97687799461593236017e-02)
    p = fma(p, q, -5.83357013379057348645e-02)
    p = fma(p, q, 6.66107313738753120669e-02)
    p = fma(p, q, -7.69187620504482999495e-02)
    p = fma(p, q, 9.09088713343650656196e-02)
    p = fma(p, q, -1.11111104054623557880e-01)
    p = fma(p, q, 1.42857142725034663711e-01)
    p = fma(p, q, -1.99999999998764832476e-01)
    p = fma(p, q, 3.33333333333329318027e-01)
    return fma(-u, q * p, u), cosine * inverse


@inner
def angle_over(sine: float, cosine: float, by: float) -> tuple[float, float]:
    """Return θ = atan2(sine, cosine) and 1/by.

    Not a call of atan2 but the same without a branch, so that the loop vectorises: the smaller of |sine| and |cosine|
    over the larger lies in [0, 1]; above tan(π/8) it is turned by -π/4, and is below then; signs and octant are put
    back by selection.
    """
    s, c = abs(sine), abs(cosine)
    larger = s if s > c else c
    smaller = c if s > c else s
    turned = smaller > TAN_EIGHTH * larger
    over = smaller - larger if turned else smaller
    under = smaller + larger if turned else larger
    angle, inverse = arctangent_over(over, under, by)
    angle = angle + QUARTER_PI if turned else angle
    angle = HALF_PI - angle if s > c else angle
    angle = math.pi - angle if cosine < 0 else angle
    return math.copysign(angle, sine), inverse
