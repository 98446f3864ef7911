"""Placing text labels beside points so that they cover neither each other nor the points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.text import Annotation
from numpy.typing import NDArray

RADII_PT = (8.0, 14.0, 22.0, 32.0, 44.0, 58.0, 74.0, 92.0)
N_DIRECTIONS = 16
POINT_RADIUS_PT = 5.0
LINE_STEPS = np.linspace(0.0, 1.0, 17)

Floats = NDArray[np.float64]


def place_labels(axes: Axes, points: Floats, labels: Sequence[Annotation]) -> None:
    """Move each annotation to the best free place near its point (``points`` ``[m, 2]``, data coordinates).

    Greedy: points with the nearest neighbours are served first; every label tries rings of growing radius and takes
    the place with the least cost, where leaving the axes costs most, then covering a label, then a line through a
    label, then covering a point, then distance. Labels far from their point keep a thin line to it.
    """
    if not labels:
        return
    scale = axes.figure.dpi / 72.0
    places = np.asarray(axes.transData.transform(points), dtype=np.float64)
    radius = POINT_RADIUS_PT * scale
    marks = np.concatenate([places - radius, places + radius], axis=1)
    frame = np.asarray(axes.get_window_extent().extents, dtype=np.float64)
    offsets, taken, lines_taken = _offsets(), np.empty((0, 4)), np.empty((0, len(LINE_STEPS), 2))
    for index in _crowded_first(places):
        extent = labels[index].get_window_extent()
        size = np.array([extent.width + 2.0 * scale, extent.height + 1.0 * scale])
        boxes = _boxes(places[index], offsets * scale, size)
        lines = places[index] + LINE_STEPS[:, None] * offsets[:, None] * scale
        cost = (
            1e6 * _leaves(boxes, frame)
            + 100.0 * _overlaps(boxes, taken)
            + 30.0 * _overlaps(boxes, np.delete(marks, index, axis=0))
            + 2000.0 * (_crosses(lines, taken).sum(axis=1) + _crosses(lines_taken, boxes).sum(axis=0))
            + scale**2 * np.repeat(RADII_PT, N_DIRECTIONS)
        )
        best = int(np.argmin(cost))
        taken = np.vstack([taken, boxes[best]])
        lines_taken = np.concatenate([lines_taken, lines[best : best + 1]])
        _move(labels[index], offsets[best])


def _crowded_first(places: Floats) -> list[int]:
    gaps = np.linalg.norm(places[:, None] - places[None], axis=2)
    near = np.sort(gaps, axis=1)[:, 1:5].sum(axis=1)
    return [int(index) for index in np.argsort(near, kind="stable")]


def _offsets() -> Floats:
    """Candidate offsets in points ``[k, 2]``, nearest first."""
    angles = np.arange(N_DIRECTIONS) * 2.0 * np.pi / N_DIRECTIONS
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    return np.concatenate([radius * directions for radius in RADII_PT])


def _sides(offsets: Floats) -> NDArray[np.intp]:
    """-1, 0 or 1 per axis ``[..., 2]``: whether a label grows down or left, is centred, or grows up or right."""
    length = np.linalg.norm(offsets, axis=-1, keepdims=True)
    return np.where(np.abs(offsets) < 0.3 * length, 0, np.sign(offsets)).astype(np.intp)


def _boxes(place: Floats, offsets: Floats, size: Floats) -> Floats:
    """Where a label of ``size`` would lie: ``[k, 4]`` left, bottom, right, top; it grows away from the point."""
    corners = place + offsets + (_sides(offsets) - 1) / 2.0 * size
    return np.concatenate([corners, corners + size], axis=1)


def _leaves(boxes: Floats, frame: Floats) -> NDArray[np.bool_]:
    inside = np.all(boxes[:, :2] >= frame[:2], axis=1) & np.all(boxes[:, 2:] <= frame[2:], axis=1)
    return np.asarray(~inside)


def _overlaps(boxes: Floats, others: Floats) -> Floats:
    """Area of each of ``boxes`` ``[k, 4]`` that lies on any of ``others`` ``[m, 4]``: ``[k]``."""
    low = np.maximum(boxes[:, None, :2], others[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], others[None, :, 2:])
    return np.asarray(np.maximum(high - low, 0.0).prod(axis=2).sum(axis=1))


def _crosses(lines: Floats, boxes: Floats) -> NDArray[np.bool_]:
    """Which lines, sampled as ``[k, steps, 2]``, run through which of ``boxes`` ``[m, 4]``: ``[k, m]``."""
    steps = lines[:, :, None]
    inside = np.all((steps > boxes[:, :2]) & (steps < boxes[:, 2:]), axis=3)
    return np.asarray(inside.any(axis=1))


def _move(label: Annotation, offset: Floats) -> None:
    across, up = _sides(offset)
    label.set_position((float(offset[0]), float(offset[1])))
    label.set(
        horizontalalignment=("center", "left", "right")[across],
        verticalalignment=("center", "bottom", "top")[up],
    )
    if label.arrow_patch is not None:
        label.arrow_patch.set_visible(float(np.hypot(*offset)) > 1.5 * RADII_PT[0])
