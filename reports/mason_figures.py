"""Pictures of style modelling: phases of limbs over time, and where styles lie before and after one is learned."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from reports.figures import styled

Array = NDArray[np.float64]
SEEN, NEW = "#9ecae1", "#D55E00"


@dataclass(frozen=True, eq=False)
class LimbPhase:
    """One limb over one take.

    Attributes
    ----------
    source : ``[T]`` source function.
    phase : ``[T]`` cycles. magnitude : ``[T]`` of the phase features.
    contacts : ``[T]`` whether it stands; None for limbs without contacts.
    """

    source: Array
    phase: Array
    magnitude: Array
    contacts: NDArray[np.bool_] | None


def phase_figure(takes: Mapping[str, Mapping[str, LimbPhase]], fps: float) -> Figure:
    """A column a take, a row a limb: source function as a line, phase as dots that fade where it means little.

    After Mason 2022, Figure 4: green bars are floor contacts.
    """
    limbs = list(next(iter(takes.values())))
    with styled():
        figure = Figure(figsize=(4.2 * len(takes), 1.45 * len(limbs) + 0.6), layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(len(limbs), len(takes), squeeze=False, sharex="col")
        top = max(float(limb.magnitude.max()) for take in takes.values() for limb in take.values())
        for column, (title, take) in enumerate(takes.items()):
            for row, name in enumerate(limbs):
                limb, panel = take[name], panels[row, column]
                seconds = np.arange(len(limb.source)) / fps
                panel.plot(seconds, limb.source, color="#444444", linewidth=1.0)
                panel.set_ylim(-2.6, 2.6)
                strength = 0.15 + 0.85 * np.clip(limb.magnitude / top, 0.0, 1.0)
                panel.scatter(seconds, 4.0 * limb.phase - 2.0, s=5, color="#0072B2", alpha=strength, linewidths=0)
                if limb.contacts is not None:
                    panel.fill_between(seconds, -2.6, -2.3, where=list(limb.contacts), color="#009E73", linewidth=0)
                panel.set_yticks([-2.0, 2.0], ["0", "1"])
                if column == 0:
                    panel.set_ylabel(name)
                if row == 0:
                    panel.set_title(title)
            panels[-1, column].set_xlabel("seconds")
        figure.supylabel("phase, cycles (dots); source function (line)", fontsize=8)
    return figure


def style_space_figure(
    before: Array, after: Array, styles: Sequence[str], new_styles: Sequence[str], shares: tuple[float, float]
) -> Figure:
    """FiLM parameters of clips in the plane, before and after new styles were learned (Mason 2022, Figure 11).

    Parameters
    ----------
    before, after : ``[N, 2]`` places. styles : ``[N]`` of the clips.
    new_styles : drawn in orange. shares : of the clips of new styles whose nearest neighbour has the same style.
    """
    labels = np.array(styles)
    with styled():
        figure = Figure(figsize=(10.0, 4.8), layout="constrained")
        FigureCanvasAgg(figure)
        for panel, places, title, share in zip(
            figure.subplots(1, 2), (before, after), ("before fine-tuning", "after fine-tuning"), shares, strict=True
        ):
            for style in sorted(set(styles)):
                rows = labels == style
                new = style in new_styles
                panel.scatter(*places[rows].T, s=14, color=NEW if new else SEEN, edgecolor="#222222", linewidth=0.2)
                panel.annotate(
                    style, np.median(places[rows], axis=0), ha="center", fontsize=8, weight="bold" if new else "normal"
                )
            panel.set_title(f"{title}:\n{100 * share:.0f} % of new clips nearest to their own style", fontsize=10)
            panel.set_xticks([])
            panel.set_yticks([])
    return figure
