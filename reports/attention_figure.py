"""Attention maps of body parts (Motion Puzzle 2022, Figure 9): a panel a part, a row a frame of the content."""

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
