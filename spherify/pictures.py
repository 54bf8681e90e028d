"""Pictures of meshes side by side, drawn without a display.

Orthographic projection, back faces culled, the rest painted from back to front. A vertex keeps, in every panel,
the hue it has in the first one, so that a reader sees where an ear of the animal has gone on the sphere.
Every panel is drawn at the same surface area: a picture compares shapes, the captions give the figures.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from numpy.typing import NDArray

from spherify.geometry.mesh import TriangleMesh

Floats = NDArray[np.float64]

PAPER: Final = "#fbfaf7"
INK: Final = "#2b3a42"
FAINT_INK: Final = "#7d8a90"
HUES: Final = LinearSegmentedColormap.from_list(
    "spherify", ["#2f6f86", "#6fa8a3", "#d9cfae", "#e0a06f", "#b9574b"]
)
LIGHT: Final = np.array([-0.45, 0.75, 0.62]) / np.linalg.norm(
    [-0.45, 0.75, 0.62]
)  # right, up, towards the eye
PANELS_A_ROW: Final = 6
PANEL_INCHES: Final = 2.4
MARGIN: Final = 0.12  # of a panel's width, around what is drawn
CAPTION: Final = 0.34  # of a panel's width, below what is drawn


@dataclass(frozen=True, slots=True)
class Panel:
    """One mesh with two lines of text below it."""

    mesh: TriangleMesh
    title: str
    caption: str = ""


@dataclass(frozen=True, slots=True)
class View:
    """Where the eye is, in degrees, seen from the object; ``up`` is the axis that stands upright."""

    azimuth: float = 35.0
    elevation: float = 16.0
    up: str = "z"

    def axes(self) -> Floats:
        """Return (3, 3): the rows point right, up and towards the eye."""
        a, e = np.radians([self.azimuth, self.elevation])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        eye = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        rows = np.stack([right, np.cross(eye, right), eye])
        shift = {"x": 2, "y": 1, "z": 0}[self.up]  # cyclic, so that handedness stays
        return np.roll(rows, -shift, axis=1)


def side_by_side(panels: Sequence[Panel], *, view: View | None = None, dpi: int = 160) -> bytes:
    """Draw meshes that share their vertices' order side by side, as a PNG.

    Args:
        panels: from 1 on; more than six are laid out in rows. The first one decides the hues.
        view: the one camera of all panels.
        dpi: 2.4 inches a panel.

    Raises:
        ValueError: no panel, or panels with different numbers of vertices.

    """
    if not panels:
        raise ValueError("a picture needs at least one mesh")
    if len({len(panel.mesh.vertices) for panel in panels}) != 1:
        raise ValueError("the meshes of one picture must have the same number of vertices")
    camera = (view or View()).axes()
    hues = _hues(panels[0].mesh.vertices @ camera.T)
    drawn = [_centred(panel.mesh) @ camera.T for panel in panels]
    # a cell is as large as the largest panel asks for; equal cells, one scale
    half_width = max(float(np.abs(P[:, 0]).max()) for P in drawn)
    height = max(float(np.ptp(P[:, 1])) for P in drawn)
    unit = 2 * half_width
    cell_width = unit * (1 + 2 * MARGIN)
    cell_height = height + unit * (2 * MARGIN + CAPTION)

    columns = min(len(panels), PANELS_A_ROW)
    rows = -(-len(panels) // columns)
    figure = Figure(
        figsize=(columns * PANEL_INCHES, rows * PANEL_INCHES * cell_height / cell_width), facecolor=PAPER
    )
    FigureCanvasAgg(figure)
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.set_xlim(0, columns * cell_width)
    ax.set_ylim(-rows * cell_height, 0)
    ax.set_axis_off()
    for number, (panel, P) in enumerate(zip(panels, drawn, strict=True)):
        row, column = divmod(number, columns)
        x = (column + 0.5) * cell_width
        floor = -row * cell_height - unit * MARGIN - height  # all stand on one ground
        _draw_shadow(ax, P, x, floor)
        _draw_mesh(ax, P + np.array([x, floor - P[:, 1].min(), 0.0]), panel.mesh.faces, hues)
        ax.text(
            x,
            floor - unit * 0.20,
            panel.title,
            ha="center",
            va="center",
            color=INK,
            fontsize=10.5,
            weight="bold",
        )
        ax.text(
            x, floor - unit * 0.335, panel.caption, ha="center", va="center", color=FAINT_INK, fontsize=9.5
        )
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=dpi, facecolor=PAPER, metadata={"Software": None})
    return out.getvalue()


def _centred(mesh: TriangleMesh) -> Floats:
    """Return the vertices about the middle of their box, scaled to the surface area of the unit sphere."""
    V = mesh.vertices
    low, high = V.min(axis=0), V.max(axis=0)
    extent = float((high - low).max()) or 1.0
    P = (V - (low + high) / 2) / extent  # in the unit box first: areas of tiny meshes would underflow
    doubled = np.cross(P[mesh.faces[:, 1]] - P[mesh.faces[:, 0]], P[mesh.faces[:, 2]] - P[mesh.faces[:, 0]])
    area = float(np.linalg.norm(doubled, axis=1).sum()) / 2
    return np.asarray(P * np.sqrt(4 * np.pi / area)) if area > 0 else P


def _hues(P: Floats) -> Floats:
    """Return (n, 3) colours that run along the longest direction of the vertices as seen, shape (n, 3)."""
    centred = P - P.mean(axis=0)
    _, _, directions = np.linalg.svd(centred[:, :2], full_matrices=False)
    direction = directions[0] * (1.0 if directions[0][np.abs(directions[0]).argmax()] > 0 else -1.0)
    along = centred[:, :2] @ direction
    low, high = np.percentile(along, [1, 99])
    share = np.clip((along - low) / max(high - low, np.finfo(float).tiny), 0, 1)
    return np.asarray(HUES(share))[:, :3]


def _draw_shadow(ax: Axes, P: Floats, x: float, floor: float) -> None:
    """Lay a soft shadow under the object."""
    spread = float(np.percentile(np.abs(P[:, 0]), 97))
    across = np.linspace(-1, 1, 96)
    falloff = np.clip(1 - (across[None, :] ** 2 + across[:, None] ** 2), 0, 1) ** 1.5
    shade = np.zeros((96, 96, 4))
    shade[..., :3] = (0.17, 0.23, 0.26)
    shade[..., 3] = 0.22 * falloff
    width, height = spread * 1.15, spread * 0.16
    ax.imshow(shade, extent=(x - width, x + width, floor - height, floor + height), aspect="auto", zorder=0)


def _draw_mesh(ax: Axes, P: Floats, faces: NDArray[np.int64], hues: Floats) -> None:
    """Paint the front faces of projected vertices, shape (n, 3) in right, up, towards the eye."""
    a, b, c = (P[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    vertex_normals = np.zeros_like(P)
    for k in range(3):
        np.add.at(vertex_normals, faces[:, k], normals)
    front = normals[:, 2] > 0
    F = faces[front]
    smooth = _unit(_unit(vertex_normals)[F].sum(axis=1))
    shading = _unit(0.45 * _unit(normals[front]) + 0.55 * smooth)  # facets stay visible, but softly
    order = np.argsort(P[F, 2].mean(axis=1), kind="stable")

    diffuse = np.clip(shading @ LIGHT, 0, 1)
    sky = 0.5 + 0.5 * shading[:, 1]
    rim = np.clip(1 - shading[:, 2], 0, 1) ** 2
    shine = np.clip(2 * diffuse * shading[:, 2] - LIGHT[2], 0, 1) ** 18
    strength = 0.50 + 0.20 * sky + 0.42 * diffuse - 0.10 * rim
    colours = np.clip(hues[F].mean(axis=1) * strength[:, None] + 0.16 * shine[:, None], 0, 1)[order]

    # lines in the colour of their face close the hairline gaps of anti-aliasing; on coarse meshes they
    # are a little darker and show the triangles
    lines = np.clip(1 - 60.0 / np.sqrt(max(len(F), 1)) / 6, 0.80, 1.0)
    width = float(np.clip(14 / np.sqrt(max(len(F), 1)), 0.18, 0.6))
    ax.add_collection(
        PolyCollection(
            P[F[order], :2],  # type: ignore[arg-type] # an array is documented, and quicker than a list of them
            facecolors=colours,
            edgecolors=colours * lines,
            linewidths=width,
            zorder=1,
        )
    )


def _unit(vectors: Floats) -> Floats:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.where(lengths > 0, lengths, 1.0))
