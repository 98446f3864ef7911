"""Bodies side by side as a GIF or MP4, or pose by pose on a contact sheet."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from reports.figures import styled
from reports.page import Body, PlayerTable
from reports.records import BadRecord

SIDES = {"left": "#0072B2", "right": "#D55E00", "middle": "#444444"}
FORMS = (".gif", ".mp4")
SHEET_FORMS = (".png", ".pdf", ".svg")
INCHES, REACH_M = 2.4, 1.1
SHEET_INCHES, SHEET_POSES = 1.1, 8


def write_movie(player: PlayerTable, sample: int, bodies: Sequence[str], path: Path) -> Path:
    """Draw some bodies of one sample into a file, from the front and a little from the side.

    Raises
    ------
    BadRecord : another suffix, no ffmpeg for MP4, or a body that is not there.
    """
    shown = _bodies(player, bodies)
    if path.suffix.lower() not in FORMS:
        raise BadRecord(f"{path}: a movie is saved as {' or '.join(FORMS)}")
    if path.suffix.lower() == ".mp4" and not FFMpegWriter.isAvailable():
        raise BadRecord(f"{path}: MP4 needs ffmpeg, which is not installed; save a .gif")
    with styled():
        figure = Figure(figsize=(INCHES * len(shown), INCHES * 1.25), layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(1, len(shown), squeeze=False).ravel()
        bones: list[list[Line2D]] = []
        for panel, body in zip(panels, shown, strict=True):
            panel.set_title(body.title, fontsize=8)
            bones.append(_panel(panel, player.sides, 2.2))
        figure.suptitle(f"{player.samples[sample][0]}: {player.samples[sample][1]}", fontsize=9)
        make = PillowWriter if path.suffix.lower() == ".gif" else FFMpegWriter
        writer = make(fps=round(player.fps))
        path.parent.mkdir(parents=True, exist_ok=True)
        with writer.saving(figure, str(path), dpi=90):
            for frame in range(max(len(body.positions_m[sample]) for body in shown)):
                for lines, body in zip(bones, shown, strict=True):
                    _pose(lines, body, sample, frame, player.parents)
                writer.grab_frame()
    return path


def write_sheet(player: PlayerTable, samples: Sequence[int], bodies: Sequence[str], path: Path) -> Path:
    """Draw eight poses, evenly over time, of some bodies of some samples: a row a body, a block a sample.

    Raises
    ------
    BadRecord : another suffix, or a body that is not there.
    """
    shown = _bodies(player, bodies)
    if path.suffix.lower() not in SHEET_FORMS:
        raise BadRecord(f"{path}: a contact sheet is saved as {', '.join(SHEET_FORMS)}")
    with styled():
        n_rows = len(samples) * len(shown)
        figure = Figure(figsize=(SHEET_INCHES * SHEET_POSES, SHEET_INCHES * 1.05 * n_rows), layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(n_rows, SHEET_POSES, squeeze=False)
        for block, sample in enumerate(samples):
            for place, body in enumerate(shown):
                row = panels[block * len(shown) + place]
                frames = np.linspace(0, len(body.positions_m[sample]) - 1, SHEET_POSES).round().astype(int)
                for panel, frame in zip(row, frames, strict=True):
                    _pose(_panel(panel, player.sides, 1.4), body, sample, int(frame), player.parents)
                said = f"{player.samples[sample][0]}: {player.samples[sample][1]}\n" if place == 0 else ""
                row[0].set_title(f"{said}{body.title}", fontsize=7, loc="left")
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=110)
    return path


def _bodies(player: PlayerTable, names: Sequence[str]) -> list[Body]:
    missing = [name for name in names if name not in player.bodies]
    if missing:
        raise BadRecord(f"no body {missing[0]!r}; there are {', '.join(player.bodies)}")
    return [player.bodies[name] for name in names]


def _panel(panel: Axes, sides: Sequence[str], width: float) -> list[Line2D]:
    """An empty stage and a line a bone."""
    panel.set(xlim=(-REACH_M, REACH_M), ylim=(-0.15, 2.05), aspect="equal")
    panel.axis("off")
    panel.axhline(0.0, color="#CCCCCC", linewidth=0.8, zorder=0)
    return [panel.plot([], [], color=SIDES[side], linewidth=width)[0] for side in sides[1:]]


def _pose(lines: Sequence[Line2D], body: Body, sample: int, frame: int, parents: Sequence[int]) -> None:
    positions = body.positions_m[sample]
    pose = positions[min(frame, len(positions) - 1)]
    pose = pose - pose[0] * np.array([1.0, 0.0, 1.0])
    across = 0.85 * pose[:, 0] + 0.53 * pose[:, 2]
    for line, joint in zip(lines, range(1, len(parents)), strict=True):
        pair = [parents[joint], joint]
        line.set_data(across[pair], pose[pair, 1])
