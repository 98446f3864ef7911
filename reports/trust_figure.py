"""Figure of the trust page: a Frechet distance against the number of samples, with its floor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

from reports.figures import plain_log, styled
from reports.records import BadRecord
from reports.trust import Curve, TrustData

METRIC = "fmd[stgcn-content]"
FLOOR = "floor"
FEATURES = 64
"""Below twice as many samples as features the tables give a reason instead of a Frechet distance."""
# Okabe and Ito (2008): told apart with every common form of colour blindness.
PALETTE = ("#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9", "#8A6D00")
MARKERS = "osD^vPX"


def sample_size_figure(found: Sequence[TrustData]) -> Figure:
    """One panel a dataset: the distance of random subsets from the real part, both axes logarithmic.

    Raises
    ------
    BadRecord : no curve to draw.
    """
    drawn = [(data, [curve for curve in data.curves if curve.metric == METRIC]) for data in found]
    drawn = [(data, curves) for data, curves in drawn if curves]
    if not drawn:
        raise BadRecord("no curve of a distance against n to draw")
    names = list(dict.fromkeys(curve.method for _, curves in drawn for curve in curves if curve.method != FLOOR))
    with styled():
        figure = Figure(figsize=(4.9 * len(drawn), 4.9), layout="constrained")
        FigureCanvasAgg(figure)
        panels = cast(NDArray[np.object_], np.atleast_1d(np.asarray(figure.subplots(1, len(drawn), sharey=True))))
        for axes, (data, curves) in zip(panels, drawn, strict=True):
            for curve in curves:
                _draw(axes, curve, names)
            _dress(axes, data, curves)
        panels[0].set_ylabel("FMD in content features, against the real part ↓")
        lines = [line for axes in panels for line in axes.lines if not str(line.get_label()).startswith("_")]
        handles = {line.get_label(): line for line in lines}
        figure.legend(list(handles.values()), list(handles), loc="outside lower center", ncols=3, frameon=False,
                      fontsize=8.0)  # fmt: skip
        figure.suptitle("How much of a Fréchet distance is the size of the set", x=0.01, ha="left", fontweight="bold")
    return figure


def _draw(axes: Axes, curve: Curve, names: Sequence[str]) -> None:
    n, mean, sd = (np.asarray(values, dtype=np.float64) for values in (curve.n, curve.mean, curve.sd))
    colour, line, marker = "black", "--", "s"
    if curve.method != FLOOR:
        place = names.index(curve.method)
        colour, line, marker = PALETTE[place % len(PALETTE)], "-", MARKERS[place % len(MARKERS)]
    axes.errorbar(n, mean, yerr=sd, elinewidth=0.9, capsize=0.0, linestyle="none", color=colour)
    axes.plot(n, mean, label=curve.title, linewidth=1.4, markersize=4.0, color=colour, linestyle=line, marker=marker)


def _dress(axes: Axes, data: TrustData, curves: Sequence[Curve]) -> None:
    sizes = curves[0].n
    axes.set(xscale="log", yscale="log", xlabel="n, samples of the row (random subsets)", title=data.dataset)
    axes.set_xticks(sizes, [str(n) for n in sizes], fontsize=8.0)
    axes.set_xlim(sizes[0] * 0.93, sizes[-1] * 1.07)
    axes.axvspan(sizes[0] * 0.93, 2 * FEATURES, color="#EEEEEE", zorder=0)
    axes.text(sizes[0], 1.0, " n < 2 d", transform=axes.get_xaxis_transform(), fontsize=7.5, va="top", color="#777777")
    plain_log(axes.yaxis)
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.grid(axis="y", color="#E5E5E5", linewidth=0.7)
    axes.set_axisbelow(True)
