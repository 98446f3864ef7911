"""Figure of the corruption ladder: what every metric makes of every corruption, one panel a dataset."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patches import Rectangle

from reports.figures import styled
from reports.ladder import Cell

SIGNS = {"up": "▲", "down": "▼", "flat": "·", "mixed": "~", "undefined": "–"}
INK_ON_DARK_FROM = 0.6


def ladder_figure(panels: Mapping[str, Sequence[Cell]]) -> Figure:
    """Colour: worse (orange) or better (purple) at the last level, as a share of the metric's range.

    Signs say which way the number goes; metrics without a good direction have signs only. A grey frame marks a declared
    blind spot, a black one a contradiction.
    """
    metrics = list(dict.fromkeys(cell.metric for cells in panels.values() for cell in cells))
    ladders = list(dict.fromkeys(cell.ladder for cells in panels.values() for cell in cells))
    with styled():
        size = (2.4 + 4.6 * len(panels), 2.0 + 0.2 * len(metrics))
        figure = Figure(figsize=size, layout="constrained")
        FigureCanvasAgg(figure)
        grid = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
        drawn = [
            _panel(axes, title, cells, metrics, ladders)
            for axes, (title, cells) in zip(grid, panels.items(), strict=True)
        ]
        grid[0].set_yticks(range(len(metrics)), metrics, fontsize=7.5)
        bar = figure.colorbar(drawn[-1], ax=list(grid), shrink=0.4, pad=0.01, aspect=30)
        bar.set_label("at the last level: better (−) or worse (+), share of the metric's range")
        figure.suptitle("What metrics make of corrupted real motion", x=0.01, ha="left", fontweight="bold")
        figure.supxlabel(
            "▲ rises  ▼ falls  · stays  ~ neither  – undefined    grey frame: declared blind spot    "
            "black frame: contradicts its declaration",
            fontsize=8.0,
        )
    return figure


def _panel(axes: Axes, title: str, cells: Sequence[Cell], metrics: list[str], ladders: list[str]) -> AxesImage:
    worsening = np.full((len(metrics), len(ladders)), np.nan)
    for cell in cells:
        worsening[metrics.index(cell.metric), ladders.index(cell.ladder)] = cell.worsening
    drawn = axes.imshow(np.clip(worsening, -1.0, 1.0), cmap="PuOr_r", vmin=-1.0, vmax=1.0, aspect="auto")
    for cell in cells:
        row, column = metrics.index(cell.metric), ladders.index(cell.ladder)
        ink = "white" if abs(cell.worsening) > INK_ON_DARK_FROM else "black"
        axes.text(column, row, SIGNS[cell.observed], ha="center", va="center", fontsize=6.5, color=ink)
        if cell.contradiction or cell.claim == "blind":
            colour, width = ("black", 1.6) if cell.contradiction else ("#666666", 1.0)
            frame = Rectangle((column - 0.44, row - 0.42), 0.88, 0.84, fill=False, edgecolor=colour, linewidth=width)
            axes.add_patch(frame)
    axes.set_xticks(range(len(ladders)), ladders, rotation=60, ha="right", fontsize=8.0)
    axes.set_title(title, fontsize=9.5)
    axes.tick_params(length=0.0)
    for side in axes.spines.values():
        side.set_visible(False)
    return drawn
