"""Plots of the figures, as PNG."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import matplotlib as mpl
from matplotlib.figure import Figure

FOLDER: Final = Path(__file__).parent / "plots"
_SIZE: Final = (7.5, 3.6)  # inches


def bars(
    name: str, title: str, labels: Sequence[str], series: Mapping[str, Sequence[float]], *, unit: str
) -> Path:
    """Draw a group of bars for each label, one bar a series, on a logarithmic scale; 1 is drawn as a line."""
    figure = Figure(figsize=_SIZE, layout="constrained")
    axes = figure.add_subplot()
    width = 0.8 / len(series)
    for number, (what, values) in enumerate(series.items()):
        places = [i + (number - (len(series) - 1) / 2) * width for i in range(len(labels))]
        drawn = axes.bar(places, values, width, label=what)
        axes.bar_label(drawn, [f"{value:.2g}" for value in values], fontsize=7)
    axes.axhline(1, color="black", linewidth=0.8)
    axes.set_yscale("log")
    axes.set_xticks(range(len(labels)), labels)
    axes.set_title(title)
    axes.set_ylabel(unit)
    axes.legend(fontsize=8)
    return _saved(figure, name)


def lines(
    name: str, title: str, sizes: Sequence[int], series: Mapping[str, Sequence[float]], *, unit: str
) -> Path:
    """Draw figures against numbers of vertices, these on a logarithmic scale."""
    figure = Figure(figsize=_SIZE, layout="constrained")
    axes = figure.add_subplot()
    for what, values in series.items():
        axes.plot(sizes, values, marker="o", markersize=4, label=what)
    axes.set_xscale("log")
    axes.set_ylim(bottom=0)
    axes.set_xlabel("vertices")
    axes.set_ylabel(unit)
    axes.set_title(title)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    return _saved(figure, name)


def panels(
    name: str,
    title: str,
    labels: Sequence[str],
    figures: Mapping[str, Mapping[str, Sequence[float | None]]],
) -> Path:
    """Draw dots over the labels, a panel a figure and a colour a series; what is None is left out.

    Scales are logarithmic; where a figure may be 0, linear below its least other value.
    """
    figure = Figure(figsize=(max(7.5, 1.5 + 0.6 * len(labels)), 2.1 * len(figures) + 1), layout="constrained")
    figure.suptitle(title)
    rows = figure.subplots(len(figures), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (what, series) in zip(rows, figures.items(), strict=True):
        for number, (of, values) in enumerate(series.items()):
            there = [(i, value) for i, value in enumerate(values) if value is not None]
            aside = 0.12 * (number - (len(series) - 1) / 2)
            axes.plot([i + aside for i, _ in there], [v for _, v in there], "o", markersize=5, label=of)
        positive = [v for values in series.values() for v in values if v is not None and v > 0]
        if any(v is not None and v <= 0 for values in series.values() for v in values):
            axes.set_yscale("symlog", linthresh=min(positive, default=1))
        else:
            axes.set_yscale("log")
        axes.set_ylabel(what, fontsize=8)
        axes.grid(alpha=0.3)
    rows[-1].set_xlim(-0.6, len(labels) - 0.4)
    rows[-1].set_xticks(range(len(labels)), labels, rotation=30, ha="right")
    figure.legend(*rows[0].get_legend_handles_labels(), loc="outside lower center", ncols=6, fontsize=8)
    return _saved(figure, name)


def _saved(figure: Figure, name: str) -> Path:
    FOLDER.mkdir(exist_ok=True)
    path = FOLDER / f"{name}.png"
    with mpl.rc_context({"svg.hashsalt": name}):
        figure.savefig(path, dpi=110, metadata={"Software": None})
    return path
