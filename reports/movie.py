"""Bodies side by side as a GIF or MP4."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from reports.figures import styled
from reports.page import Body, PlayerTable
from reports.records import BadRecord

SIDES = {"left": "#0072B2", "right": "#D55E00", "middle": "#444444"}
FORMS = (".gif", ".mp4")
INCHES, REACH_M = 2.4, 1.1


def write_movie(player: PlayerTable, sample: int, bodies: Sequence[str], path: Path) -> Path:
    """Draw some bodies of one sample into a file, from the front and a little from the side.

    Raises
    ------
    BadRecord : another suffix, no ffmpeg for MP4, or a body that is not there.
    """
    missing = [name for name in bodies if name not in player.bodies]
    if missing:
        raise BadRecord(f"no body {missing[0]!r}; there are {', '.join(player.bodies)}")
    if path.suffix.lower() not in FORMS:
        raise BadRecord(f"{path}: a movie is saved as {' or '.join(FORMS)}")
    if path.suffix.lower() == ".mp4" and not FFMpegWriter.isAvailable():
        raise BadRecord(f"{path}: MP4 needs ffmpeg, which is not installed; save a .gif")
    shown = [player.bodies[name] for name in bodies]
    with styled():
        figure = Figure(figsize=(INCHES * len(shown), INCHES * 1.25), layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(1, len(shown), squeeze=False).ravel()
        bones: list[list[Line2D]] = []
        for panel, body in zip(panels, shown, strict=True):
            panel.set(xlim=(-REACH_M, REACH_M), ylim=(-0.15, 2.05), aspect="equal")
            panel.set_title(body.title, fontsize=8)
            panel.axis("off")
            panel.axhline(0.0, color="#CCCCCC", linewidth=0.8, zorder=0)
            bones.append([panel.plot([], [], color=SIDES[side], linewidth=2.2)[0] for side in player.sides[1:]])
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


def _pose(lines: Sequence[Line2D], body: Body, sample: int, frame: int, parents: Sequence[int]) -> None:
    positions = body.positions_m[sample]
    pose = positions[min(frame, len(positions) - 1)]
    pose = pose - pose[0] * np.array([1.0, 0.0, 1.0])
    across = 0.85 * pose[:, 0] + 0.53 * pose[:, 2]
    for line, joint in zip(lines, range(1, len(parents)), strict=True):
        pair = [parents[joint], joint]
        line.set_data(across[pair], pose[pair, 1])
