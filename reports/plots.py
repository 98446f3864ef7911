"""Interactive plots of a run, as the JSON that plotly draws; colours that colour-blind readers can tell apart."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go

from reports.curves import COLOURS, TrainingCurves
from reports.heatmap import displacements
from reports.ladder import Cell
from reports.tables import Table, TableRow
from reports.trust import TrustData

PERCENTILES = ("latency_p50", "latency_p90", "latency_p99", "latency_max")


@dataclass(frozen=True)
class Plot:
    """One plot: its element's id, what it shows in words, and plotly's figure as JSON safe to stand in a page."""

    anchor: str
    title: str
    json: str


def plot_of(anchor: str, title: str, figure: go.Figure) -> Plot:
    """A figure for the page; markup in names cannot end the script element that holds it."""
    figure.update_layout(title={"text": title, "font": {"size": 14}}, margin={"l": 60, "r": 20, "t": 60, "b": 50})
    figure.update_layout(template="none", legend={"font": {"size": 11}})
    text = str(figure.to_json())
    for sign in "<>&":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return Plot(anchor, title, text)


def plain(text: str) -> str:
    """Text that plotly shows as it is: it knows some markup of its own."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def pareto(table: Table) -> go.Figure | None:
    """Content against style recognition of every finished row; dashed: rows that no other beats in both.

    None where the table has no such numbers.
    """
    points = [(row, _value(row, "cra"), _value(row, "sra")) for row in table.rows]
    known = [(row, x, y) for row, x, y in points if x is not None and y is not None]
    if not known:
        return None
    figure = go.Figure()
    for section, colour, symbol in (("methods", COLOURS[0], "circle"), ("anchors", "#888888", "square")):
        own = [item for item in known if item[0].section == section]
        figure.add_scatter(
            x=[x for _, x, _ in own], y=[y for _, _, y in own], text=[plain(row.title) for row, _, _ in own],
            mode="markers+text", textposition="top center", textfont={"size": 10}, name=section,
            marker={"color": colour, "symbol": symbol, "size": 10},
            hovertemplate="%{text}<br>CRA %{x:.1f} %, SRA %{y:.1f} %<extra></extra>",
        )  # fmt: skip
    methods = [(x, y) for row, x, y in known if row.section == "methods"]
    front = sorted(p for p in methods if not any(q != p and q[0] >= p[0] and q[1] >= p[1] for q in methods))
    if len(front) > 1:
        figure.add_scatter(
            x=[x for x, _ in front], y=[y for _, y in front], mode="lines", name="front of the methods",
            line={"color": COLOURS[0], "dash": "dash", "width": 1}, hoverinfo="skip",
        )  # fmt: skip
    figure.update_xaxes(title="content recognition (CRA), %", range=[-4, 104])
    figure.update_yaxes(title="style recognition (SRA), %", range=[-4, 108])
    return figure


def latencies(table: Table) -> go.Figure | None:
    """Median to slowest call frame by frame, a line a row; None where nothing was timed online."""
    found = []
    for row in table.rows:
        values = [measured(row, name, "online") for name in PERCENTILES]
        if values[0] is not None:
            found.append((row.title, values))
    if not found:
        return None
    figure = go.Figure()
    for number, (title, values) in enumerate(sorted(found, key=lambda item: item[1][0] or 0.0)):
        figure.add_scatter(
            x=values, y=[plain(title)] * len(values), mode="lines+markers", showlegend=False,
            marker={"symbol": ["circle", "line-ns-open", "diamond", "x"], "size": 9},
            line={"color": COLOURS[number % 6]}, text=["p50", "p90", "p99", "max"],
            hovertemplate="%{y} %{text}: %{x:.3g} ms<extra></extra>",
        )  # fmt: skip
    for fps in (30, 60, 120):
        deadline_ms = 1000.0 / fps
        figure.add_vline(x=deadline_ms, line={"dash": "dot", "width": 1, "color": "#888888"})
        # Words on a logarithmic axis are placed by the exponent, lines by the value.
        figure.add_annotation(
            x=math.log10(deadline_ms), y=1.0, yref="paper", yanchor="bottom", text=f"{fps}", showarrow=False
        )
    figure.update_xaxes(title="one frame online, ms: median, p90, p99, slowest", type="log", dtick=1)
    figure.update_layout(height=140 + 28 * len(found))
    return figure


def distances_by_n(data: TrustData) -> go.Figure:
    """Distances against the number of samples, with the floor of real motion against real motion."""
    figure = go.Figure()
    metrics = list(dict.fromkeys(curve.metric for curve in data.curves))
    methods = list(dict.fromkeys(curve.method for curve in data.curves))
    for curve in data.curves:
        floor = curve.method == "floor"
        figure.add_scatter(
            x=list(curve.n), y=list(curve.mean), mode="lines+markers", name=f"{plain(curve.title)}, {curve.metric}",
            line={
                "color": "#888888" if floor else COLOURS[methods.index(curve.method) % len(COLOURS)],
                "dash": ["solid", "dash", "dot"][metrics.index(curve.metric) % 3],
                "width": 3 if floor else 1.5,
            },
        )  # fmt: skip
    figure.update_xaxes(title="samples", type="log")
    figure.update_yaxes(title="distance", type="log")
    return figure


def confusion(labels: Sequence[str], counts: Sequence[Sequence[int]]) -> go.Figure:
    """What a judge makes of real motion; rows are the truth, percent of each."""
    table = np.array(counts, dtype=np.float64)
    shares = 100.0 * table / np.maximum(table.sum(axis=1, keepdims=True), 1.0)
    names = [plain(label) for label in labels]
    figure = go.Figure(
        go.Heatmap(
            z=shares[::-1], x=names, y=names[::-1], colorscale="Blues", zmin=0, zmax=100,
            text=[[f"{v:.0f}" if v >= 0.5 else "" for v in row] for row in shares[::-1]], texttemplate="%{text}",
            hovertemplate="%{y} judged %{x}: %{z:.1f} %<extra></extra>",
        )
    )  # fmt: skip
    figure.update_xaxes(title="judged")
    figure.update_yaxes(title="true")
    return figure


def ladder(cells: Sequence[Cell]) -> go.Figure:
    """Corruption ladder: change of each metric from real motion to the last level, towards the worse in orange."""
    metrics = list(dict.fromkeys(cell.metric for cell in cells))
    names = list(dict.fromkeys(cell.ladder for cell in cells))
    found = {(cell.metric, cell.ladder): cell for cell in cells}
    grid = [[_change(found.get((metric, name))) for name in names] for metric in reversed(metrics)]
    figure = go.Figure(
        go.Heatmap(
            z=grid, x=[plain(n) for n in names], y=[plain(m) for m in reversed(metrics)], zmid=0.0, zmin=-1.0, zmax=1.0,
            colorscale=[[0.0, "#0072B2"], [0.5, "#f7f7f7"], [1.0, "#D55E00"]],
            hovertemplate="%{y} under %{x}: %{z:.2f} of its range<extra></extra>",
        )
    )  # fmt: skip
    figure.update_layout(height=220 + 17 * len(metrics))
    return figure


def joints_moved(table: Table) -> go.Figure | None:
    """Which joints move when one part is transferred, a block a row; None where that was not measured."""
    rows = [(row, found) for row in table.rows if (found := displacements(row))]
    if not rows:
        return None
    joints = list(next(iter(rows[0][1].values())))
    labels, grid = [], []
    for row, parts in rows:
        for part, values in parts.items():
            labels.append(f"{plain(row.title)}: {part}")
            grid.append([float(np.sqrt(values[joint])) for joint in joints])
    figure = go.Figure(
        go.Heatmap(
            z=grid[::-1], x=joints, y=labels[::-1], colorscale="Blues",
            hovertemplate="%{y}, %{x}: %{z:.3f} statures<extra></extra>",
        )
    )  # fmt: skip
    figure.update_layout(height=180 + 20 * len(labels))
    return figure


def training(curves: Sequence[TrainingCurves]) -> go.Figure:
    """Losses over steps; a click on a name hides its line."""
    figure = go.Figure()
    for number, curve in enumerate(curves):
        for place, name in enumerate(curve.names):
            values = curve.values[:, place]
            known = np.isfinite(values)
            figure.add_scatter(
                x=curve.steps[known].tolist(), y=values[known].tolist(), mode="lines",
                name=f"{plain(name)}, {plain(curve.label)}",
                line={"color": COLOURS[place % 7], "dash": ["solid", "dash", "dot"][number % 3], "width": 1.3},
            )  # fmt: skip
    figure.update_xaxes(title="steps")
    figure.update_yaxes(title="loss", type="log")
    return figure


def of_ladders(stored: Mapping[str, Sequence[Cell]]) -> list[tuple[str, go.Figure]]:
    """The ladders of every dataset, titled."""
    return [(f"Corruption ladder, {dataset}", ladder(cells)) for dataset, cells in stored.items()]


def _change(cell: Cell | None) -> float | None:
    if cell is None or not np.isfinite(cell.worsening):
        return None
    return cell.worsening if cell.worsening != 0.0 else cell.change


def _value(row: TableRow, metric: str) -> float | None:
    found = [estimate for key, estimate in row.estimates.items() if key.startswith(f"{metric}|")]
    return found[0].value if found else None


def measured(row: TableRow, metric: str, slice_name: str) -> float | None:
    """Mean of a measurement over a row's records; None where none has it."""
    values = [m.value for m in row.row.measurements(metric, slice_name) if m.value is not None]
    return float(np.mean(values)) if values else None
