"""Physics of outputs: smoothness, timing, bones, feet.

Conventions: positions are ``[n, T, J, 3]`` metres in the world frame, Y up, joint 0 the root; every metric gives one
value a sample ``[n]``; real motion, or the source, comes first. ``joints`` lists the joints that count: leave virtual
joints out of it. A value that is undefined for a sample is NaN.

- ``jerk_per_sample`` (m/s^3) and ``speed_per_sample`` (m/s): smoothness and liveliness.
- ``ratio_to_reference``, ``ratio_per_content``: either of them over that of real motion (jerk ratio, speed ratio).
- ``time_correlation``: does the output move when its source moves?
- ``bone_drift`` (%): do bones keep their length?
- ``foot_skate`` (cm/s): sliding while in contact with an estimated floor. ``skate_gmd``: the published ratio (%).
- ``penetration``, ``float_height`` (cm): the lowest foot under and over the floor.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import uniform_filter1d

from bench.arrays import BoolArray, FloatArray, finite_array
from bench.errors import BadInput
from bench.metrics.conditional import check_labels

MIN_MOVEMENT_M = 1e-6
MIN_BONE_M = 1e-3
CONTACT_STARTS_BELOW_M = 0.03
CONTACT_ENDS_ABOVE_M = 0.05
FLOOR_QUANTILE = 0.05
GMD_HEIGHT_M, GMD_SPEED_M_S, GMD_WINDOW_FRAMES = 0.05, 0.5, 5


def jerk_per_sample(positions_m: ArrayLike, fps: float, *, joints: Sequence[int] | None = None) -> FloatArray:
    """Mean length of the third time difference of joint positions: ``[n]`` m/s^3.

    Raises
    ------
    BadInput : not ``[n, T, J, 3]``, fewer than 4 frames, NaN, fps not positive, joints that do not exist.
    """
    positions = _checked_positions(positions_m, "positions_m", joints, min_frames=4)
    return _mean_length_of_differences(positions, _checked_fps(fps), order=3)


def speed_per_sample(positions_m: ArrayLike, fps: float, *, joints: Sequence[int] | None = None) -> FloatArray:
    """Mean joint speed: ``[n]`` m/s.

    Raises
    ------
    BadInput : as ``jerk_per_sample``, but 2 frames are enough.
    """
    positions = _checked_positions(positions_m, "positions_m", joints, min_frames=2)
    return _mean_length_of_differences(positions, _checked_fps(fps), order=1)


def ratio_to_reference(reference: ArrayLike, output: ArrayLike) -> float:
    """Mean of ``output`` ``[n]`` over mean of ``reference`` ``[m]``: the jerk ratio, the speed ratio. 1 is ideal.

    Raises
    ------
    BadInput : NaN, negative values, a reference that does not move.
    """
    of_reference, of_output = _checked_magnitudes(reference, "reference"), _checked_magnitudes(output, "output")
    if of_reference.mean() <= 0.0:
        raise BadInput("the mean of reference must be positive, got 0", where="reference", cause="frozen real motion")
    return float(of_output.mean() / of_reference.mean())


def ratio_per_content(
    reference: ArrayLike, reference_contents: ArrayLike, output: ArrayLike, output_contents: ArrayLike
) -> dict[int, float]:
    """``ratio_to_reference`` within every content that both sides have.

    An overall ratio near 1 can hide gestures that shake and walks that were damped.

    Raises
    ------
    BadInput : as ``ratio_to_reference``; labels that are not integers or of another length.
    """
    of_reference, of_output = _checked_magnitudes(reference, "reference"), _checked_magnitudes(output, "output")
    reference_labels = check_labels(reference_contents, "reference_contents", len(of_reference))
    output_labels = check_labels(output_contents, "output_contents", len(of_output))
    return {
        label: ratio_to_reference(of_reference[reference_labels == label], of_output[output_labels == label])
        for label in np.intersect1d(reference_labels, output_labels).tolist()
    }


def time_correlation(
    source_positions_m: ArrayLike, output_positions_m: ArrayLike, *, joints: Sequence[int] | None = None
) -> FloatArray:
    """Correlation over time of source and output joint positions: ``[n]``, in -1..1.

    Root-relative; the mean over time of every coordinate is removed, so posture does not count, only movement and its
    timing. All coordinates of all joints enter one correlation. NaN where source or output stands still (less than a
    micrometre of movement).

    Raises
    ------
    BadInput : shapes that differ, fewer than 2 frames, NaN, joints that do not exist.
    """
    source = _checked_positions(source_positions_m, "source_positions_m", joints, min_frames=2, root_relative=True)
    output = _checked_positions(output_positions_m, "output_positions_m", joints, min_frames=2, root_relative=True)
    if source.shape != output.shape:
        raise BadInput(
            f"output_positions_m must match the source's {list(source.shape)}, got {list(output.shape)}",
            where="output_positions_m",
        )
    of_source, of_output = source - source.mean(axis=1, keepdims=True), output - output.mean(axis=1, keepdims=True)
    energy_source, energy_output = (np.einsum("ntjc,ntjc->n", x, x) for x in (of_source, of_output))
    still = np.minimum(energy_source, energy_output) < of_source[0].size * MIN_MOVEMENT_M**2
    product = np.einsum("ntjc,ntjc->n", of_source, of_output)
    scale = np.where(still, np.nan, np.sqrt(energy_source) * np.sqrt(energy_output))
    return np.asarray(product / scale)


def bone_drift(
    positions_m: ArrayLike,
    parents: Sequence[int],
    reference_lengths_m: ArrayLike,
    *,
    joints: Sequence[int] | None = None,
) -> FloatArray:
    """How far bones are from rigid and from the length they should have: ``[n]`` percent.

    For each bone the standard deviation of its length over time plus the distance of its mean length from the
    reference, both relative to the reference; then the mean over bones. Bones under 1 mm in the reference are not
    counted.

    Parameters
    ----------
    positions_m : ``[n, T, J, 3]``.
    parents : index of each joint's parent, -1 for the root.
    reference_lengths_m : ``[J]`` or ``[n, J]`` bone lengths of the content clip; the root's entry is not used.
    joints : joints whose bone to the parent counts; all by default.

    Raises
    ------
    BadInput : shapes that do not fit, NaN, no bone left to count.
    """
    positions = _checked_positions(positions_m, "positions_m", None, min_frames=1)
    n, _, n_joints, _ = positions.shape
    if len(parents) != n_joints:
        raise BadInput(f"parents must name {n_joints} joints, got {len(parents)}", where="parents")
    reference = np.asarray(reference_lengths_m, dtype=np.float64)
    reference = finite_array(
        np.tile(reference, (n, 1)) if reference.ndim == 1 else reference, "reference_lengths_m", (n, n_joints)
    )
    kept = [j for j in _checked_joints(joints, n_joints) if parents[j] >= 0]
    counted = reference[:, kept] >= MIN_BONE_M
    if not kept or not counted.any(axis=1).all():
        raise BadInput("no bone of at least 1 mm is left to count", where="joints")
    lengths = np.linalg.norm(positions[:, :, kept] - positions[:, :, [parents[j] for j in kept]], axis=-1)
    expected = np.where(counted, reference[:, kept], 1.0)
    drift = (lengths.std(axis=1) + np.abs(lengths.mean(axis=1) - expected)) / expected
    return np.asarray(100.0 * np.where(counted, drift, 0.0).sum(axis=1) / counted.sum(axis=1))


def estimated_floor(positions_m: ArrayLike, foot_joints: Sequence[int]) -> FloatArray:
    """Height of the floor under each sample: ``[n]`` metres.

    The 5 % quantile over time of the height of the lowest foot joint: the lowest frames, but not a single bad one.

    Raises
    ------
    BadInput : not ``[n, T, J, 3]``, NaN, joints that do not exist.
    """
    feet = _checked_positions(positions_m, "positions_m", foot_joints, min_frames=1)
    return np.asarray(np.quantile(feet[..., 1].min(axis=2), FLOOR_QUANTILE, axis=1))


def foot_skate(positions_m: ArrayLike, fps: float, foot_joints: Sequence[int]) -> FloatArray:
    """Mean horizontal speed of foot joints while they are in contact with the estimated floor: ``[n]`` cm/s.

    Contact is decided by height alone, so that fast sliding cannot hide: it starts under 3 cm and ends over 5 cm. NaN
    where no foot touches the floor in two consecutive frames.

    Raises
    ------
    BadInput : fewer than 2 frames, NaN, joints that do not exist, fps not positive.
    """
    feet = _checked_positions(positions_m, "positions_m", foot_joints, min_frames=2)
    height = feet[..., 1] - estimated_floor(positions_m, foot_joints)[:, None, None]
    contact = _held_contact(height < CONTACT_STARTS_BELOW_M, height > CONTACT_ENDS_ABOVE_M)
    standing = contact[:, 1:] & contact[:, :-1]
    speed_cm_s = 100.0 * _checked_fps(fps) * np.linalg.norm(np.diff(feet[..., (0, 2)], axis=1), axis=-1)
    frames = standing.sum(axis=(1, 2))
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(standing, speed_cm_s, 0.0).sum(axis=(1, 2)) / frames)


def skate_gmd(positions_m: ArrayLike, fps: float, toe_joints: Sequence[int]) -> FloatArray:
    """Share of frames in which a toe skates: ``[n]`` percent, in the form of GMD (Karunratanakul 2023, section 5).

    A toe skates where it is under 5 cm in two consecutive frames and faster than 0.5 m/s, both now and on average
    over 5 frames (zeros beyond the ends, as in the released code). Heights count from 0, not from an estimated floor.

    Raises
    ------
    BadInput : fewer than 2 frames, NaN, joints that do not exist, fps not positive.
    """
    toes = _checked_positions(positions_m, "positions_m", toe_joints, min_frames=2)
    speed = _checked_fps(fps) * np.linalg.norm(np.diff(toes[..., (0, 2)], axis=1), axis=-1)
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
    the source.

    Raises
    ------
    BadInput : as ``penetration``.
    """
    return _mean_positive_cm(_lowest_foot(positions_m, foot_joints) - floor_m)


def _lowest_foot(positions_m: ArrayLike, foot_joints: Sequence[int]) -> FloatArray:
    feet = _checked_positions(positions_m, "positions_m", foot_joints, min_frames=1)
    return np.asarray(feet[..., 1].min(axis=2))


def _mean_positive_cm(heights_m: FloatArray) -> FloatArray:
    return np.asarray(100.0 * np.clip(heights_m, 0.0, None).mean(axis=1))


def _held_contact(starts: BoolArray, ends: BoolArray) -> BoolArray:
    """Contact ``[n, T, F]`` that begins with ``starts`` and lasts until ``ends``."""
    contact = np.empty_like(starts)
    contact[:, 0] = starts[:, 0]
    for frame in range(1, starts.shape[1]):
        contact[:, frame] = (contact[:, frame - 1] | starts[:, frame]) & ~ends[:, frame]
    return contact


def _mean_length_of_differences(positions: FloatArray, fps: float, *, order: int) -> FloatArray:
    """Per sample, so that no array of all differences is held at once."""
    return np.array(
        [np.linalg.norm(np.diff(sample, n=order, axis=0), axis=-1).mean() * fps**order for sample in positions]
    )


def _checked_positions(
    positions_m: ArrayLike, name: str, joints: Sequence[int] | None, *, min_frames: int, root_relative: bool = False
) -> FloatArray:
    positions = finite_array(positions_m, name, (None, None, None, 3))
    if positions.shape[1] < min_frames:
        raise BadInput(f"{name} must have at least {min_frames} frames, got {positions.shape[1]}", where=name)
    kept = _checked_joints(joints, positions.shape[2])
    if root_relative:
        positions = positions - positions[:, :, :1]
    return positions if joints is None else positions[:, :, kept]


def _checked_joints(joints: Sequence[int] | None, n_joints: int) -> list[int]:
    if joints is None:
        return list(range(n_joints))
    kept = [int(j) for j in joints]
    if not kept or len(set(kept)) != len(kept) or not all(0 <= j < n_joints for j in kept):
        raise BadInput(f"joints must be different indices in 0..{n_joints - 1}, got {kept}", where="joints")
    return kept


def _checked_fps(fps: float) -> float:
    if not np.isfinite(fps) or fps <= 0.0:
        raise BadInput(f"fps must be positive, got {fps}", where="fps")
    return float(fps)


def _checked_magnitudes(values: ArrayLike, name: str) -> FloatArray:
    checked = finite_array(values, name, (None,))
    if (checked < 0.0).any():
        raise BadInput(f"{name} must not be negative, got {checked.min():.3g}", where=name)
    return checked
