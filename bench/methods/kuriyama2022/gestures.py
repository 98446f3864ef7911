"""What the paper's networks read and write: logarithmic maps of joint rotations, and the root that follows from a foot.

Kuriyama 2022, section 3.1: 21 joints, three numbers each; 13 joints of the upper half (root, torso, head, two arms) are
read, 8 joints of the legs are predicted from them. The heading is taken out and copied from the content: that of hips
and shoulders, where the paper takes the root's own turn about the vertical axis. The root's position is never seen by
a network.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bench.arrays import FloatArray
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.edit import resample
from bench.motion.kinematics import FOOT_JOINTS, floor_height, forward_kinematics, world_positions, yaw_aligned
from bench.motion.pose import heading_removed
from bench.motion.skeleton import N_JOINTS, Skeleton

FPS = 60.0
LOWER_JOINTS = tuple(range(1, 9))
UPPER_JOINTS = tuple(joint for joint in range(N_JOINTS) if joint not in LOWER_JOINTS)
UPPER_CHANNELS = 3 * len(UPPER_JOINTS)
LOWER_CHANNELS = 3 * len(LOWER_JOINTS)


@dataclass(frozen=True, eq=False)
class Gesture:
    """A motion as the networks see it.

    Attributes
    ----------
    upper : ``[T, 39]`` logarithmic maps of the upper joints, the root without its heading.
    lower : ``[T, 24]`` of the legs.
    yaw_rad : ``[T]`` the heading that was taken out.
    """

    upper: FloatArray
    lower: FloatArray
    yaw_rad: FloatArray


def gesture_of(clip: Clip) -> Gesture:
    """A clip, resampled to 60 fps, as logarithmic maps."""
    clip = resample(clip, FPS)
    aligned, yaw = heading_removed(clip)
    vectors = quat.to_rotation_vector(aligned)
    n_frames = clip.n_frames
    return Gesture(
        upper=vectors[:, UPPER_JOINTS].reshape(n_frames, UPPER_CHANNELS),
        lower=vectors[:, LOWER_JOINTS].reshape(n_frames, LOWER_CHANNELS),
        yaw_rad=yaw,
    )


def clip_of(upper: FloatArray, lower: FloatArray, content: Clip) -> Clip:
    """The motion of decoded maps ``[T, 39]`` and ``[T, 24]`` on the bones of a content at 60 fps, with its heading.

    The root starts where the content's does; the rest of its path follows from the feet.
    """
    n_frames = content.n_frames
    vectors = np.empty((n_frames, N_JOINTS, 3))
    vectors[:, UPPER_JOINTS] = upper.reshape(n_frames, len(UPPER_JOINTS), 3)
    vectors[:, LOWER_JOINTS] = lower.reshape(n_frames, len(LOWER_JOINTS), 3)
    _, yaw = heading_removed(content)
    rotations, _ = yaw_aligned(quat.from_rotation_vector(vectors), np.zeros((n_frames, 3)), -yaw)
    floor_m = floor_height(world_positions(content))
    root = root_on_planted_foot(rotations, content.skeleton, content.root_xyz_m[0, [0, 2]], floor_m)
    return content.with_motion(rotations, root)


def root_on_planted_foot(
    rotations_wxyz: FloatArray, skeleton: Skeleton, start_xz_m: FloatArray, floor_m: float
) -> FloatArray:
    """Root path ``[T, 3]`` that keeps the lower foot at the floor and in its place (section 3.1).

    From one frame to the next the foot point that was lowest does not move over the ground.

    Parameters
    ----------
    rotations_wxyz : ``[T, 21, 4]`` local rotations, heading included.
    skeleton : canonical.
    start_xz_m : ``[2]`` ground position of the root in the first frame.
    floor_m : height of the floor.
    """
    feet, _ = forward_kinematics(rotations_wxyz, np.zeros((len(rotations_wxyz), 3)), skeleton)
    feet = feet[:, FOOT_JOINTS]
    lowest = feet[..., 1].argmin(axis=1)
    frames = np.arange(len(feet))
    root = np.empty((len(feet), 3))
    root[:, 1] = floor_m - feet[frames, lowest, 1]
    planted = lowest[:-1]
    steps = feet[frames[:-1], planted][:, [0, 2]] - feet[frames[1:], planted][:, [0, 2]]
    root[:, [0, 2]] = start_xz_m + np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    return root
