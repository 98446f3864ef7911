"""Kinematics of clips: world positions, facing, floor, velocities, contacts.

Functions take arrays with a leading time axis; ``Clip`` versions are thin. Metres, seconds, radians, Y up, facing +Z is
yaw 0.
"""

from __future__ import annotations

import numpy as np

from bench.arrays import BoolArray, FloatArray
from bench.motion import _kernels, quat
from bench.motion.clip import Clip
from bench.motion.skeleton import (
    LEFT_ARM,
    LEFT_FOOT,
    LEFT_TOE,
    LEFT_UP_LEG,
    RIGHT_ARM,
    RIGHT_FOOT,
    RIGHT_TOE,
    RIGHT_UP_LEG,
    Skeleton,
)

FOOT_JOINTS = (LEFT_FOOT, LEFT_TOE, RIGHT_FOOT, RIGHT_TOE)


def forward_kinematics(
    rotations_wxyz: FloatArray, root_xyz_m: FloatArray, skeleton: Skeleton
) -> tuple[FloatArray, FloatArray]:
    """World positions ``[..., J, 3]`` and world rotations ``[..., J, 4]`` from local rotations ``[..., J, 4]``.

    Parameters
    ----------
    rotations_wxyz : ``[..., J, 4]`` unit quaternions.
    root_xyz_m : ``[..., 3]``.
    skeleton : J joints.
    """
    lead = rotations_wxyz.shape[:-2]
    joints = skeleton.n_joints
    positions, world = _kernels.forward_kinematics(
        np.ascontiguousarray(rotations_wxyz, dtype=np.float64).reshape(-1, joints, 4),
        np.ascontiguousarray(root_xyz_m, dtype=np.float64).reshape(-1, 3),
        np.ascontiguousarray(skeleton.offsets_m),
        np.asarray(skeleton.parents, dtype=np.int64),
    )
    return positions.reshape(*lead, joints, 3), world.reshape(*lead, joints, 4)


def world_positions(clip: Clip) -> FloatArray:
    """World joint positions of a clip, ``[T, J, 3]`` metres."""
    return forward_kinematics(clip.rotations_wxyz, clip.root_xyz_m, clip.skeleton)[0]


def facing_yaw(positions_m: FloatArray) -> FloatArray:
    """Facing direction of canonical poses as yaw about +Y, ``[..., 21, 3] -> [...]`` radians; 0 faces +Z.

    Across = (left - right upper leg) + (left - right arm), forward = across x up (Holden 2016, with the right indices
    for 21 joints). Where across is vertical the direction is undefined and 0 is returned.
    """
    across = (
        positions_m[..., LEFT_UP_LEG, :]
        - positions_m[..., RIGHT_UP_LEG, :]
        + positions_m[..., LEFT_ARM, :]
        - positions_m[..., RIGHT_ARM, :]
    )
    forward_x, forward_z = -across[..., 2], across[..., 0]
    return np.asarray(np.arctan2(forward_x, forward_z))


def smooth_yaw(yaw_rad: FloatArray, sigma_frames: float) -> FloatArray:
    """Gaussian smoothing of a yaw curve ``[T]`` after unwrapping (nearest edge mode, as Holden 2016)."""
    from scipy.ndimage import gaussian_filter1d

    return np.asarray(gaussian_filter1d(np.unwrap(yaw_rad), sigma_frames, mode="nearest"))


def floor_height(positions_m: FloatArray) -> float:
    """Height of the floor under a clip: the lowest foot or toe height over ``[T, 21, 3]``, metres."""
    return float(positions_m[:, FOOT_JOINTS, 1].min())


def velocities(positions_m: FloatArray, fps: float) -> FloatArray:
    """Backward-difference velocities ``[T, ..., 3]`` in m/s; frame 0 repeats frame 1, a single frame is 0."""
    result = np.zeros_like(positions_m)
    if positions_m.shape[0] > 1:
        result[1:] = np.diff(positions_m, axis=0) * fps
        result[0] = result[1]
    return result


def foot_contacts(
    positions_m: FloatArray,
    fps: float,
    *,
    max_speed_m_s: float = 0.4,
    max_height_m: float = 0.08,
) -> BoolArray:
    """Which feet stand, ``[T, 4]`` for left foot, left toe, right foot, right toe.

    A joint is in contact where it is slower than ``max_speed_m_s`` and lower than ``max_height_m`` over its own lowest
    point in the clip. Speed is taken on world positions, because in a root-relative frame a planted foot moves at
    walking speed.
    """
    feet = positions_m[:, FOOT_JOINTS, :]
    speed = np.linalg.norm(velocities(feet, fps), axis=-1)
    height = feet[..., 1] - feet[..., 1].min(axis=0)
    return np.asarray((speed < max_speed_m_s) & (height < max_height_m))


def yaw_aligned(
    rotations_wxyz: FloatArray, root_xyz_m: FloatArray, yaw_rad: FloatArray | float
) -> tuple[FloatArray, FloatArray]:
    """Turn motions by ``-yaw_rad`` about the world up axis.

    Parameters
    ----------
    rotations_wxyz : ``[..., T, J, 4]`` local rotations; only joint 0 changes.
    root_xyz_m : ``[..., T, 3]``.
    yaw_rad : broadcast against ``[..., T]``.
    """
    turn = np.broadcast_to(quat.about_y(-np.asarray(yaw_rad, dtype=np.float64)), (*root_xyz_m.shape[:-1], 4))
    rotations = rotations_wxyz.copy()
    rotations[..., 0, :] = quat.multiply(turn, rotations_wxyz[..., 0, :])
    return rotations, quat.rotate(turn, root_xyz_m)
