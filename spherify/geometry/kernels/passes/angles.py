"""Roots and dihedral angles, eight at a time."""

from __future__ import annotations

import math
from typing import Final

from spherify.geometry.kernels.passes.arithmetic import GUESS, HALF_PI, QUARTER_PI, TAN_EIGHTH
from spherify.geometry.kernels.passes.wide import Wide, polynomial, where

# asin(u)/u as a polynomial in u², the highest power first: 1 at 0 and exact at the Chebyshev nodes of the range, fitted
# with 60 digits. Either is off by less than the rounding of its value.
SMALL: Final = 1 / 32  # sin² up to which `ARCSINE_OF_SMALL` holds: 10.2°
ARCSINE_OF_SMALL: Final = (
    0.018728050639262927,
    0.02232304305194952,
    0.030382746185125035,
    0.04464285124806753,
    0.07500000001581904,
    0.1666666666666598,
    1.0,
)
SLIGHT: Final = 1 / 8  # sin² up to which `ARCSINE` holds: 20.7°
ARCSINE: Final = (
    0.016197699832220892,
    0.009895319845020324,
    0.014183944999264848,
    0.017336194515833292,
    0.02237288800695235,
    0.030381926538598645,
    0.044642857362304084,
    0.0749999999989678,
    0.16666666666666746,
    1.0,
)
# (1/√(1 - r) - 1)/r for |r| up to 0.0695, which `GUESS` leaves: exact at three Chebyshev nodes; 1/√x to 2e-6 with it.
INVERSE_ROOT: Final = (0.31339428, 0.37599355, 0.5)
# (θ - tan θ) / tan³ θ up to π/8 as a polynomial in tan² θ, from fdlibm (s_atan.c, Sun Microsystems).
ARCTANGENT: Final = (
    1.62858201153657823623e-02,
    -3.65315727442169155270e-02,
    4.97687799461593236017e-02,
    -5.83357013379057348645e-02,
    6.66107313738753120669e-02,
    -7.69187620504482999495e-02,
    9.09088713343650656196e-02,
    -1.11111104054623557880e-01,
    1.42857142725034663711e-01,
    -1.99999999998764832476e-01,
    3.33333333333329318027e-01,
)


def inverse_root(x: Wide) -> Wide:
    """1/√x for x > 0, to some 2e-16; a large finite number for 0.

    A guess by the exponent, improved twice by a series in 1 - x·y².
    """
    y = x.halved_exponent(of=int(GUESS))
    r = (-(x * y)).fma(y, 1.0)
    y = y.fma(r * polynomial(INVERSE_ROOT, r), y)
    r = (-(x * y)).fma(y, 1.0)
    return y.fma(r * polynomial((0.375, 0.5), r), y)


def inverse_root_by_division(x: Wide) -> Wide:
    """1/√x, by what the processor has for it: slow, but beside all else; inf for 0."""
    return 1.0 / x.root()


def arctangent(sine: Wide, cosine: Wide) -> Wide:
    """Return θ = atan2(sine, cosine).

    The smaller of |sine| and |cosine| over the larger lies in [0, 1]; above tan(π/8) it is turned by -π/4, and is below
    then; signs and octant are put back by selection.
    """
    s, c = abs(sine), abs(cosine)
    steep = s > c
    larger, smaller = where(steep, s, c), where(steep, c, s)
    turned = smaller > TAN_EIGHTH * larger
    u = where(turned, smaller - larger, smaller) / where(turned, smaller + larger, larger)
    q = u * u
    angle = (-u).fma(q * polynomial(ARCTANGENT, q), u)
    angle = where(turned, angle + QUARTER_PI, angle)
    angle = where(steep, HALF_PI - angle, angle)
    angle = where(cosine < 0.0, math.pi - angle, angle)
    return angle.signed_as(sine)
