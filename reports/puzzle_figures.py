"""Pictures of Motion Puzzle 2022: where attention looks (Figure 9), what moves when one part is restyled (Table 1)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from reports.figures import styled

Array = NDArray[np.float64]


def attention_figure(pairs: Mapping[str, Mapping[str, Array]], fps: float) -> Figure:
    """A row a pair of motions, a panel a part; brightness is the share of attention times the number of style frames.

    Parameters
    ----------
    pairs : title of a pair -> part -> ``[T, T']``, content by style frames; 1 on the scale is attention spread evenly.
    """
    parts = list(next(iter(pairs.values())))
    with styled():
        figure = Figure(figsize=(2.3 * len(parts) + 1.0, 2.6 * len(pairs) + 0.5), layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(len(pairs), len(parts), squeeze=False)
        for (title, maps), row in zip(pairs.items(), panels, strict=True):
            for part, panel in zip(parts, row, strict=True):
                shares = maps[part] * maps[part].shape[1]
                n_content, n_style = shares.shape
                drawn = panel.imshow(
                    shares, extent=(0.0, n_style / fps, n_content / fps, 0.0), cmap="magma", vmin=0.0, vmax=4.0,
                    aspect="auto", interpolation="nearest",
                )  # fmt: skip
                panel.set_title(part.replace("_", " "), fontsize=9)
                panel.grid(visible=False)
            row[0].set_ylabel(f"{title}\ncontent (s)")
            row[len(parts) // 2].set_xlabel("style (s)")
        bar = figure.colorbar(drawn, ax=panels, shrink=0.8, pad=0.01)
        bar.set_label("attention (1: spread evenly)")
    return figure


def part_change_figure(changes: Mapping[str, Mapping[str, Mapping[str, float]]]) -> Figure:
    """A panel a method: restyled part (down) by body part that changes (across), in degrees; written into each field.

    Parameters
    ----------
    changes : title -> restyled part -> observed part -> mean change of joint rotations in degrees.
    """
    top = max(value for method in changes.values() for row in method.values() for value in row.values())
    with styled():
        figure = Figure(figsize=(3.1 * len(changes) + 0.6, 3.1), layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(1, len(changes), squeeze=False)[0]
        for (title, method), panel in zip(changes.items(), panels, strict=True):
            restyled, observed = list(method), list(next(iter(method.values())))
            degrees = np.array([[method[row][column] for column in observed] for row in restyled])
            panel.imshow(degrees, cmap="Blues", vmin=0.0, vmax=top)
            panel.set_xticks(range(len(observed)), observed)
            panel.set_yticks(range(len(restyled)), restyled)
            panel.set_title(title, fontsize=9)
            panel.set_xlabel("change of rotations (degrees) in")
            panel.grid(visible=False)
            for (row, column), value in np.ndenumerate(degrees):
                shade = "white" if value > 0.6 * top else "black"
                panel.text(column, row, f"{value:.1f}", ha="center", va="center", color=shade)
        panels[0].set_ylabel("style given to")
    return figure
