"""Vertices: curvature K, normal n_p, and, where asked for, the areas and least altitude of the faces at each.

A vertex sums over a list of edges or faces. Lists of different lengths do not vectorise, and each of their ends is a
jump the processor guesses wrong; so vertices are numbered in runs of equal lengths (`Connectivity.runs`), and a run is
summed neighbour by neighbour: the inner loop goes over the vertices.
"""

from __future__ import annotations

import math

import numpy as np

from spherify.geometry.kernels.passes.jit import inner
from spherify.geometry.kernels.passes.types import DUAL_AREA, Floats, Index, Indices

WINDOW = 1024  # vertices at most in a run; numbering sorts them by degree within a window of as many


@inner
def sum_one(
    at: Indices, base: Index, degree: Index, v: Floats, total: Floats, low: Index, high: Index
) -> None:
    """Sum ``v`` over the lists of a run."""
    count = np.uint32(high - low)
    for p in range(low, high):
        total[p] = 0.0
    for j in range(np.uint32(0), degree):
        first = np.uint32(base + j * count)
        for k in range(np.uint32(0), count):
            total[np.uint32(low + k)] += v[at[np.uint32(first + k)]]


@inner
def sum_three(
    at: Indices, base: Index, degree: Index, u: Floats, v: Floats, w: Floats,
    sum_u: Floats, sum_v: Floats, sum_w: Floats, low: Index, high: Index,
) -> None:  # fmt: skip
    """Sum the three coordinates ``u``, ``v``, ``w`` over the lists of a run."""
    count = np.uint32(high - low)
    for own in range(low, high):
        sum_u[own] = 0.0
        sum_v[own] = 0.0
        sum_w[own] = 0.0
    for j in range(np.uint32(0), degree):
        first = np.uint32(base + j * count)
        for k in range(np.uint32(0), count):
            i = at[np.uint32(first + k)]
            p = np.uint32(low + k)
            sum_u[p] += u[i]
            sum_v[p] += v[i]
            sum_w[p] += w[i]


@inner
def least(at: Indices, base: Index, degree: Index, v: Floats, found: Floats, low: Index, high: Index) -> None:
    """Take the least of ``v`` over the lists of a run; what is not a number is passed on."""
    count = np.uint32(high - low)
    for i in range(low, high):
        found[i] = np.inf
    for j in range(np.uint32(0), degree):
        first = np.uint32(base + j * count)
        for k in range(np.uint32(0), count):
            p = np.uint32(low + k)
            new = v[at[np.uint32(first + k)]]
            found[p] = found[p] if found[p] <= new else new


@inner
def normalise(px: Floats, py: Floats, pz: Floats, low: Index, high: Index) -> None:
    """Scale vectors to length 1; zero stays zero."""
    for p in range(low, high):
        length = math.sqrt(px[p] * px[p] + py[p] * py[p] + pz[p] * pz[p])
        scale = 1.0 / length if length != 0 else 0.0
        px[p] *= scale
        py[p] *= scale
        pz[p] *= scale


@inner
def average(K: Floats, degree: Index, low: Index, high: Index) -> None:
    """Divide sums by the number of edges at each vertex of a run."""
    by = float(max(degree, np.uint32(1)))
    for p in range(low, high):
        K[p] /= by


@inner
def over_dual_area(K: Floats, area: Floats, low: Index, high: Index) -> None:
    """¼ Σ l·θ ÷ (⅓ Σ areas); 0 where there is no area."""
    for p in range(low, high):
        dual = area[p] / 3.0
        K[p] = 0.25 * K[p] / dual if dual != 0 else 0.0


@inner
def note_extremes(
    K: Floats, least_K: Floats, greatest_K: Floats, off: Floats, low: Index, high: Index
) -> None:
    """Bring the running extremes up to date, one for each place in a run, so that no value waits for another.

    ``off`` stays 0 as long as all K are finite: 0·K is not a number where K is infinite or none itself.
    """
    for p in range(low, high):
        j = np.uint32(p - low)
        k = K[p]
        least_K[j] = k if k < least_K[j] else least_K[j]
        greatest_K[j] = k if k > greatest_K[j] else greatest_K[j]
        off[j] += 0.0 * k


@inner
def vertex_pass(
    runs: Indices, edges_at: Indices, faces_at: Indices,
    edge_value: Floats, nx: Floats, ny: Floats, nz: Floats, face_area: Floats, face_altitude: Floats,
    K: Floats, px: Floats, py: Floats, pz: Floats, area: Floats, altitude: Floats,
    least_K: Floats, greatest_K: Floats, off: Floats, measure: int, areas: bool, bounded: bool,
) -> tuple[float, float, bool]:  # fmt: skip
    """K, n_p, and if asked for areas and least altitudes at the vertices.

    Returns:
        the extremes of K, and whether all K are finite.

    """
    for j in range(least_K.size):
        least_K[j] = np.inf
        greatest_K[j] = -np.inf
        off[j] = 0.0
    for r in range(runs.shape[0]):
        low, high = runs[r, 0], runs[r, 1]
        sum_one(edges_at, runs[r, 3], runs[r, 2], edge_value, K, low, high)
        sum_three(faces_at, runs[r, 5], runs[r, 4], nx, ny, nz, px, py, pz, low, high)
        normalise(px, py, pz, low, high)
        if areas:
            sum_one(faces_at, runs[r, 5], runs[r, 4], face_area, area, low, high)
        if bounded:
            least(faces_at, runs[r, 5], runs[r, 4], face_altitude, altitude, low, high)
        if measure == DUAL_AREA:
            over_dual_area(K, area, low, high)
        else:
            average(K, runs[r, 2], low, high)
        note_extremes(K, least_K, greatest_K, off, low, high)
    K_min, K_max, finite = np.inf, -np.inf, 0.0
    for j in range(least_K.size):
        K_min = min(K_min, least_K[j])
        K_max = max(K_max, greatest_K[j])
        finite += off[j]
    return K_min, K_max, finite == 0
