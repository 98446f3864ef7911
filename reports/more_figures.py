"""Figures for papers of what the page shows interactively: latency frame by frame, and what judges confuse."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from reports.figures import plain_log, styled
from reports.plots import PERCENTILES, measured
from reports.records import BadRecord
from reports.tables import Table

MARKS = ("o", "|", "d", "x")
DEADLINES_FPS = (30, 60, 120)


def latency_figure(table: Table) -> Figure:
    """Median, 90th and 99th percentile and slowest call frame by frame, a line a row, fastest first.

    Raises
    ------
    BadRecord : no row was timed frame by frame.
    """
    found = [(row.title, [measured(row, name, "online") for name in PERCENTILES]) for row in table.rows]
    timed = sorted(
        ((title, values) for title, values in found if None not in values), key=lambda item: item[1][0] or 0.0
    )
    if not timed:
        raise BadRecord(f"{table.title}: no row was timed frame by frame")
    with styled():
        figure = Figure(figsize=(7.6, 1.6 + 0.27 * len(timed)), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots()
        for place, (_, values) in enumerate(timed):
            numbers = [value for value in values if value is not None]
            axes.plot(numbers, [place] * len(numbers), color="#0072B2", linewidth=1.2)
            for value, mark in zip(numbers, MARKS, strict=True):
                axes.plot([value], [place], mark, color="#0072B2", markersize=6)
        for fps in DEADLINES_FPS:
            axes.axvline(1000.0 / fps, color="#999999", linestyle=":", linewidth=1.0)
            axes.annotate(f"{fps} fps", (1000.0 / fps, -0.7), fontsize=7, ha="center")
        axes.set_xscale("log")
        plain_log(axes.xaxis)
        axes.set_yticks(range(len(timed)), [title for title, _ in timed])
        axes.set_ylim(len(timed) - 0.4, -1.0)
        axes.set(xlabel="one frame online, ms: median (o), p90 (|), p99 (diamond), slowest (x)", title=table.title)
    return figure


def confusion_figure(title: str, labels: Sequence[str], counts: Sequence[Sequence[int]]) -> Figure:
    """What a judge makes of real motion; rows are the truth, percent of each."""
    table = np.array(counts, dtype=np.float64)
    shares = 100.0 * table / np.maximum(table.sum(axis=1, keepdims=True), 1.0)
    with styled():
        size = 2.2 + 0.42 * len(labels)
        figure = Figure(figsize=(size + 1.0, size), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots()
        axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=100.0)
        for row, column in np.argwhere(shares >= 0.5):
            shade = "white" if shares[row, column] > 60.0 else "black"
            axes.text(column, row, f"{shares[row, column]:.0f}", ha="center", va="center", fontsize=7, color=shade)
        axes.set_xticks(range(len(labels)), labels, rotation=60, ha="right", fontsize=7)
        axes.set_yticks(range(len(labels)), labels, fontsize=7)
        axes.set(xlabel="judged, % of the true label", ylabel="true", title=title)
    return figure
