"""Placing text labels beside points so that they cover neither each other nor the points."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

RADII_PT = (8.0, 14.0, 22.0, 32.0, 44.0, 58.0, 74.0, 92.0)
N_DIRECTIONS = 16
POINT_RADIUS_PT = 5.0


def place_labels(axes: Axes, points: NDArray[np.float64], labels: Sequence[Annotation]) -> None:
    """Move each annotation to the best free place near its point (``points`` ``[m, 2]``, data coordinates).

    Greedy: points with the nearest neighbours are served first; every label tries rings of growing radius and takes
    the place with the least cost, where covering a label or leaving the axes costs most, then covering a point, then
    distance. Labels far from their point keep a thin line to it.
    """
    if not labels:
        return
    scale = axes.figure.dpi / 72.0
    places = np.asarray(axes.transData.transform(points), dtype=np.float64)
    marks = [_around(place, POINT_RADIUS_PT * scale) for place in places]
    frame = axes.get_window_extent()
    taken: list[Bbox] = []
    for index in _crowded_first(places):
        extent = labels[index].get_window_extent()
        size = (extent.width + 2.0 * scale, extent.height + 1.0 * scale)
        others = marks[:index] + marks[index + 1 :]
        offset = min(_offsets(), key=partial(_cost, places[index], size, scale, frame, taken, others))
        taken.append(_box(places[index], offset, size, scale))
        _move(labels[index], offset)


def _crowded_first(places: NDArray[np.float64]) -> list[int]:
    gaps = np.linalg.norm(places[:, None] - places[None], axis=2)
    near = np.sort(gaps, axis=1)[:, 1:5].sum(axis=1) if len(places) > 1 else np.zeros(len(places))
    return [int(index) for index in np.argsort(near, kind="stable")]


def _offsets() -> list[tuple[float, float]]:
    angles = np.arange(N_DIRECTIONS) * 2.0 * np.pi / N_DIRECTIONS
    return [(float(radius * np.cos(a)), float(radius * np.sin(a))) for radius in RADII_PT for a in angles]


def _box(place: NDArray[np.float64], offset: tuple[float, float], size: tuple[float, float], scale: float) -> Bbox:
    """Where a label of ``size`` lies: it grows away from the point, sideways and up or down."""
    x, y = place[0] + offset[0] * scale, place[1] + offset[1] * scale
    horizontal, vertical = _alignment(offset)
    left = {"left": x, "center": x - size[0] / 2.0, "right": x - size[0]}[horizontal]
    bottom = {"bottom": y, "center": y - size[1] / 2.0, "top": y - size[1]}[vertical]
    return Bbox.from_bounds(left, bottom, *size)


def _alignment(offset: tuple[float, float]) -> tuple[str, str]:
    x, y = offset
    length = float(np.hypot(x, y))
    horizontal = "center" if abs(x) < 0.3 * length else "left" if x > 0 else "right"
    vertical = "center" if abs(y) < 0.3 * length else "bottom" if y > 0 else "top"
    return horizontal, vertical


def _cost(
    place: NDArray[np.float64],
    size: tuple[float, float],
    scale: float,
    frame: Bbox,
    taken: Sequence[Bbox],
    marks: Sequence[Bbox],
    offset: tuple[float, float],
) -> float:
    box = _box(place, offset, size, scale)
    inside = frame.x0 <= box.x0 and box.x1 <= frame.x1 and frame.y0 <= box.y0 and box.y1 <= frame.y1
    covered = sum(_overlap(box, other) for other in taken)
    hidden = sum(_overlap(box, other) for other in marks)
    crossed = sum(_crosses(place, np.multiply(offset, scale), other) for other in taken)
    cost = 100.0 * covered + 30.0 * hidden + 2000.0 * crossed + (0.0 if inside else 1e6)
    return cost + scale * scale * float(np.hypot(*offset))


def _crosses(place: NDArray[np.float64], offset: NDArray[np.float64], box: Bbox) -> bool:
    """Whether the line from a point to its label runs through another label."""
    steps = place + np.linspace(0.0, 1.0, 17)[:, None] * offset
    inside = (steps > (box.x0, box.y0)) & (steps < (box.x1, box.y1))
    return bool(np.any(np.all(inside, axis=1)))


def _overlap(a: Bbox, b: Bbox) -> float:
    width = min(a.x1, b.x1) - max(a.x0, b.x0)
    height = min(a.y1, b.y1) - max(a.y0, b.y0)
    return float(width * height) if width > 0.0 and height > 0.0 else 0.0


def _around(place: NDArray[np.float64], radius: float) -> Bbox:
    return Bbox.from_bounds(place[0] - radius, place[1] - radius, 2.0 * radius, 2.0 * radius)


def _move(label: Annotation, offset: tuple[float, float]) -> None:
    horizontal, vertical = _alignment(offset)
    label.set_position(offset)
    label.set(horizontalalignment=horizontal, verticalalignment=vertical)
    if label.arrow_patch is not None:
        label.arrow_patch.set_visible(float(np.hypot(*offset)) > 1.5 * RADII_PT[0])
