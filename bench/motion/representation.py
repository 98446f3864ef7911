"""Clips as feature arrays with named slices, and back.

Two frames of reference occur. *Window frame*: the root's ground position is removed frame by frame, but the heading
only once, as the mean facing of the whole window, so that turns stay visible; judges read this. *Local frame*: ground
position and heading are both removed frame by frame; the papers' generators read this, with the removed path in a
``RootTrack``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bench.arrays import FloatArray, finite_array
from bench.errors import BadMotion
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.kinematics import FOOT_JOINTS, facing_yaw, forward_kinematics, world_positions, yaw_aligned
from bench.motion.skeleton import Skeleton

PARK_SLICES = {"rotation_wxyz": slice(0, 4), "position_m": slice(4, 7)}
"""Park 2021, section 3: per joint a unit quaternion and a position, 7 channels."""

POSITION_6D_SLICES = {"position_m": slice(0, 3), "forward": slice(3, 6), "up": slice(6, 9)}
"""Motion Puzzle 2022, section 3.1: per joint a position and two axes of the world rotation, 9 channels."""

JUDGE_SLICES = {"position_statures": slice(0, 3), "rotation_wxyz": slice(3, 7)}
"""What judges read: root-relative positions in statures, local rotations with the root in the window frame."""


@dataclass(frozen=True, eq=False)
class RootTrack:
    """The path that the local frame removes: heading ``yaw_rad`` ``[T]`` and ground position ``xz_m`` ``[T, 2]``."""

    yaw_rad: FloatArray
    xz_m: FloatArray


def mean_facing(positions_m: FloatArray) -> FloatArray:
    """Circular mean over time of the facing direction, ``[..., T, 21, 3] -> [...]`` radians."""
    yaw = facing_yaw(positions_m)
    return np.asarray(np.arctan2(np.sin(yaw).mean(axis=-1), np.cos(yaw).mean(axis=-1)))


def window_frame(
    rotations_wxyz: FloatArray, root_xyz_m: FloatArray, skeleton: Skeleton
) -> tuple[FloatArray, FloatArray]:
    """Positions ``[..., T, 21, 3]`` in statures and local rotations ``[..., T, 21, 4]`` in the window frame.

    Heights are over the window's own floor (its lowest foot or toe point).

    Parameters
    ----------
    rotations_wxyz : ``[..., T, 21, 4]``, windows of one skeleton.
    root_xyz_m : ``[..., T, 3]``.
    skeleton : canonical.
    """
    if not skeleton.is_canonical:
        raise BadMotion("window features are defined on the canonical 21 joints", remedy="retarget the clip first")
    positions, _ = forward_kinematics(rotations_wxyz, root_xyz_m, skeleton)
    floor = positions[..., FOOT_JOINTS, 1].min(axis=(-1, -2))
    rotations, root = yaw_aligned(rotations_wxyz, root_xyz_m, mean_facing(positions)[..., None])
    root = root * np.array([0.0, 1.0, 0.0])
    root[..., 1] -= floor[..., None]
    local, _ = forward_kinematics(rotations, root, skeleton)
    return local / skeleton.stature_m, rotations


def judge_features(clip: Clip) -> FloatArray:
    """What a judge reads of a window: ``[T, 21, 7]``, slices in ``JUDGE_SLICES``.

    The signs of the rotations are as in the clip; each judge flips them to its own reference.
    """
    return np.concatenate(window_frame(clip.rotations_wxyz, clip.root_xyz_m, clip.skeleton), axis=-1)


def yaw_aligned_quaternions(clip: Clip) -> FloatArray:
    """Local rotations ``[T, 21, 4]`` with the root in the window frame: what the auto-encoder reads."""
    return window_frame(clip.rotations_wxyz, clip.root_xyz_m, clip.skeleton)[1]


def local_frame(clip: Clip) -> tuple[FloatArray, FloatArray, RootTrack]:
    """Positions ``[T, 21, 3]`` m, world rotations ``[T, 21, 4]`` in the local frame, and what was removed."""
    yaw = facing_yaw(world_positions(clip))
    ground = clip.root_xyz_m * np.array([0.0, 1.0, 0.0])
    rotations, _ = yaw_aligned(clip.rotations_wxyz, clip.root_xyz_m, yaw)
    positions, world = forward_kinematics(rotations, ground, clip.skeleton)
    return positions, world, RootTrack(yaw, clip.root_xyz_m[:, [0, 2]])


def park_features(clip: Clip) -> tuple[FloatArray, RootTrack]:
    """Park 2021's ``[T, 21, 7]``: local rotations (the root's in the local frame) and root-relative positions."""
    positions, _, track = local_frame(clip)
    rotations, _ = yaw_aligned(clip.rotations_wxyz, clip.root_xyz_m, track.yaw_rad)
    return np.concatenate([rotations, positions], axis=-1), track


def clip_from_park(features: FloatArray, track: RootTrack, skeleton: Skeleton, fps: float) -> Clip:
    """Inverse of :func:`park_features`: rotations are taken, positions only for the root's height."""
    features = finite_array(features, "features", (None, skeleton.n_joints, 7))
    rotations = quat.normalise(features[..., PARK_SLICES["rotation_wxyz"]])
    return _placed(rotations, features[:, 0, 5], track, skeleton, fps)


def position_6d_features(clip: Clip) -> tuple[FloatArray, RootTrack]:
    """Motion Puzzle's ``[T, 21, 9]``: position, forward (z) and up (y) axis of each joint's rotation, local frame."""
    positions, world, track = local_frame(clip)
    matrices = quat.to_matrix(world)
    return np.concatenate([positions, matrices[..., :, 2], matrices[..., :, 1]], axis=-1), track


def clip_from_position_6d(features: FloatArray, track: RootTrack, skeleton: Skeleton, fps: float) -> Clip:
    """Inverse of :func:`position_6d_features`: axes are orthonormalised (Zhou et al. 2019), then made local."""
    features = finite_array(features, "features", (None, skeleton.n_joints, 9))
    world = quat.from_matrix(matrix_from_axes(features[..., 3:6], features[..., 6:9]))
    local = world.copy()
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            local[:, joint] = quat.multiply(quat.conjugate(world[:, parent]), world[:, joint])
    return _placed(quat.normalise(local), features[:, 0, 1], track, skeleton, fps)


def matrix_from_axes(forward: FloatArray, up: FloatArray) -> FloatArray:
    """Rotation matrices ``[..., 3, 3]`` whose z axis is ``forward`` and whose y axis is nearest to ``up``."""
    z_axis = forward / np.linalg.norm(forward, axis=-1, keepdims=True)
    y_axis = up - np.sum(up * z_axis, axis=-1, keepdims=True) * z_axis
    y_axis = y_axis / np.linalg.norm(y_axis, axis=-1, keepdims=True)
    return np.stack([np.cross(y_axis, z_axis), y_axis, z_axis], axis=-1)


def _placed(rotations: FloatArray, height_m: FloatArray, track: RootTrack, skeleton: Skeleton, fps: float) -> Clip:
    turned, _ = yaw_aligned(rotations, np.zeros((len(rotations), 3)), -track.yaw_rad)
    root = np.stack([track.xz_m[:, 0], height_m, track.xz_m[:, 1]], axis=-1)
    return Clip(skeleton, turned, root, fps)
