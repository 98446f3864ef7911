"""Park 2021's features as the paper words them: of every joint the position and the rotation in the body's frame.

The frame is the root put on the ground, turned by the smoothed facing direction. Unlike
:func:`bench.motion.representation.park_features`, rotations are those of the joint in that frame, not relative to its
parent. Positions are in statures over the clip's floor, so that bodies of all sizes look alike.
"""

from __future__ import annotations

import numpy as np

from bench.arrays import FloatArray, finite_array
from bench.errors import BadMotion
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.fit_rotations import fit_rotations
from bench.motion.kinematics import (
    facing_yaw,
    floor_height,
    forward_kinematics,
    smooth_yaw,
    world_positions,
    yaw_aligned,
)
from bench.motion.representation import RootTrack
from bench.motion.skeleton import N_JOINTS

POSITION, ROTATION = slice(0, 3), slice(3, 7)
"""Channels of a joint: position in statures, unit quaternion w, x, y, z."""

FACING_SMOOTHING_S = 20.0 / 30.0


def park_frame_features(clip: Clip) -> tuple[FloatArray, RootTrack]:
    """Features ``[T, 21, 7]`` and the path that they leave out; rotations keep their sign over time."""
    if not clip.skeleton.is_canonical:
        raise BadMotion("features are defined on the canonical 21 joints", remedy="retarget the clip first")
    world = world_positions(clip)
    yaw = smooth_yaw(facing_yaw(world), FACING_SMOOTHING_S * clip.fps)
    ground = clip.root_xyz_m * np.array([0.0, 1.0, 0.0]) - np.array([0.0, floor_height(world), 0.0])
    turned, _ = yaw_aligned(clip.rotations_wxyz, ground, yaw)
    positions, rotations = forward_kinematics(turned, ground, clip.skeleton)
    scaled = positions / clip.skeleton.stature_m
    return np.concatenate([scaled, quat.continuous(rotations)], axis=-1), RootTrack(yaw, clip.root_xyz_m[:, [0, 2]])


def clip_from_park_frame(features: FloatArray, track: RootTrack, like: Clip, *, by_positions: bool) -> Clip:
    """Inverse of :func:`park_frame_features` for the bones, the floor and the frame rate of ``like``.

    Parameters
    ----------
    features : ``[T, 21, 7]``; rotations need not be of unit length.
    track : path over the ground and heading.
    like : the clip whose body moves, T frames.
    by_positions : turn bones from where the rotations have them to where the positions do.
    """
    features = finite_array(features, "features", (like.n_frames, N_JOINTS, 7))
    world = quat.normalise(features[..., ROTATION])
    local = world.copy()
    children = list(range(1, N_JOINTS))
    parents = [like.skeleton.parents[joint] for joint in children]
    local[:, children] = quat.multiply(quat.conjugate(world[:, parents]), world[:, children])
    positions = features[..., POSITION] * like.skeleton.stature_m
    positions[..., 1] += floor_height(world_positions(like))
    turned, _ = yaw_aligned(local, positions[:, 0], -track.yaw_rad)
    root = np.stack([track.xz_m[:, 0], positions[:, 0, 1], track.xz_m[:, 1]], axis=-1)
    clip = like.with_motion(quat.normalise(turned), root)
    if not by_positions:
        return clip
    around = positions - positions[:, :1]
    return fit_rotations(root[:, None] + quat.rotate(quat.about_y(track.yaw_rad)[:, None], around), clip)
