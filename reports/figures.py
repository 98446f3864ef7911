"""Figures from tables: content against style recognition, and interval bars. Colour-blind safe, no pyplot state."""

from __future__ import annotations

import io
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from textwrap import fill
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Annotation
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from reports.aggregate import Estimate
from reports.context import judge_summary
from reports.formatting import ARROWS, number
from reports.labels import place_labels
from reports.records import BadRecord, write_bytes_atomically
from reports.tables import Column, Table, TableRow

Kind = Literal["method", "copies", "anchor"]
# Okabe and Ito (2008), "Color Universal Design": told apart with every common form of colour blindness.
COLOURS: dict[Kind, str] = {"method": "#0072B2", "copies": "#D55E00", "anchor": "#666666"}
MARKERS: dict[Kind, str] = {"method": "o", "copies": "X", "anchor": "s"}
KIND_TITLES: dict[Kind, str] = {"method": "method", "copies": "copies (no rank)", "anchor": "anchor row"}
STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 11.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.5,
    "figure.dpi": 150.0,
    "savefig.dpi": 150.0,
    # A dollar in a name is a dollar.
    "text.parse_math": False,
    "svg.hashsalt": "stylebench",
}
CAPTION_COLUMNS = 120


def styled() -> AbstractContextManager[None]:
    """The look of all figures, whatever the reader's own settings are."""
    return mpl.rc_context({**mpl.rcParamsDefault, **STYLE, "backend": mpl.rcParams["backend"]})


def plain_log(axis: Axis) -> None:
    """Labels of a logarithmic axis as plain numbers: powers in mathematical notation would be shown as their source."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def recognition_scatter(table: Table) -> Figure:
    """Content recognition (x) against style recognition (y) of all finished rows; filled by joint recognition.

    Grey corner lines mark where joint recognition can be 20, 40, 60, 80 % at most: it is never above the smaller of
    the two, so a copy of either input stays in a corner.

    Raises
    ------
    BadRecord : the table has no row with both numbers.
    """
    content, style = _column(table, "cra"), _column(table, "sra")
    joint = _column(table, "joint_recognition")
    rows = [row for row in table.rows if _value(row, content) is not None and _value(row, style) is not None]
    if not rows:
        raise BadRecord(f"{table.title}: no row has content and style recognition to draw")
    with styled():
        figure, axes = _canvas(8.2, 7.0)
        _iso_hint(axes)
        points = np.array([[_value(row, content), _value(row, style)] for row in rows], dtype=np.float64)
        fill = [_value(row, joint) for row in rows]
        _draw_points(figure, axes, rows, points, [np.nan if value is None else value for value in fill])
        # Room on the right, where the labels of the best rows go.
        axes.set(xlim=(-5.0, 122.0), ylim=(-5.0, 106.0), xticks=range(0, 101, 20), xlabel="content recognition CRA (%)")
        axes.set(ylabel="style recognition SRA (%)", title="Who gets content and style right")
        axes.set_aspect("equal")
        # Above the axes: every place inside may hold points.
        axes.legend(
            handles=_legend(rows),
            loc="lower right",
            bbox_to_anchor=(1.0, 1.0),
            ncols=3,
            fontsize=8.0,
            frameon=False,
            borderaxespad=0.2,
        )
        _caption(figure, table, content, rows)
        figure.draw_without_rendering()
        place_labels(axes, points, [_annotate(axes, row, point) for row, point in zip(rows, points, strict=True)])
    return figure


def interval_bars(table: Table, metric: str | None = None) -> Figure:
    """One number of all finished rows with its 95 % intervals, in the table's order; the primary one by default.

    Raises
    ------
    BadRecord : the table has no such column, or no row with a value in it.
    """
    column = table.primary if metric is None else _column(table, metric)
    if column is None:
        raise BadRecord(f"{table.title}: no finished row to draw")
    rows = [row for row in table.rows if _value(row, column) is not None]
    if not rows:
        raise BadRecord(f"{table.title}: no row has a value of {column.title} to draw")
    with styled():
        figure, axes = _canvas(7.6, 1.9 + 0.25 * len(rows))
        for place, row in enumerate(rows):
            _draw_interval(axes, place, row, row.estimates[column.key])
        floor = _floor_line(axes, column, rows)
        n_methods = sum(row.section == "methods" for row in rows)
        if 0 < n_methods < len(rows):
            axes.axhline(n_methods - 0.5, color="#999999", linewidth=0.8)
        axes.set_yticks(range(len(rows)), [_row_label(row) for row in rows])
        axes.set_ylim(len(rows) - 0.4, -0.6)
        axes.grid(axis="x", color="#E5E5E5", linewidth=0.7)
        axes.set_axisbelow(True)
        unit = "" if column.unit in ("1", "distance") else f" ({column.unit})"
        axes.set(xlabel=f"{column.title}{unit} {ARROWS[column.better]}", title=_headline(column))
        axes.legend(handles=[*_legend(rows), *floor], loc="best", frameon=True, framealpha=0.9, edgecolor="none")
        _caption(figure, table, column, rows)
    return figure


def save_figure(figure: Figure, path: Path) -> None:
    """Write PNG, PDF or SVG by the suffix; the same figure gives the same bytes.

    Raises
    ------
    ValueError : another suffix.
    """
    metadata: dict[str, dict[str, None]] = {
        "png": {"Software": None},
        "pdf": {"CreationDate": None, "Producer": None},
        "svg": {"Date": None},
    }
    form = path.suffix.lower().lstrip(".")
    if form not in metadata:
        raise ValueError(f"{path}: a figure is saved as .png, .pdf or .svg, not {path.suffix or 'without a suffix'}")
    buffer = io.BytesIO()
    with styled():
        figure.savefig(buffer, format=form, metadata=metadata[form])
    write_bytes_atomically(path, buffer.getvalue())


def _canvas(width_in: float, height_in: float) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.add_subplot()


def _column(table: Table, metric: str) -> Column:
    for column in table.columns:
        if column.metric == metric:
            return column
    raise BadRecord(f"{table.title}: no column {metric}; there are {', '.join(c.metric for c in table.columns)}")


def _value(row: TableRow, column: Column) -> float | None:
    found = row.estimates.get(column.key)
    return None if found is None else found.value


def _kind(row: TableRow) -> Kind:
    if row.row.method.kind == "anchor":
        return "anchor"
    return "copies" if row.row.copies else "method"


def _row_label(row: TableRow) -> str:
    title = row.title if len(row.title) <= 34 else row.title[:33] + "…"
    return title if row.rank is None else f"{title}  #{row.rank}"


def _iso_hint(axes: Axes) -> None:
    for level in (20.0, 40.0, 60.0, 80.0):
        axes.plot([level, level, 100.0], [100.0, level, level], color="#DDDDDD", linewidth=0.9, zorder=0)
        axes.text(100.5, level, f"joint ≤ {level:.0f}", color="#AAAAAA", fontsize=6.5, va="center", ha="left", zorder=0)


def _draw_points(
    figure: Figure, axes: Axes, rows: Sequence[TableRow], points: NDArray[np.float64], fill: Sequence[float]
) -> None:
    values = np.asarray(fill, dtype=np.float64)
    for kind in MARKERS:
        chosen = np.array([_kind(row) == kind for row in rows])
        if not chosen.any():
            continue
        drawn = axes.scatter(
            points[chosen, 0],
            points[chosen, 1],
            c=values[chosen],
            marker=MARKERS[kind],
            s=75.0 if kind != "anchor" else 42.0,
            cmap="cividis",
            vmin=0.0,
            vmax=100.0,
            edgecolors=COLOURS[kind],
            linewidths=1.6 if kind != "anchor" else 0.9,
            plotnonfinite=True,
            zorder=4 if kind != "anchor" else 3,
        )
    bar = figure.colorbar(drawn, ax=axes, shrink=0.6, pad=0.02)
    bar.set_label("joint recognition (%)")


def _annotate(axes: Axes, row: TableRow, point: NDArray[np.float64]) -> Annotation:
    kind = _kind(row)
    return axes.annotate(
        _row_label(row),
        (float(point[0]), float(point[1])),
        xytext=(8.0, 0.0),
        textcoords="offset points",
        fontsize=7.0 if kind == "anchor" else 8.0,
        fontweight="normal" if kind == "anchor" else "bold",
        color=COLOURS[kind],
        arrowprops={"arrowstyle": "-", "color": "#AAAAAA", "linewidth": 0.6, "shrinkA": 0.0, "shrinkB": 3.0},
        zorder=5,
    )


def _draw_interval(axes: Axes, place: int, row: TableRow, found: Estimate) -> None:
    kind = _kind(row)
    if found.low is not None and found.high is not None:
        axes.plot([found.low, found.high], [place, place], color=COLOURS[kind], linewidth=2.2, solid_capstyle="butt")
    axes.plot(
        [np.nan if found.value is None else found.value],
        [place],
        marker=MARKERS[kind],
        color=COLOURS[kind],
        markersize=6.0,
        linestyle="none",
    )


def _floor_line(axes: Axes, column: Column, rows: Sequence[TableRow]) -> list[Line2D]:
    """A dotted line at the floor, returned for the legend; nothing where the number has no floor."""
    floors = [row.estimates[column.key].floor for row in rows]
    known = [floor for floor in floors if floor is not None]
    if not known:
        return []
    line = axes.axvline(max(known), color="#000000", linewidth=0.9, linestyle=":", zorder=0)
    line.set_label(f"floor: real against real {number(max(known), column.unit)}")
    return [line]


def _headline(column: Column) -> str:
    return column.title[:1].upper() + column.title[1:] + " with 95 % intervals"


def _legend(rows: Sequence[TableRow]) -> list[Line2D]:
    present = {_kind(row) for row in rows}
    return [
        Line2D([], [], linestyle="none", marker=MARKERS[kind], color=COLOURS[kind], markersize=6.0, label=title)
        for kind, title in KIND_TITLES.items()
        if kind in present
    ]


def _caption(figure: Figure, table: Table, column: Column, rows: Sequence[TableRow]) -> None:
    counts = sorted({row.estimates[column.key].n for row in rows})
    n = str(counts[0]) if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
    where = "" if column.slice == "all" else f" ({column.slice.replace('_', ' ')})"
    said = ". ".join(words for words in (f"n = {n} samples{where}", judge_summary(table.judges)) if words)
    wrapped = "\n".join(fill(line, CAPTION_COLUMNS) for line in (table.title, f"{said}."))
    figure.supxlabel(wrapped, fontsize=7.5, color="#444444", x=0.01, ha="left")
