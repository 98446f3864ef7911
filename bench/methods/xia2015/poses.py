"""Poses as vectors, and the five-frame windows by which they are searched: numpy, nothing of the future."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bench.arrays import FloatArray
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.kinematics import facing_yaw, forward_kinematics
from bench.motion.skeleton import N_JOINTS, Skeleton

N_VECTORS = 3 * N_JOINTS
WINDOW_FRAMES = 5
"""Frames that a search sees: the present one and the four before it (the paper's window, by Tao et al. 2022)."""


@dataclass(frozen=True, eq=False)
class Poses:
    """Frames without their place and heading.

    Attributes
    ----------
    vectors : ``[T, 63]`` rotation vectors about the mean rotations, heading removed.
    yaw_rad : ``[T]`` headings. root_xyz_m : ``[T, 3]``.
    """

    vectors: FloatArray
    yaw_rad: FloatArray
    root_xyz_m: FloatArray


def read_poses(
    rotations_wxyz: FloatArray, root_xyz_m: FloatArray, skeleton: Skeleton, reference_wxyz: FloatArray
) -> Poses:
    """Frames ``[T, 21, 4]``, ``[T, 3]`` as vectors about ``reference_wxyz`` ``[21, 4]``.

    The skeleton serves the heading alone, so the mean one of the training will do for a stream.
    """
    positions, _ = forward_kinematics(rotations_wxyz, np.zeros_like(root_xyz_m), skeleton)
    yaw = facing_yaw(positions)
    local = np.array(rotations_wxyz)
    local[:, 0] = quat.multiply(quat.about_y(-yaw), rotations_wxyz[:, 0])
    vectors = quat.to_rotation_vector(quat.multiply(quat.conjugate(reference_wxyz)[None], local))
    return Poses(vectors.reshape(len(vectors), -1), yaw, root_xyz_m)


def to_rotations(vectors: FloatArray, yaw_rad: FloatArray, reference_wxyz: FloatArray) -> FloatArray:
    """Inverse of :func:`read_poses`: ``[T, 21, 4]`` with the headings put back."""
    local = quat.multiply(reference_wxyz[None], quat.from_rotation_vector(vectors.reshape(len(vectors), N_JOINTS, 3)))
    local[:, 0] = quat.multiply(quat.about_y(yaw_rad), local[:, 0])
    return local


def mean_reference(clips: list[Clip]) -> FloatArray:
    """Mean rotations ``[21, 4]`` of all frames, the root's without heading."""
    local = []
    for clip in clips:
        positions, _ = forward_kinematics(clip.rotations_wxyz, np.zeros_like(clip.root_xyz_m), clip.skeleton)
        turned = np.array(clip.rotations_wxyz)
        turned[:, 0] = quat.multiply(quat.about_y(-facing_yaw(positions)), turned[:, 0])
        local.append(turned)
    return quat.mean(np.concatenate(local))


def search_windows(poses: Poses, before: Poses | None = None) -> FloatArray:
    """What is searched by, ``[T, 63 + 63 + 4]``: the pose, how it changed over the window, and the root's motion.

    Root motion is the velocity in the present heading and the turn, per frame of the window.

    Parameters
    ----------
    before : the frames before these, at most ``WINDOW_FRAMES - 1`` count; without any the first one was held.
    """
    joined = poses if before is None else joined_poses(before, poses)
    last = np.arange(len(joined.yaw_rad) - len(poses.yaw_rad), len(joined.yaw_rad))
    first = np.maximum(last - (WINDOW_FRAMES - 1), 0)
    steps = WINDOW_FRAMES - 1
    turn = _wrapped(joined.yaw_rad[last] - joined.yaw_rad[first]) / steps
    path = quat.rotate(
        quat.about_y(-joined.yaw_rad[last]), (joined.root_xyz_m[last] - joined.root_xyz_m[first]) / steps
    )
    change = (joined.vectors[last] - joined.vectors[first]) / steps
    return np.concatenate([joined.vectors[last], change, path, turn[:, None]], axis=1)


def joined_poses(before: Poses, after: Poses) -> Poses:
    """Frames one after the other."""
    return Poses(
        np.concatenate([before.vectors, after.vectors]),
        np.concatenate([before.yaw_rad, after.yaw_rad]),
        np.concatenate([before.root_xyz_m, after.root_xyz_m]),
    )


def last_frames(poses: Poses, n_frames: int) -> Poses:
    """The last ``n_frames`` of them."""
    return Poses(poses.vectors[-n_frames:], poses.yaw_rad[-n_frames:], poses.root_xyz_m[-n_frames:])


def _wrapped(angle: FloatArray) -> FloatArray:
    return (angle + np.pi) % (2.0 * np.pi) - np.pi
