"""Physics of outputs: smoothness, timing, bones, root path. Feet are in ``contacts``, joint angles in ``joint_range``.

Conventions: positions are ``[n, T, J, 3]`` metres in the world frame, Y up, joint 0 the root; every metric gives one
value a sample ``[n]``; real motion, or the source, comes first. ``joints`` lists the joints that count: leave virtual
joints out of it. A value that is undefined for a sample is NaN.

- ``jerk_per_sample`` (m/s^3) and ``speed_per_sample`` (m/s): smoothness and liveliness.
- ``ratio_to_reference``, ``ratio_per_content``: either of them over that of real motion (jerk ratio, speed ratio).
- ``time_correlation``: does the output move when its source moves?
- ``bone_drift`` (%): do bones keep their length?
- ``root_path_error`` (cm): how far the root's way over the floor is from the source's.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from bench.arrays import FloatArray, finite_array
from bench.errors import BadInput
from bench.metrics.checks import checked_fps, checked_joints, checked_positions
from bench.metrics.conditional import check_labels

MIN_MOVEMENT_M = 1e-6
MIN_BONE_M = 1e-3


def jerk_per_sample(positions_m: ArrayLike, fps: float, *, joints: Sequence[int] | None = None) -> FloatArray:
    """Mean length of the third time difference of joint positions: ``[n]`` m/s^3.

    Raises
    ------
    BadInput : not ``[n, T, J, 3]``, fewer than 4 frames, NaN, fps not positive, joints that do not exist.
    """
    positions = checked_positions(positions_m, "positions_m", joints, min_frames=4)
    return _mean_length_of_differences(positions, checked_fps(fps), order=3)


def speed_per_sample(positions_m: ArrayLike, fps: float, *, joints: Sequence[int] | None = None) -> FloatArray:
    """Mean joint speed: ``[n]`` m/s.

    Raises
    ------
    BadInput : as ``jerk_per_sample``, but 2 frames are enough.
    """
    positions = checked_positions(positions_m, "positions_m", joints, min_frames=2)
    return _mean_length_of_differences(positions, checked_fps(fps), order=1)


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
    source = checked_positions(source_positions_m, "source_positions_m", joints, min_frames=2, root_relative=True)
    output = checked_positions(output_positions_m, "output_positions_m", joints, min_frames=2, root_relative=True)
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
    positions = checked_positions(positions_m, "positions_m", None, min_frames=1)
    n, _, n_joints, _ = positions.shape
    if len(parents) != n_joints:
        raise BadInput(f"parents must name {n_joints} joints, got {len(parents)}", where="parents")
    reference = np.asarray(reference_lengths_m, dtype=np.float64)
    reference = finite_array(
        np.tile(reference, (n, 1)) if reference.ndim == 1 else reference, "reference_lengths_m", (n, n_joints)
    )
    kept = [j for j in checked_joints(joints, n_joints) if parents[j] >= 0]
    counted = reference[:, kept] >= MIN_BONE_M
    if not kept or not counted.any(axis=1).all():
        raise BadInput("no bone of at least 1 mm is left to count", where="joints")
    lengths = np.linalg.norm(positions[:, :, kept] - positions[:, :, [parents[j] for j in kept]], axis=-1)
    expected = np.where(counted, reference[:, kept], 1.0)
    drift = (lengths.std(axis=1) + np.abs(lengths.mean(axis=1) - expected)) / expected
    return np.asarray(100.0 * np.where(counted, drift, 0.0).sum(axis=1) / counted.sum(axis=1))


def root_path_error(source_root_xyz_m: ArrayLike, output_root_xyz_m: ArrayLike) -> FloatArray:
    """Mean horizontal distance of the output's root from its source's, after alignment: ``[n]`` cm.

    The output's path is turned about the vertical and moved over the floor so that it lies on the source's as well as
    it can (least squares), as in the absolute trajectory error of Sturm 2012; neither is scaled.

    Parameters
    ----------
    source_root_xyz_m, output_root_xyz_m : ``[n, T, 3]``, metres.

    Raises
    ------
    BadInput : shapes that differ, NaN.
    """
    source = finite_array(source_root_xyz_m, "source_root_xyz_m", (None, None, 3))
    output = finite_array(output_root_xyz_m, "output_root_xyz_m", source.shape)
    wanted, found = (path[..., 2] + 1j * path[..., 0] for path in (source, output))
    wanted, found = (path - path.mean(axis=1, keepdims=True) for path in (wanted, found))
    overlap = (wanted * found.conj()).sum(axis=1, keepdims=True)
    turned = found * np.exp(1j * np.angle(overlap))
    return np.asarray(100.0 * np.abs(wanted - turned).mean(axis=1))


def path_drift(source_root_xyz_m: ArrayLike, output_root_xyz_m: ArrayLike) -> FloatArray:
    """Horizontal distance of the output's root from its source's in the last frame: ``[n]`` cm, nothing aligned.

    Parameters
    ----------
    source_root_xyz_m, output_root_xyz_m : ``[n, T, 3]``, metres.

    Raises
    ------
    BadInput : shapes that differ, NaN.
    """
    source = finite_array(source_root_xyz_m, "source_root_xyz_m", (None, None, 3))
    output = finite_array(output_root_xyz_m, "output_root_xyz_m", source.shape)
    return np.asarray(100.0 * np.linalg.norm((output - source)[:, -1, [0, 2]], axis=-1))


def _mean_length_of_differences(positions: FloatArray, fps: float, *, order: int) -> FloatArray:
    """Per sample, so that no array of all differences is held at once."""
    return np.array(
        [np.linalg.norm(np.diff(sample, n=order, axis=0), axis=-1).mean() * fps**order for sample in positions]
    )


def _checked_magnitudes(values: ArrayLike, name: str) -> FloatArray:
    checked = finite_array(values, name, (None,))
    if (checked < 0.0).any():
        raise BadInput(f"{name} must not be negative, got {checked.min():.3g}", where=name)
    return checked
