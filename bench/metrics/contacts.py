"""Feet and the floor: skating, penetration, floating, when feet stand.

Conventions: positions are ``[n, T, J, 3]`` metres in the world frame, Y up; every metric gives one value a sample
``[n]``; the source comes before the output. A value that is undefined for a sample is NaN.

- ``foot_skate`` (cm/s): sliding of the foot that stands, on an estimated floor.
- ``skate_gmd`` (%): the published foot skating ratio.
- ``penetration``, ``float_height`` (cm): the lowest foot under and over the floor.
- ``planted``: which feet stand when. ``contact_timing``: that of the output against the source's, precision and
  recall (%).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import uniform_filter1d

from bench.arrays import BoolArray, FloatArray
from bench.errors import BadInput
from bench.metrics.checks import checked_fps, checked_positions

CONTACT_STARTS_BELOW_M = 0.03
CONTACT_ENDS_ABOVE_M = 0.05
PLANTED_BELOW_M_S = 0.4
FLOOR_QUANTILE = 0.05
GMD_HEIGHT_M, GMD_SPEED_M_S, GMD_FPS, GMD_WINDOW_FRAMES = 0.05, 0.5, 20.0, 5
"""2.5 cm between frames at 20 fps is 0.5 m/s."""


@dataclass(frozen=True, eq=False)
class ContactTiming:
    """Precision and recall ``[n]`` in percent; NaN where the output (precision) or the source (recall) never stands."""

    precision: FloatArray
    recall: FloatArray


def estimated_floor(positions_m: ArrayLike, foot_joints: Sequence[int]) -> FloatArray:
    """Height of the floor under each sample: ``[n]`` metres.

    The 5 % quantile over time of the height of the lowest foot joint: the lowest frames, but not a single bad one.

    Raises
    ------
    BadInput : not ``[n, T, J, 3]``, NaN, joints that do not exist.
    """
    feet = checked_positions(positions_m, "positions_m", foot_joints, min_frames=1)
    return np.asarray(np.quantile(feet[..., 1].min(axis=2), FLOOR_QUANTILE, axis=1))


def foot_skate(positions_m: ArrayLike, fps: float, foot_joints: Sequence[int]) -> FloatArray:
    """Mean horizontal speed of the foot that stands: ``[n]`` cm/s.

    A foot joint touches the estimated floor from under 3 cm until over 5 cm, whatever its speed, so that fast sliding
    cannot hide. Of the joints that touch it in two consecutive frames the slowest one stands: a foot that swings low
    past a standing one does not skate. NaN where no foot touches the floor in two consecutive frames.

    Raises
    ------
    BadInput : fewer than 2 frames, NaN, joints that do not exist, fps not positive.
    """
    feet = checked_positions(positions_m, "positions_m", foot_joints, min_frames=2)
    contact = _contact(positions_m, foot_joints)
    touching = contact[:, 1:] & contact[:, :-1]
    slowest = np.where(touching, _horizontal_speed(feet, fps), np.inf).min(axis=2)
    standing = touching.any(axis=2)
    with np.errstate(invalid="ignore"):
        return np.asarray(100.0 * np.where(standing, slowest, 0.0).sum(axis=1) / standing.sum(axis=1))


def skate_gmd(positions_m: ArrayLike, fps: float, toe_joints: Sequence[int]) -> FloatArray:
    """Share of frames in which a toe skates: ``[n]`` percent, in the form of GMD (Karunratanakul 2023, section 5).

    A toe skates where it is under 5 cm in two consecutive frames and moves by more than 2.5 cm between them at 20 fps,
    both now and on average over 5 frames (zeros beyond the ends, as in the released code). Motion at another frame
    rate is brought to 20 fps by linear interpolation of positions. Heights count from 0, not from an estimated floor.

    Raises
    ------
    BadInput : less than a twentieth of a second, NaN, joints that do not exist, fps not positive.
    """
    toes = _at_gmd_fps(checked_positions(positions_m, "positions_m", toe_joints, min_frames=2), checked_fps(fps))
    speed = _horizontal_speed(toes, GMD_FPS)
    average = uniform_filter1d(speed, GMD_WINDOW_FRAMES, axis=1, mode="constant")
    low = toes[..., 1] < GMD_HEIGHT_M
    skating = low[:, 1:] & low[:, :-1] & (speed > GMD_SPEED_M_S) & (average > GMD_SPEED_M_S)
    return np.asarray(100.0 * skating.any(axis=2).mean(axis=1))


def penetration(positions_m: ArrayLike, foot_joints: Sequence[int], *, floor_m: float = 0.0) -> FloatArray:
    """Mean over frames of how far the lowest foot joint is under the floor: ``[n]`` cm.

    Raises
    ------
    BadInput : not ``[n, T, J, 3]``, NaN, joints that do not exist.
    """
    return _mean_positive_cm(floor_m - _lowest_foot(positions_m, foot_joints))


def float_height(positions_m: ArrayLike, foot_joints: Sequence[int], *, floor_m: float = 0.0) -> FloatArray:
    """Mean over frames of how far the lowest foot joint is over the floor: ``[n]`` cm. Jumps count, so compare with
    real motion of the same contents.

    Raises
    ------
    BadInput : as ``penetration``.
    """
    return _mean_positive_cm(_lowest_foot(positions_m, foot_joints) - floor_m)


def planted(positions_m: ArrayLike, fps: float, foot_joints: Sequence[int]) -> BoolArray:
    """Which feet stand between each frame and the next: ``[n, T - 1, F]``.

    A foot joint stands where it touches the estimated floor (from under 3 cm until over 5 cm) in both frames and moves
    over it at less than 0.4 m/s.

    Raises
    ------
    BadInput : as ``foot_skate``.
    """
    feet = checked_positions(positions_m, "positions_m", foot_joints, min_frames=2)
    contact = _contact(positions_m, foot_joints)
    return np.asarray(contact[:, 1:] & contact[:, :-1] & (_horizontal_speed(feet, fps) < PLANTED_BELOW_M_S))


def contact_timing(source_planted: ArrayLike, output_planted: ArrayLike) -> ContactTiming:
    """Do the output's feet stand when the source's do?

    Precision is the share of the output's planted frames, over all feet, in which the same foot of the source is
    planted too; recall is the share of the source's that the output has.

    Parameters
    ----------
    source_planted, output_planted : ``[n, T, F]`` booleans, see ``planted``.

    Raises
    ------
    BadInput : not booleans, shapes that differ.
    """
    source, output = (
        _checked_contacts(contacts, name)
        for contacts, name in ((source_planted, "source_planted"), (output_planted, "output_planted"))
    )
    if source.shape != output.shape:
        raise BadInput(
            f"output_planted must match the source's {list(source.shape)}, got {list(output.shape)}",
            where="output_planted",
        )
    both = (source & output).sum(axis=(1, 2))
    with np.errstate(invalid="ignore"):
        precision, recall = (100.0 * both / side.sum(axis=(1, 2)) for side in (output, source))
    return ContactTiming(np.asarray(precision), np.asarray(recall))


def _checked_contacts(contacts: ArrayLike, name: str) -> BoolArray:
    array = np.asarray(contacts)
    if array.dtype != np.bool_ or array.ndim != 3 or 0 in array.shape:
        raise BadInput(f"{name} must be booleans [n, T, F], got {array.dtype} {list(array.shape)}", where=name)
    return array


def _at_gmd_fps(positions: FloatArray, fps: float) -> FloatArray:
    """Positions ``[n, T, F, 3]`` at 20 fps."""
    frames = np.arange(0.0, positions.shape[1] - 1 + 1e-6, fps / GMD_FPS)
    if len(frames) < 2:
        raise BadInput(f"positions_m must last 1/20 s, got {positions.shape[1]} frames at {fps:g} fps", where="fps")
    before = np.minimum(frames.astype(np.int64), positions.shape[1] - 2)
    weight = (frames - before)[None, :, None, None]
    return np.asarray((1.0 - weight) * positions[:, before] + weight * positions[:, before + 1])


def _lowest_foot(positions_m: ArrayLike, foot_joints: Sequence[int]) -> FloatArray:
    feet = checked_positions(positions_m, "positions_m", foot_joints, min_frames=1)
    return np.asarray(feet[..., 1].min(axis=2))


def _mean_positive_cm(heights_m: FloatArray) -> FloatArray:
    return np.asarray(100.0 * np.clip(heights_m, 0.0, None).mean(axis=1))


def _horizontal_speed(positions: FloatArray, fps: float) -> FloatArray:
    """``[n, T - 1, F]`` m/s."""
    return np.asarray(checked_fps(fps) * np.linalg.norm(np.diff(positions[..., (0, 2)], axis=1), axis=-1))


def _contact(positions_m: ArrayLike, foot_joints: Sequence[int]) -> BoolArray:
    """Which foot joints touch the estimated floor ``[n, T, F]``, with hysteresis."""
    feet = checked_positions(positions_m, "positions_m", foot_joints, min_frames=1)
    height = feet[..., 1] - estimated_floor(positions_m, foot_joints)[:, None, None]
    starts, ends = height < CONTACT_STARTS_BELOW_M, height > CONTACT_ENDS_ABOVE_M
    contact = np.empty_like(starts)
    contact[:, 0] = starts[:, 0]
    for frame in range(1, starts.shape[1]):
        contact[:, frame] = (contact[:, frame - 1] | starts[:, frame]) & ~ends[:, frame]
    return contact
