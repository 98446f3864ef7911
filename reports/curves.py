"""Loss curves of trainings: one panel a loss, one line a seed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from reports.figures import plain_log, styled
from reports.records import BadRecord

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe and Ito (2008)."""
MOST_COLUMNS = 4


@dataclass(frozen=True, eq=False)
class TrainingCurves:
    """Losses of one training.

    Attributes
    ----------
    label : of its line, for example ``seed 0``.
    names : of the losses.
    steps : ``[n]`` optimiser steps.
    values : ``[n, len(names)]`` mean losses up to each step since the one before; NaN where not computed.
    """

    label: str
    names: tuple[str, ...]
    steps: NDArray[np.int64]
    values: NDArray[np.float64]


def loss_figure(title: str, trainings: Sequence[TrainingCurves]) -> Figure:
    """A panel for each loss; logarithmic where a loss is positive and falls over more than a decade.

    Raises
    ------
    BadRecord : nothing to draw.
    """
    names = list(dict.fromkeys(name for training in trainings for name in training.names))
    if not names:
        raise BadRecord(f"{title}: no losses to draw")
    n_columns = min(MOST_COLUMNS, len(names))
    n_rows = math.ceil(len(names) / n_columns)
    with styled():
        figure = Figure(figsize=(3.1 * n_columns + 0.4, 2.3 * n_rows + 0.7), layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(n_rows, n_columns, squeeze=False).ravel()
        for panel, name in zip(panels, names, strict=False):
            drawn = []
            for colour, training in zip(COLOURS * len(trainings), trainings, strict=False):
                if name in training.names:
                    values = training.values[:, training.names.index(name)]
                    known = np.isfinite(values)
                    panel.plot(training.steps[known], values[known], color=colour, linewidth=1.0, label=training.label)
                    drawn.append(values[known])
            seen = np.concatenate(drawn)
            if len(seen) and seen.min() > 0.0 and seen.max() > 10.0 * seen.min():
                panel.set_yscale("log")
                plain_log(panel.yaxis)
            panel.set_title(name, fontsize=9.0)
            panel.tick_params(labelsize=7.0)
            panel.xaxis.set_major_locator(MaxNLocator(4))
        for panel in panels[len(names) :]:
            panel.set_visible(False)
        for panel in panels[max(len(names) - n_columns, 0) : len(names)]:
            panel.set_xlabel("optimiser steps", fontsize=8.0)
        if len(trainings) > 1:
            panels[0].legend(fontsize=7.0, frameon=False)
        figure.suptitle(title, fontsize=11.0, x=0.01, ha="left", fontweight="bold")
    return figure


def save_losses(path: Path, title: str, trainings: Sequence[TrainingCurves]) -> None:
    """Write :func:`loss_figure` as a PNG."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with styled():
        loss_figure(title, trainings).savefig(path)
