"""Frames as Mason 2022 sees them (section 3.2): the ground path around now, and the joints, in the body's own frame.

The body's frame at a moment lies on the ground under the hips and faces where the body faces, +Z forward. A frame's
input is the path over two seconds and 12 numbers a joint; its output the path of the second ahead and the joints of the
next moment, still in this moment's frame, so that the step between the two frames is part of the prediction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bench.arrays import BoolArray, FloatArray
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.kinematics import facing_yaw, floor_height, foot_contacts, forward_kinematics, velocities
from bench.motion.skeleton import CANONICAL_PARENTS, LEFT_HAND, LEFT_TOE, N_JOINTS, RIGHT_HAND, RIGHT_TOE

FPS = 60.0
SAMPLES_S = np.arange(-6, 6) / 6.0
"""Moments of the path around now: 12 samples, 10 frames at 60 fps apart, the seventh being now."""
N_AHEAD = 6
PER_JOINT = 12
END_EFFECTORS = (LEFT_HAND, RIGHT_HAND, LEFT_TOE, RIGHT_TOE)
FOOT_COLUMNS = (1, 3)
"""The toes among the four joints of ``foot_contacts``."""


@dataclass(frozen=True)
class Layout:
    """Where things are in an input and in an output frame; 348 and 342 wide with 25 joints, 300 and 294 with 21.

    Attributes
    ----------
    n_joints : of the skeleton.
    n_phases : 16 for local phases and their updates, 1 for the advance of a global phase, 0 without.
    """

    n_joints: int = N_JOINTS
    n_phases: int = 0

    @property
    def n_pose(self) -> int:
        return PER_JOINT * self.n_joints

    @property
    def n_input(self) -> int:
        return 4 * len(SAMPLES_S) + self.n_pose

    @property
    def n_output(self) -> int:
        return 4 * N_AHEAD + self.n_pose + self.n_phases + 2

    @property
    def pose(self) -> slice:
        """Joints in an output frame; the path of 24 numbers stands before them."""
        return slice(4 * N_AHEAD, 4 * N_AHEAD + self.n_pose)

    @property
    def phases(self) -> slice:
        return slice(self.pose.stop, self.pose.stop + self.n_phases)

    @property
    def contacts(self) -> slice:
        return slice(self.n_output - 2, self.n_output)


@dataclass(frozen=True, eq=False)
class Body:
    """A clip at 60 fps in world space, with the frames that features are taken in.

    Attributes
    ----------
    positions_m : ``[T, 21, 3]``, the floor at 0; velocities_m_s alike.
    rotations_wxyz : ``[T, 21, 4]`` world rotations.
    path_xz_m : ``[T, 2]`` of the hips over the ground. yaw_rad : ``[T]`` facing, continuous.
    contacts : ``[T, 2]`` of the left and the right toe.
    """

    positions_m: FloatArray
    velocities_m_s: FloatArray
    rotations_wxyz: FloatArray
    path_xz_m: FloatArray
    yaw_rad: FloatArray
    contacts: BoolArray

    @property
    def n_frames(self) -> int:
        return len(self.yaw_rad)


def body_of(clip: Clip) -> Body:
    """Forward kinematics, facing and contacts of a clip."""
    positions, rotations = forward_kinematics(clip.rotations_wxyz, clip.root_xyz_m, clip.skeleton)
    positions = positions - np.array([0.0, floor_height(positions), 0.0])
    return Body(
        positions_m=positions,
        velocities_m_s=velocities(positions, clip.fps),
        rotations_wxyz=rotations,
        path_xz_m=positions[:, 0, [0, 2]],
        yaw_rad=np.unwrap(facing_yaw(positions)),
        contacts=foot_contacts(positions, clip.fps)[:, FOOT_COLUMNS],
    )


def local_joints(body: Body, frames: slice, base: slice) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Positions and velocities ``[n, 21, 3]`` and rotations ``[n, 21, 4]`` of ``frames`` in the frames of ``base``."""
    turn = quat.about_y(-body.yaw_rad[base])[:, None]
    origin = np.stack([body.path_xz_m[base, 0], np.zeros(len(turn)), body.path_xz_m[base, 1]], axis=-1)[:, None]
    positions = quat.rotate(turn, body.positions_m[frames] - origin)
    moved = quat.rotate(turn, body.velocities_m_s[frames])
    return positions, moved, quat.multiply(turn, body.rotations_wxyz[frames])


def pose_features(positions_m: FloatArray, velocities_m_s: FloatArray, rotations_wxyz: FloatArray) -> FloatArray:
    """Per joint position, forward axis, up axis and velocity: ``[n, J, 3], [n, J, 3], [n, J, 4] -> [n, 12 J]``."""
    matrices = quat.to_matrix(rotations_wxyz)
    parts = [positions_m, matrices[..., 2], matrices[..., 1], velocities_m_s]
    return np.concatenate(parts, axis=-1).reshape(len(positions_m), -1)


def path_features(
    path_xz_m: FloatArray, yaw_rad: FloatArray, base_xz_m: FloatArray, base_yaw: FloatArray
) -> FloatArray:
    """Positions and directions of path samples in the body's frame: ``[n, S, 2], [n, S], [n, 2], [n] -> [n, 4 S]``."""
    offset = path_xz_m - base_xz_m[:, None]
    sine, cosine = np.sin(base_yaw)[:, None], np.cos(base_yaw)[:, None]
    x = cosine * offset[..., 0] - sine * offset[..., 1]
    z = sine * offset[..., 0] + cosine * offset[..., 1]
    turn = yaw_rad - base_yaw[:, None]
    return np.concatenate([x, z, np.sin(turn), np.cos(turn)], axis=1)


def path_at(body: Body, frames: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Path ``[..., 2]`` and facing ``[...]`` at fractional frames; beyond the clip velocity and facing are held."""
    last = body.n_frames - 1
    inside = np.clip(frames, 0, last)
    beyond = (frames - inside)[..., None]
    at = np.arange(body.n_frames, dtype=np.float64)
    path = np.stack([np.interp(inside, at, body.path_xz_m[:, axis]) for axis in (0, 1)], axis=-1)
    reach = min(10, last)
    if reach:
        start = (body.path_xz_m[reach] - body.path_xz_m[0]) / reach
        end = (body.path_xz_m[last] - body.path_xz_m[last - reach]) / reach
        path = path + np.where(beyond < 0, beyond * start, beyond * end)
    return path, np.interp(inside, at, body.yaw_rad)


def input_frames(body: Body) -> FloatArray:
    """Inputs ``[T - 1, n_input]`` of all frames that have a next one."""
    now = slice(0, body.n_frames - 1)
    places = np.arange(body.n_frames - 1)[:, None] + SAMPLES_S * FPS
    path = path_features(*path_at(body, places), body.path_xz_m[now], body.yaw_rad[now])
    return np.concatenate([path, pose_features(*local_joints(body, now, now))], axis=1)


def output_frames(body: Body) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Path ``[T - 1, 24]``, joints ``[T - 1, 12 J]`` and contacts ``[T - 1, 2]`` of the frames that come next."""
    now, following = slice(0, body.n_frames - 1), slice(1, body.n_frames)
    places = np.arange(1, body.n_frames)[:, None] + SAMPLES_S[-N_AHEAD:] * FPS
    path = path_features(*path_at(body, places), body.path_xz_m[now], body.yaw_rad[now])
    pose = pose_features(*local_joints(body, following, now))
    return path, pose, body.contacts[following].astype(np.float64)


def clip_features(body: Body) -> FloatArray:
    """A style clip ``[T, 12 J]``: joints in their own frames, without path (section 3.2)."""
    everything = slice(0, body.n_frames)
    return pose_features(*local_joints(body, everything, everything))


def gate_velocities(pose: FloatArray) -> FloatArray:
    """Velocities of hands and toes ``[..., 12]`` in pose features ``[..., 12 J]``: what gates MANN's experts."""
    joints = pose.reshape(*pose.shape[:-1], -1, PER_JOINT)
    return joints[..., list(END_EFFECTORS), 9:].reshape(*pose.shape[:-1], -1)


def pose_of(features: FloatArray, n_joints: int = N_JOINTS) -> tuple[FloatArray, FloatArray]:
    """Positions ``[..., J, 3]`` and rotations ``[..., J, 4]`` of pose features ``[..., 12 J]``.

    The up axis is kept, the forward axis made orthogonal to it.
    """
    joints = features.reshape(*features.shape[:-1], n_joints, PER_JOINT)
    up = joints[..., 6:9] / np.maximum(np.linalg.norm(joints[..., 6:9], axis=-1, keepdims=True), 1e-9)
    forward = joints[..., 3:6] - (joints[..., 3:6] * up).sum(axis=-1, keepdims=True) * up
    forward = forward / np.maximum(np.linalg.norm(forward, axis=-1, keepdims=True), 1e-9)
    matrices = np.stack([np.cross(up, forward), up, forward], axis=-1)
    return joints[..., :3], quat.from_matrix(matrices)


def local_rotations(world_wxyz: FloatArray) -> FloatArray:
    """World rotations ``[..., 21, 4]`` of the canonical joints as rotations relative to their parents."""
    local = world_wxyz.copy()
    parents = list(CANONICAL_PARENTS[1:])
    local[..., 1:, :] = quat.multiply(quat.conjugate(world_wxyz[..., parents, :]), world_wxyz[..., 1:, :])
    return local
