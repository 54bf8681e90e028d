"""Directions set anew: from whatever tangle, all look outward, with room for each."""

from __future__ import annotations

import numpy as np
import pytest

from spherify.geometry import measures, reinsertion
from spherify.geometry.covering import covering
from spherify.geometry.kernels.thinning import CompiledThinning
from spherify.geometry.mesh import TriangleMesh
from spherify.geometry.plain_thinning import PlainThinning
from spherify.geometry.presets import PRESETS
from spherify.geometry.reinsertion import drawn, mended, reinserted
from spherify.geometry.roundness import sphericity
from spherify.geometry.samples.solids import icosphere
from spherify.geometry.thinning import volumes
from spherify.geometry.unfolding import folds
from tests.geometry.shapes import drum, octahedron, tetrahedron
from tests.geometry.test_covering import wound

ROBUST = PRESETS["robust"].config
CENTRE = np.array([0.01, -0.02, 0.005])
MESHES = {
    "tetrahedron": tetrahedron(),
    "octahedron": octahedron(),
    "ball": icosphere(6),
    "drum": drum(24, 3),
    "fans": drum(60, 1),
    "coil": wound(1.5, 5, 40),
    "string": wound(0.9, 4, 60),
}


def coil(turns: int, rings: int, around: int = 6) -> TriangleMesh:
    """A tube along a helix, closed at its ends by a vertex each."""
    angle = np.linspace(0, 2 * np.pi * turns, rings)
    line = np.stack([np.cos(angle), np.sin(angle), 0.8 * angle / (2 * np.pi)], axis=1)
    ahead = measures.normalised(np.gradient(line, axis=0))
    out = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    turn = 2 * np.pi * np.arange(around) / around
    ring = np.cos(turn)[:, None] * out[:, None] + np.sin(turn)[:, None] * np.cross(ahead, out)[:, None]
    tube = (line[:, None] + 0.25 * ring).reshape(-1, 3)
    V = np.vstack([tube, line[:1] - 0.25 * ahead[:1], line[-1:] + 0.25 * ahead[-1:]])
    here = np.arange(around)
    there, last, n = (here + 1) % around, (rings - 1) * around, len(tube)
    faces = [np.stack([np.full(around, n), here, there], axis=1)]
    faces.append(np.stack([np.full(around, n + 1), last + there, last + here], axis=1))
    for row in range(0, last, around):
        faces.append(np.stack([row + here, row + around + there, row + there], axis=1))
        faces.append(np.stack([row + here, row + around + here, row + around + there], axis=1))
    F = np.concatenate(faces)
    return TriangleMesh.checked(V, F if measures.volume(V, F, np.zeros(3)) > 0 else F[:, ::-1])


def tangled(mesh: TriangleMesh, seed: int = 0):
    """Vertices anywhere about the centre."""
    return np.asfortranarray(CENTRE + np.random.default_rng(seed).normal(size=mesh.vertices.shape))


@pytest.mark.parametrize("way", [PlainThinning, CompiledThinning])
@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES.keys())
def test_from_any_tangle_all_faces_look_outward_and_cover_the_sphere_once(mesh, way):
    V = tangled(mesh)
    found = reinserted(V, mesh.faces, CENTRE, way)
    spokes = found - CENTRE
    inward, least = folds(measures.normalised(spokes), mesh.faces)
    assert inward == 0
    assert least > 1e-3
    assert covering(found, mesh.faces, CENTRE).degree == 1
    assert measures.norm(spokes) == pytest.approx(measures.norm(V - CENTRE).mean(), rel=1e-12)


def test_twice_is_the_same_to_the_last_bit():
    mesh = MESHES["coil"]
    one, other = (reinserted(tangled(mesh), mesh.faces, CENTRE, CompiledThinning) for _ in range(2))
    assert one.tobytes() == other.tobytes()


@pytest.mark.parametrize("name", ["ball", "coil"])
def test_a_drawing_is_turned_to_where_vertices_were(name):
    mesh = MESHES[name]
    U = measures.normalised(tangled(mesh) - CENTRE)
    turn, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    one, other = (drawn(V, mesh.faces, CompiledThinning) for V in (U, U @ turn))
    assert other == pytest.approx(one @ turn, abs=1e-9)
    small = np.array([[0, -1, 2], [1, 0, -3], [-2, 3, 0]]) * 1e-3
    for angle in (small, -small):  # turned a little further, vertices are farther from where they were
        further = one + one @ angle + 0.5 * one @ angle @ angle
        assert (further * U).sum() < (one * U).sum()


def roundness(U, F):
    return sphericity(float(measures.face_areas(U, F).sum()), measures.volume(U, F, np.zeros(3)))


def test_a_ball_is_drawn_as_the_round_one_that_it_is():
    """Nothing but who is whose neighbour tells."""
    ball = icosphere(8)
    U = drawn(tangled(ball), ball.faces, CompiledThinning)
    assert folds(U, ball.faces)[1] > 0.1
    assert roundness(U, ball.faces) > 0.99


@pytest.mark.parametrize("way", [PlainThinning, CompiledThinning])
def test_directions_that_look_outward_are_kept_but_for_room(way):
    ball = icosphere(6)
    U = ball.vertices.copy()
    U[7] = -U[7]
    found = mended(U, ball.faces, way)
    assert folds(found, ball.faces)[0] == 0
    assert found[7] @ ball.vertices[7] > 0.99
    assert (measures.norm(found - ball.vertices) < 0.1).all()
    turned_over = U * [1, 1, -1]
    assert mended(turned_over, ball.faces, way) is None, "covers the sphere, but the other way round"


def test_of_both_the_rounder_is_taken():
    ball, string = icosphere(6), coil(4, 80)
    U = ball.vertices.copy()
    U[7] = -U[7]
    taken = set()
    for V, F in ((U, ball.faces), (measures.normalised(string.vertices), string.faces)):
        both = [make(V, F, CompiledThinning) for make in (mended, drawn)]
        found = reinserted(V, F, np.zeros(3), CompiledThinning)
        best = int(np.argmax([-1 if D is None else roundness(D, F) for D in both]))
        assert found == pytest.approx(both[best], abs=1e-12)
        taken.add(best)
    assert taken == {0, 1}


@pytest.mark.parametrize("share", [1 - 1e-9, 1 + 1e-9])
def test_what_is_kept_and_round_is_not_drawn_as_well(monkeypatch, share):
    ball, asked = icosphere(6), []
    U = ball.vertices.copy()
    U[7] = -U[7]
    kept = mended(U, ball.faces, CompiledThinning)
    area, volume = measures.face_areas(kept, ball.faces).sum(), measures.volume(kept, ball.faces, np.zeros(3))
    monkeypatch.setattr(reinsertion, "ROUND", share * sphericity(area, volume))
    monkeypatch.setattr(reinsertion, "drawn", lambda *_: asked.append(1))
    found = reinserted(U, ball.faces, np.zeros(3), CompiledThinning)
    assert np.abs(found - kept).max() < 1e-12
    assert len(asked) == (share > 1)


@pytest.mark.parametrize("way", [PlainThinning, CompiledThinning])
def test_of_more_vertices_than_can_be_waited_for_it_keeps_off(monkeypatch, way):
    ball = icosphere(3)
    monkeypatch.setattr(way, "most", len(ball.vertices) - 1)
    assert reinserted(tangled(ball), ball.faces, CENTRE, way) is None
    monkeypatch.setattr(way, "most", len(ball.vertices))
    assert reinserted(tangled(ball), ball.faces, CENTRE, way) is not None


def test_where_rounding_leaves_a_vertex_no_place_there_is_none(monkeypatch):
    ball, put_back, asked = icosphere(3), CompiledThinning.put_back, []

    def none(self, U):
        asked.append(len(self.left))
        return len(self.left) < 20 and put_back(self, U)

    monkeypatch.setattr(CompiledThinning, "put_back", none)
    assert reinserted(tangled(ball), ball.faces, CENTRE, CompiledThinning) is None
    assert asked[-1] == asked[-2], "asked again after room was made"


@pytest.mark.parametrize("share", [0.5, 2])
def test_of_what_is_kept_no_triangle_may_be_too_small(monkeypatch, share):
    ball = icosphere(6)
    U = ball.vertices.copy()
    U[7] = -U[7]
    found = volumes(mended(U, ball.faces, CompiledThinning), ball.faces)
    monkeypatch.setattr(reinsertion, "ENOUGH", share * found.min() / found.mean())
    assert (mended(U, ball.faces, CompiledThinning) is None) == (share > 1)


def test_before_a_place_is_looked_for_again_room_is_made(monkeypatch):
    ball, calls = icosphere(3), []
    put_back, relax = CompiledThinning.put_back, CompiledThinning.relax

    def not_the_third_time(self, U):
        calls.append("put")
        return calls.count("put") != 3 and put_back(self, U)

    def noted(self, U, sweeps):
        calls.append(sweeps)
        relax(self, U, sweeps)

    monkeypatch.setattr(CompiledThinning, "put_back", not_the_third_time)
    monkeypatch.setattr(CompiledThinning, "relax", noted)
    assert drawn(tangled(ball), ball.faces, CompiledThinning) is not None
    third = [i for i, call in enumerate(calls) if call == "put"][2]
    assert calls[third + 1 : third + 3] == [reinsertion.SWEEPS[0], "put"]


@pytest.mark.parametrize("way", [PlainThinning, CompiledThinning])
def test_around_a_hub_many_are_taken_out_at_once(monkeypatch, way):
    mesh = drum(300, 1)
    left, level = [], way._level
    monkeypatch.setattr(way, "_level", lambda self, **how: left.append(len(self.left)) or level(self, **how))
    way(tangled(mesh), mesh.faces).until_four()
    assert left[0] == len(mesh.vertices)
    assert len(left) < 40


@pytest.mark.parametrize("bad", [0.0, np.nan, np.inf])
def test_what_has_no_directions_is_left_alone(bad):
    ball = icosphere(3)
    V = (
        ball.vertices * bad
        if bad == 0
        else np.where(np.arange(len(ball.vertices))[:, None] == 5, bad, ball.vertices)
    )
    with np.errstate(invalid="ignore"):
        assert reinserted(V, ball.faces, np.zeros(3)) is None
