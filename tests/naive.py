"""The paper in plain loops: the oracle the engines are held against.

Written from Vartziotis, arXiv:1608.03898, and the definitions of what is added to it, sharing nothing with the
package: points are tuples, a mesh is a list of points and a list of index triples, and nothing is precomputed.
"""

from __future__ import annotations

import math

Point = tuple[float, float, float]
Triangle = tuple[int, int, int]


def add(a, b):
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def sub(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def times(s, a):
    return (s * a[0], s * a[1], s * a[2])


def inner(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def outer(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def length(a):
    return math.sqrt(inner(a, a))


def unit(a):
    size = length(a)
    return times(1 / size, a) if size > 0 else (0.0, 0.0, 0.0)


def faces_at(p: int, F: list[Triangle]) -> list[Triangle]:
    return [f for f in F if p in f]


def neighbours(p: int, F: list[Triangle]) -> list[int]:
    return sorted({q for f in faces_at(p, F) for q in f if q != p})


def face_area(f: Triangle, V: list[Point]) -> float:
    return length(outer(sub(V[f[1]], V[f[0]]), sub(V[f[2]], V[f[0]]))) / 2


def face_normal(f: Triangle, V: list[Point]) -> Point:
    return unit(outer(sub(V[f[1]], V[f[0]]), sub(V[f[2]], V[f[0]])))


def vertex_normal(p: int, V: list[Point], F: list[Triangle]) -> Point:
    total = (0.0, 0.0, 0.0)
    for f in faces_at(p, F):
        total = add(total, face_normal(f, V))
    return unit(total)


def face_along(p: int, q: int, F: list[Triangle]) -> Triangle | None:
    """The face that runs from p to q."""
    for f in F:
        if (p, q) in ((f[0], f[1]), (f[1], f[2]), (f[2], f[0])):
            return f
    return None


def dihedral_angle(p: int, q: int, V: list[Point], F: list[Triangle]) -> float | None:
    """θ of the edge pq by the angle between the normals and the side on which the other face lies."""
    f, g = face_along(p, q, F), face_along(q, p, F)
    if f is None or g is None:
        return None
    n_f, n_g = face_normal(f, V), face_normal(g, V)
    # The half angle keeps its digits where the arc cosine of a number near 1 does not.
    angle = 2 * math.atan2(length(sub(n_f, n_g)), length(add(n_f, n_g)))
    (apex,) = (corner for corner in g if corner not in (p, q))
    return angle if inner(sub(V[apex], V[p]), n_f) <= 0 else -angle


def curvature(p: int, V: list[Point], F: list[Triangle], measure: str) -> float:
    values = []
    for q in neighbours(p, F):
        theta = dihedral_angle(p, q, V, F)
        if theta is None:
            continue
        size = length(sub(V[q], V[p]))
        if measure == "vtk":
            values.append(
                1.5 * size * theta / (face_area(face_along(p, q, F), V) + face_area(face_along(q, p, F), V))
            )
        else:
            values.append(size * theta)
    if not values:
        return 0.0
    if measure == "dual-area":
        return sum(values) / 4 / (sum(face_area(f, V) for f in faces_at(p, F)) / 3)
    return sum(values) / len(values)


def percentile(values: list[float], percent: float) -> float:
    """Linear interpolation between the order statistics."""
    ordered = sorted(values)
    place = percent / 100 * (len(ordered) - 1)
    low = math.floor(place)
    high = min(low + 1, len(ordered) - 1)
    return ordered[low] + (place - low) * (ordered[high] - ordered[low])


def share(K: list[float], window) -> list[float]:
    """t of every vertex, for a mesh whose curvature is not constant."""
    low, high = percentile(K, window[0]), percentile(K, window[1])
    if high - low <= 1e-10 * max(abs(k) for k in K):
        low, high = min(K), max(K)
    return [min(max((k - low) / (high - low), 0.0), 1.0) for k in K]


def least_altitude(p: int, V: list[Point], F: list[Triangle]) -> float:
    least = math.inf
    for f in faces_at(p, F):
        sides = [length(sub(V[f[i]], V[f[i - 1]])) for i in range(3)]
        least = min(least, 2 * face_area(f, V) / max(sides))
    return least


def elementary_step(
    V, F, direction, C, *, measure, window=(0, 100), step_bound=0, relaxation=0, exponent=0, held=()
):
    """One I_C (direction "in") or O_C ("out") with all that is added to it."""
    everyone = range(len(V))
    t = share([curvature(p, V, F, measure) for p in everyone], window)
    normals = [vertex_normal(p, V, F) for p in everyone]
    moved = []
    for p in everyone:
        distance = -C * t[p] if direction == "in" else C * (1 - t[p])
        if step_bound:
            bound = step_bound * least_altitude(p, V, F)
            distance = min(max(distance, -bound), bound)
        moved.append(add(V[p], times(distance, normals[p])))
    if relaxation:
        weight = [sum(face_area(f, V) for f in faces_at(p, F)) ** exponent for p in everyone]
        spread = []
        for p in everyone:
            umbrella, total = (0.0, 0.0, 0.0), 0.0
            for q in neighbours(p, F):
                umbrella = add(umbrella, times(weight[q], sub(moved[q], moved[p])))
                total += weight[q]
            umbrella = times(1 / total, umbrella)
            tangential = sub(umbrella, times(inner(umbrella, normals[p]), normals[p]))
            spread.append(add(moved[p], times(relaxation, tangential)))
        moved = spread
    return [V[p] if p in held else moved[p] for p in everyone]


def transform(V, F, k_in, k_out, C, **settings):
    """T = O_C^k_out ∘ I_C^k_in."""
    for _ in range(k_in):
        V = elementary_step(V, F, "in", C, **settings)
    for _ in range(k_out):
        V = elementary_step(V, F, "out", C, **settings)
    return V


def area(V, F) -> float:
    return sum(face_area(f, V) for f in F)


def volume(V, F) -> float:
    return sum(inner(V[a], outer(V[b], V[c])) for a, b, c in F) / 6


def centroid(V, F) -> Point:
    total = (0.0, 0.0, 0.0)
    for f in F:
        centre = times(1 / 3, add(add(V[f[0]], V[f[1]]), V[f[2]]))
        total = add(total, times(face_area(f, V), centre))
    return times(1 / area(V, F), total)


def sphericity(V, F) -> float:
    return (36 * math.pi * volume(V, F) ** 2) ** (1 / 3) / area(V, F)


def mean_edge(V, F) -> float:
    edges = {(min(p, q), max(p, q)) for f in F for p, q in ((f[0], f[1]), (f[1], f[2]), (f[2], f[0]))}
    return sum(length(sub(V[p], V[q])) for p, q in edges) / len(edges)


def scaled_about_centroid(V, F, factor):
    c = centroid(V, F)
    return [add(c, times(factor, sub(p, c))) for p in V]


def radius_variation(V, F) -> float:
    c, total = centroid(V, F), area(V, F)
    weight = [sum(face_area(f, V) for f in faces_at(p, F)) / 3 for p in range(len(V))]
    mean = sum(w * length(sub(p, c)) for w, p in zip(weight, V, strict=True)) / total
    return (
        math.sqrt(sum(w * (length(sub(p, c)) - mean) ** 2 for w, p in zip(weight, V, strict=True)) / total)
        / mean
    )


def run(
    V, F, iterations, *, schedule, step, step_unit, momentum=0, rescale="none", annealing=None, **settings
):
    """The whole flow; returns positions and sphericity after each iteration."""
    relaxation = settings.pop("relaxation", 0)
    start_edge, start_area, start_volume = mean_edge(V, F), area(V, F), volume(V, F)
    stages = [(k_in, k_out) for repeat, k_in, k_out in schedule for _ in range(repeat)]
    before, b, scale, waited, rises = V, 0.0, 1.0, 0, 0
    psi = plateau = sphericity(V, F)
    states = [(V, psi)]
    for i in range(iterations):
        unit_length = {"absolute": 1.0, "initial-mean-edge": start_edge, "mean-edge": mean_edge(V, F)}[
            step_unit
        ]
        ahead = [add(p, times(b, sub(p, q))) for p, q in zip(V, before, strict=True)]
        k_in, k_out = stages[i % len(stages)]
        moved = transform(
            ahead, F, k_in, k_out, step * scale * unit_length, relaxation=relaxation * scale, **settings
        )
        if rescale == "area":
            moved = scaled_about_centroid(moved, F, math.sqrt(start_area / area(moved, F)))
        if rescale == "volume":
            moved = scaled_about_centroid(moved, F, (start_volume / volume(moved, F)) ** (1 / 3))
        before, V = V, moved
        last, psi = psi, sphericity(V, F)
        rises = 0 if psi < last else rises + 1
        b = min(rises / (rises + 3), momentum)
        waited += 1
        if psi > plateau + 1e-4:
            plateau, waited = psi, 0
        elif annealing and waited >= annealing[0]:
            scale, waited = scale * annealing[1], 0
        states.append((V, psi))
    return states


def quality(V, F) -> list[float]:
    return [
        4 * math.sqrt(3) * face_area(f, V) / sum(length(sub(V[f[i]], V[f[i - 1]])) ** 2 for i in range(3))
        for f in F
    ]


def inward_faces(V, F) -> int:
    c = centroid(V, F)
    count = 0
    for f in F:
        centre = times(1 / 3, add(add(V[f[0]], V[f[1]]), V[f[2]]))
        count += inner(face_normal(f, V), sub(centre, c)) <= 0
    return count
