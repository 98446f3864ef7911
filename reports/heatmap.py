"""Heat map of the parts track: how far each joint moves when each body part is transferred, row by row."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from numpy.typing import NDArray

from reports.figures import styled
from reports.records import BadRecord
from reports.tables import Table, TableRow

METRIC = "locality_msd"
THRESHOLDS = (0.1, 0.05)
"""The two lists of Motion Puzzle 2022, Table 1."""
Displacements = Mapping[str, Mapping[str, float]]
"""Part -> joint -> mean squared displacement, statures squared."""


def displacements(row: TableRow) -> dict[str, dict[str, float]]:
    """What a row's records say, mean over its seeds; empty where they have no displacements."""
    found: dict[str, list[Mapping[str, float]]] = {}
    for record in row.row.ok:
        for measurement in record.measurements:
            if measurement.name == METRIC:
                found.setdefault(measurement.slice.removeprefix("part="), []).append(measurement.details)
    return {
        part: {joint: float(np.mean([seed[joint] for seed in seeds])) for joint in seeds[0]}
        for part, seeds in found.items()
    }


def part_heatmap(table: Table) -> Figure:
    """One panel a row: transferred part (down) by joint (across), darker is farther; rings mark the paper's lists.

    Raises
    ------
    BadRecord : no row has displacements.
    """
    rows = [(row, found) for row in table.rows if (found := displacements(row))]
    if not rows:
        raise BadRecord(f"{table.title}: no row has displacements to draw")
    top = max(value for _, found in rows for joints in found.values() for value in joints.values())
    with styled():
        figure = Figure(figsize=(9.6, 1.6 + 1.35 * len(rows)), layout="constrained")
        FigureCanvasAgg(figure)
        panels: NDArray[np.object_] = np.atleast_1d(figure.subplots(len(rows), 1, sharex=True))
        for axes, (row, found) in zip(panels, rows, strict=True):
            drawn = _panel(axes, row.title, found, top)
        joints = next(iter(rows[0][1].values()))
        panels[-1].set_xticks(range(len(joints)), list(joints), rotation=60, ha="right", fontsize=7.5)
        bar = figure.colorbar(drawn, ax=list(panels), shrink=0.8, pad=0.01)
        bar.set_label("mean squared displacement (statures²)")
        figure.suptitle("Which joints move when one body part is transferred", x=0.01, ha="left", fontweight="bold")
        first, second = THRESHOLDS
        figure.supxlabel(f"{table.title} · filled ring: over {first}, open ring: over {second}", fontsize=7.5)
    return figure


def _panel(axes: Axes, title: str, found: Displacements, top: float) -> AxesImage:
    parts: Sequence[str] = list(found)
    values = np.array([list(found[part].values()) for part in parts])
    drawn = axes.imshow(values, cmap="Blues", norm=PowerNorm(0.5, 0.0, max(top, 1e-12)), aspect="auto")
    for threshold, face in zip(THRESHOLDS, ("black", "none"), strict=True):
        beyond = values > threshold if face == "black" else (values > threshold) & (values <= THRESHOLDS[0])
        places = np.argwhere(beyond)
        if len(places):
            axes.scatter(places[:, 1], places[:, 0], s=26.0, facecolors=face, edgecolors="black", linewidths=0.9)
    axes.set_yticks(range(len(parts)), parts, fontsize=8.0)
    axes.set_title(title, fontsize=9.0)
    axes.tick_params(length=0.0)
    for side in axes.spines.values():
        side.set_visible(False)
    return drawn
