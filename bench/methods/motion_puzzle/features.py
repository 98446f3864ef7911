"""Motion Puzzle's features: per joint position, forward axis, up axis, velocity, and the root's velocities repeated.

Jang et al. 2022, section 3. Local means: without the root's ground position and without the facing direction, which is
smoothed over time (Gaussian of 20 frames at 60 fps). The released code drops the root's three channels.
"""

from __future__ import annotations

import numpy as np

from bench.arrays import FloatArray
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.kinematics import (
    facing_yaw,
    forward_kinematics,
    smooth_yaw,
    velocities,
    world_positions,
    yaw_aligned,
)
from bench.motion.representation import RootTrack, clip_from_position_6d

CHANNELS = {"position_m": slice(0, 3), "forward": slice(3, 6), "up": slice(6, 9), "velocity_m_s": slice(9, 12)}
ROOT_CHANNELS = {"velocity_xz_m_s": slice(12, 14), "turn_rad_s": slice(14, 15)}
N_JOINT_CHANNELS, N_CHANNELS = 12, 15
SMOOTHING_S = 20.0 / 60.0


def puzzle_features(clip: Clip) -> tuple[FloatArray, RootTrack]:
    """A clip as ``[T, 21, 15]`` (slices in ``CHANNELS`` and ``ROOT_CHANNELS``) and the path that was removed."""
    positions = world_positions(clip)
    yaw = smooth_yaw(facing_yaw(positions), SMOOTHING_S * clip.fps)
    rotations, _ = yaw_aligned(clip.rotations_wxyz, clip.root_xyz_m, yaw)
    local, world = forward_kinematics(rotations, clip.root_xyz_m * np.array([0.0, 1.0, 0.0]), clip.skeleton)
    matrices = quat.to_matrix(world)
    turn = quat.about_y(-yaw)[:, None]
    local_velocity = quat.rotate(turn, velocities(positions, clip.fps))
    root_velocity = quat.rotate(turn[:, 0], velocities(clip.root_xyz_m, clip.fps))[:, [0, 2]]
    turning = velocities(yaw[:, None], clip.fps)
    root = np.concatenate([root_velocity, turning], axis=-1)[:, None].repeat(local.shape[1], axis=1)
    features = np.concatenate([local, matrices[..., :, 2], matrices[..., :, 1], local_velocity, root], axis=-1)
    return features, RootTrack(yaw, clip.root_xyz_m[:, [0, 2]])


def clip_from_puzzle(features: FloatArray, content: Clip) -> Clip:
    """The clip of ``[T, 21, 12 or 15]`` on the content's bones.

    With 15 channels the root's path is integrated from its velocities, the mean over joints, from where the content
    starts; with 12 it is the content's, as in the released code.
    """
    _, track = puzzle_features(content)
    if features.shape[-1] == N_CHANNELS:
        track = _integrated(features[..., 12:].mean(axis=1), track, content.fps)
    clip = clip_from_position_6d(features[..., :9], track, content.skeleton, content.fps)
    return content.with_motion(clip.rotations_wxyz, clip.root_xyz_m)


def _integrated(root: FloatArray, start: RootTrack, fps: float) -> RootTrack:
    """Path of root velocities ``[T, 3]``; the first frame's velocity leads to the first frame and is not used."""
    steps = root / fps
    steps[0] = 0.0
    yaw = start.yaw_rad[0] + np.cumsum(steps[:, 2])
    across = np.stack([steps[:, 0], np.zeros(len(steps)), steps[:, 1]], axis=-1)
    return RootTrack(yaw, start.xz_m[0] + np.cumsum(quat.rotate(quat.about_y(yaw), across)[:, [0, 2]], axis=0))
