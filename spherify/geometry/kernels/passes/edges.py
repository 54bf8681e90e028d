"""Edges: the value of each interior edge, from which the curvature of its vertices is averaged."""

from __future__ import annotations

import math

import numpy as np

from spherify.geometry.kernels.passes.jit import inner
from spherify.geometry.kernels.passes.types import VTK, Floats, Index, Indices

BLOCK = np.uint32(512)  # edges; their scratch is 16 kB
TAN_EIGHTH = math.sqrt(2) - 1  # tan(π/8): up to here the polynomial below is good to the last bits
HALF_PI = math.pi / 2
QUARTER_PI = math.pi / 4


@inner
def gather(
    x: Floats, y: Floats, z: Floats, a: Indices, b: Indices, f: Indices, g: Indices,
    nx: Floats, ny: Floats, nz: Floats, area: Floats,
    sine: Floats, cosine: Floats, squared: Floats, areas: Floats, low: Index, high: Index,
) -> None:  # fmt: skip
    """(n_f × n_g)·e, n_f·n_g, |e|² and A_f + A_g of a block, e = b - a not being normalised yet."""
    for i in range(low, high):
        ex, ey, ez = x[b[i]] - x[a[i]], y[b[i]] - y[a[i]], z[b[i]] - z[a[i]]
        fx, fy, fz = nx[f[i]], ny[f[i]], nz[f[i]]
        gx, gy, gz = nx[g[i]], ny[g[i]], nz[g[i]]
        j = np.uint32(i - low)
        squared[j] = ex * ex + ey * ey + ez * ez
        sine[j] = (fy * gz - fz * gy) * ex + (fz * gx - fx * gz) * ey + (fx * gy - fy * gx) * ez
        cosine[j] = fx * gx + fy * gy + fz * gz
        areas[j] = area[f[i]] + area[g[i]]


@inner
def values(
    sine: Floats, cosine: Floats, squared: Floats, areas: Floats, value: Floats,
    by_area: bool, low: Index, high: Index,
) -> None:  # fmt: skip
    """l·θ, divided by ⅔ (A_f + A_g) if ``by_area`` (0 where there is no area), with θ = atan2(sine, cosine).

    Not a call of atan2 but the same without a branch, so that the loop vectorises: the smaller of |sine| and |cosine|
    over the larger lies in [0, 1]; above tan(π/8) it is turned by -π/4; in what remains a polynomial of
    fdlibm (s_atan.c, Sun Microsystems) is good to the last bits, without a further division; signs and octant are
    put back by selection.
    """
    for i in range(low, high):
        j = np.uint32(i - low)
        length = math.sqrt(squared[j])
        s, c = sine[j], cosine[j] * length  # both as long as the edge: θ does not mind
        s_abs, c_abs = abs(s), abs(c)
        larger = s_abs if s_abs > c_abs else c_abs
        smaller = c_abs if s_abs > c_abs else s_abs
        turned = smaller > TAN_EIGHTH * larger
        over = smaller - larger if turned else smaller
        under = smaller + larger if turned else larger
        u = over / (under if under != 0 else 1.0)  # what is not a number stays so
        q = u * u
        p = 1.62858201153657823623e-02
        p = p * q - 3.65315727442169155270e-02
        p = p * q + 4.97687799461593236017e-02
        p = p * q - 5.83357013379057348645e-02
        p = p * q + 6.66107313738753120669e-02
        p = p * q - 7.69187620504482999495e-02
        p = p * q + 9.09088713343650656196e-02
        p = p * q - 1.11111104054623557880e-01
        p = p * q + 1.42857142725034663711e-01
        p = p * q - 1.99999999998764832476e-01
        p = p * q + 3.33333333333329318027e-01
        angle = u - u * (q * p)
        angle = angle + QUARTER_PI if turned else angle
        angle = HALF_PI - angle if s_abs > c_abs else angle
        angle = math.pi - angle if c < 0 else angle
        bent = length * math.copysign(angle, s)
        if by_area:
            bent = 1.5 * bent / areas[j] if areas[j] != 0 else 0.0
        value[i] = bent


@inner
def edge_pass(
    x: Floats, y: Floats, z: Floats, a: Indices, b: Indices, f: Indices, g: Indices,
    nx: Floats, ny: Floats, nz: Floats, area: Floats,
    sine: Floats, cosine: Floats, squared: Floats, areas: Floats, value: Floats, measure: int,
) -> None:  # fmt: skip
    """Value all interior edges by (3/2)·l·θ / (A_f + A_g) for ``vtk``, else l·θ."""
    count = np.uint32(a.size)
    low = np.uint32(0)
    while low < count:
        high = min(np.uint32(low + BLOCK), count)
        gather(x, y, z, a, b, f, g, nx, ny, nz, area, sine, cosine, squared, areas, low, high)
        values(sine, cosine, squared, areas, value, measure == VTK, low, high)
        low = high
