"""Content and style error of gestures from the trajectories of both hands (Kuriyama et al. 2022, section 4.2).

Trajectories are ``[T, 6]``: left hand x, y, z, right hand x, y, z, metres. Content error asks whether the output's
hands go where the content's hands go, style error whether they dwell and spread like the style's hands.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from bench.arrays import FloatArray, finite_array
from bench.errors import BadConfig, BadInput
from bench.metrics.dtw import Backend, dtw

Frame = Literal["root", "world"]
Tail = Literal["cover", "drop"]

THETA_S = 2.13
"""Segment length of the paper: 128 frames at 60 fps. It also reports 1.07 s and 4.27 s (64 and 256 frames)."""

_ROOT, _LEFT_HIP, _RIGHT_HIP, _LEFT_SHOULDER, _RIGHT_SHOULDER, _LEFT_HAND, _RIGHT_HAND = 0, 1, 5, 13, 17, 15, 19


@dataclass(frozen=True)
class ErrorSummary:
    """The paper's three metrics of one sample's error components, metres."""

    mean: float
    worst: float
    worst_quarter: float


def hand_trajectories(positions_m: ArrayLike, frame: Frame = "root") -> FloatArray:
    """Trajectories of both hands of canonical poses.

    Parameters
    ----------
    positions_m : ``[T, 21, 3]`` world positions of the canonical joints, metres, Y up.
    frame : ``"root"``: relative to the hips and turned so that the body faces +Z, in every frame; ``"world"``: as they
        are. The paper does not say which it uses.

    Returns
    -------
    ``[T, 6]`` left and right wrist. The finger joint is not used: not every dataset has one.

    Raises
    ------
    BadInput : wrong shape, no frame, not finite. BadConfig : no such frame.
    """
    positions = finite_array(positions_m, "positions_m", (None, 21, 3))
    hands = positions[:, (_LEFT_HAND, _RIGHT_HAND)]
    if frame == "root":
        hands = _facing_forward(hands - positions[:, None, _ROOT], positions)
    elif frame != "world":
        raise BadConfig(f"frame must be root or world, got {frame!r}", where="frame")
    return hands.reshape(-1, 6)


def mirrored_hands(hands_m: ArrayLike) -> FloatArray:
    """The same gesture by the other side: hands swapped, x negated (``[T, 6]``)."""
    hands = finite_array(hands_m, "hands_m", (None, 6)).reshape(-1, 2, 3)
    return np.asarray(hands[:, ::-1] * np.array([-1.0, 1.0, 1.0])).reshape(-1, 6)


def content_error_components(
    content_hands_m: ArrayLike, output_hands_m: ArrayLike, backend: Backend = "exact"
) -> FloatArray:
    """Euclidean 6-D distance of every pair on the DTW path of content and output (equations 13 and 14).

    Parameters
    ----------
    content_hands_m, output_hands_m : ``[n, 6]`` and ``[m, 6]``, metres.
    backend : ``"exact"``, or ``"fastdtw"`` (radius 1) as the paper.

    Returns
    -------
    ``[L]`` metres; L is the length of the path, so a frame that waits counts as often as it is paired.

    Raises
    ------
    BadInput : wrong shape, no frame, not finite. BadConfig : no such backend.
    """
    content = finite_array(content_hands_m, "content_hands_m", (None, 6))
    output = finite_array(output_hands_m, "output_hands_m", (None, 6))
    return dtw(content, output, backend).distances(content, output)


def style_error_components(
    style_hands_m: ArrayLike,
    output_hands_m: ArrayLike,
    fps: float,
    *,
    theta_s: float = THETA_S,
    mirror_style: bool = True,
    tail: Tail = "cover",
) -> FloatArray:
    """For every output segment the distance to the style segment nearest to it (equations 15 and 16).

    Distance is the norm of the difference of the means plus the norm of the difference of the standard deviations
    (over frames, divided by the number of frames).

    Parameters
    ----------
    style_hands_m, output_hands_m : ``[n, 6]`` and ``[m, 6]``, metres, at least 2 frames each.
    fps : frame rate of both.
    theta_s : segment length in seconds; segments start every half of it. A clip shorter than it is one segment.
    mirror_style : add the mirrored copy of the style's segments, as the paper does at evaluation.
    tail : what happens to frames after the last full segment. ``"cover"``: one more segment of full length ends with
        the last frame; ``"drop"``: they are not scored (equation 16 read literally).

    Returns
    -------
    ``[K]`` metres, one for each output segment in order.

    Raises
    ------
    BadInput : wrong shape, fewer than 2 frames, not finite; fps not positive; a theta of fewer than 2 frames.
    BadConfig : no such tail rule.
    """
    theta_frames = segment_frames(theta_s, fps)
    style = _at_least_two(style_hands_m, "style_hands_m")
    output = _at_least_two(output_hands_m, "output_hands_m")
    style_means, style_stds = _segment_statistics(style, theta_frames, tail)
    if mirror_style:
        mirrored_means, mirrored_stds = _segment_statistics(mirrored_hands(style), theta_frames, tail)
        style_means = np.concatenate([style_means, mirrored_means])
        style_stds = np.concatenate([style_stds, mirrored_stds])
    means, stds = _segment_statistics(output, theta_frames, tail)
    between_means = np.linalg.norm(means[:, None] - style_means, axis=-1)
    between_stds = np.linalg.norm(stds[:, None] - style_stds, axis=-1)
    return np.asarray((between_means + between_stds).min(axis=1))


def summarise(components_m: ArrayLike) -> ErrorSummary:
    """Mean, largest, and mean of the largest quarter (rounded up to whole components) of ``[L]`` error components.

    Raises
    ------
    BadInput : empty, not one-dimensional, not finite, or negative.
    """
    components = np.sort(finite_array(components_m, "components_m", (None,)))
    if components[0] < 0.0:
        raise BadInput(f"errors cannot be negative, got {components[0]:g}", where="components_m")
    quarter = -(-len(components) // 4)
    return ErrorSummary(
        mean=float(components.mean()),
        worst=float(components[-1]),
        worst_quarter=float(components[-quarter:].mean()),
    )


def segment_frames(theta_s: float, fps: float) -> int:
    """Length of a segment in whole frames: 2.13 s at 60 fps is 128.

    Raises
    ------
    BadInput : ``fps`` or ``theta_s`` is not positive and finite, or the segment has fewer than 2 frames.
    """
    if not (np.isfinite(fps) and fps > 0.0):
        raise BadInput(f"fps must be positive, got {fps}", where="fps")
    if not (np.isfinite(theta_s) and round(theta_s * fps) >= 2):
        raise BadInput(f"theta_s must last at least 2 frames at {fps:g} fps, got {theta_s} s", where="theta_s")
    return round(theta_s * fps)


def segment_starts(n_frames: int, theta_frames: int, tail: Tail = "cover") -> tuple[int, ...]:
    """First frames of the half-overlapping segments of a clip (equation 16); ``(0,)`` for a clip shorter than one.

    Raises
    ------
    BadConfig : no such tail rule.
    """
    if tail not in ("cover", "drop"):
        raise BadConfig(f"tail must be cover or drop, got {tail!r}", where="tail")
    last_start = max(n_frames - theta_frames, 0)
    starts = list(range(0, last_start + 1, theta_frames // 2))
    if tail == "cover" and starts[-1] < last_start:
        starts.append(last_start)
    return tuple(starts)


def _segment_statistics(hands: FloatArray, theta_frames: int, tail: Tail) -> tuple[FloatArray, FloatArray]:
    """Mean and standard deviation over frames of every segment, both ``[K, 6]``."""
    starts = segment_starts(len(hands), theta_frames, tail)
    segments = np.stack([hands[start : start + theta_frames] for start in starts])
    return segments.mean(axis=1), segments.std(axis=1)


def _at_least_two(hands_m: ArrayLike, name: str) -> FloatArray:
    hands = finite_array(hands_m, name, (None, 6))
    if len(hands) < 2:
        raise BadInput(f"{name} needs at least 2 frames for a standard deviation, got {len(hands)}", where=name)
    return hands


def _facing_forward(vectors: FloatArray, positions: FloatArray) -> FloatArray:
    """Turn ``[T, N, 3]`` about the up axis so that the body of ``positions [T, 21, 3]`` faces +Z.

    Facing = across x up, across = left minus right of upper legs plus arms, as everywhere on the canonical joints.
    """
    across = (
        positions[:, _LEFT_HIP]
        - positions[:, _RIGHT_HIP]
        + positions[:, _LEFT_SHOULDER]
        - positions[:, _RIGHT_SHOULDER]
    )
    yaw = np.arctan2(-across[:, 2], across[:, 0])[:, None]
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack([np.cos(yaw) * x - np.sin(yaw) * z, y, np.sin(yaw) * x + np.cos(yaw) * z], axis=-1)
