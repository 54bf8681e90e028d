"""What a picture shows, and that it is the same every time."""

from __future__ import annotations

import io

import numpy as np
import pytest
from matplotlib.image import imread

from spherify.geometry.mesh import TriangleMesh
from spherify.geometry.samples import SAMPLES
from spherify.pictures import Panel, View, side_by_side

CUBE = SAMPLES["cube"].build(100)
PAPER = np.array([0xFB, 0xFA, 0xF7]) / 255


def pixels(mesh: TriangleMesh, **options: object) -> np.ndarray:
    png = side_by_side([Panel(mesh, "")], dpi=60, **options)  # type: ignore[arg-type] # a view, or none
    return np.asarray(imread(io.BytesIO(png), format="png"))[:, :, :3]


def painted(image: np.ndarray) -> float:
    """Share of the picture in strong colours: neither paper nor shadow."""
    return float((np.ptp(image, axis=2) > 0.12).mean())


def test_the_same_bytes_every_time() -> None:
    panels = [Panel(CUBE, "iteration 0", "Ψ 0.8060")]
    assert side_by_side(panels) == side_by_side(panels)


def test_neither_place_nor_scale_changes_the_picture() -> None:
    image = pixels(CUBE)
    for scale, shift in ((1e-9, 0.0), (1e9, 3e9)):
        moved = CUBE.with_vertices(CUBE.vertices * scale + shift)
        assert np.abs(pixels(moved) - image).mean() < 0.002


def test_front_faces_are_painted_and_back_faces_are_not() -> None:
    assert painted(pixels(CUBE)) > 0.1
    # turned inside out, the far side is what faces the eye
    inside_out = TriangleMesh(CUBE.vertices, np.ascontiguousarray(CUBE.faces[:, ::-1]))
    assert np.abs(pixels(inside_out) - pixels(CUBE)).mean() > 0.02
    flat = TriangleMesh.checked(np.eye(3), [[0, 2, 1]])
    assert painted(pixels(flat, view=View(45, 35))) < 0.01


def test_the_upright_axis_stands_up() -> None:
    heights = {}
    for axis, name in enumerate("xyz"):
        stretch = np.ones(3)
        stretch[axis] = 4.0
        image = pixels(CUBE.with_vertices(CUBE.vertices * stretch), view=View(up=name))
        strong = np.ptp(image, axis=2) > 0.12
        heights[name] = np.ptp(np.flatnonzero(strong.any(axis=1))) / np.ptp(
            np.flatnonzero(strong.any(axis=0))
        )
    assert min(heights.values()) > 2
    assert max(heights.values()) == pytest.approx(min(heights.values()), rel=0.02)


def test_hues_follow_the_vertices() -> None:
    turned = CUBE.with_vertices(CUBE.vertices @ np.diag([-1.0, -1.0, 1.0]))  # half a turn about z
    both = side_by_side([Panel(CUBE, ""), Panel(turned, "")], view=View(azimuth=10, elevation=0), dpi=60)
    image = np.asarray(imread(io.BytesIO(both), format="png"))[:, :, :3]
    left, right = np.split(image[:, : image.shape[1] // 2 * 2], 2, axis=1)
    assert np.abs(left - right).mean() > 0.02  # one shape, other vertices in front


def test_many_panels_are_laid_out_in_rows() -> None:
    def size(count: int) -> tuple[int, int]:
        png = side_by_side([Panel(CUBE, str(n)) for n in range(count)], dpi=40)
        return np.asarray(imread(io.BytesIO(png), format="png")).shape[:2]

    one_row, two_rows = size(6), size(7)
    assert two_rows[1] == one_row[1]
    assert two_rows[0] == pytest.approx(2 * one_row[0], abs=2)


@pytest.mark.parametrize("panels", [[], [Panel(CUBE, ""), Panel(SAMPLES["stone"].build(60), "")]])
def test_what_cannot_be_compared_is_refused(panels: list[Panel]) -> None:
    with pytest.raises(ValueError, match="mesh"):
        side_by_side(panels)
