"""What is asked of the seven models: the next frame of a past, and a body that follows a source frame by frame."""

from __future__ import annotations

import numpy as np
from torch import Tensor

from bench.arrays import FloatArray
from bench.datasets.take import Take
from bench.errors import BadInput
from bench.methods.mason2022.features import FPS, local_rotations
from bench.methods.mason2022.mason2022 import MasonNetwork
from bench.methods.mason2022.rollout import AHEAD_FRAMES, Pose, Rollout, style_code
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.edit import resample
from bench.motion.kinematics import facing_yaw, world_positions
from bench.motion.skeleton import CANONICAL_PARENTS, Skeleton

WALKS_M_S = 0.2
"""From this speed on a path has a direction that the body's facing follows."""
VELOCITY_S = 0.25
"""A source's velocity is taken over this long."""


def code_of(network: MasonNetwork, style: Take) -> Tensor:
    """The code of a style: read off the take's clip by FiLM, known by the take's label otherwise.

    Raises
    ------
    BadInput : a label that was not trained.
    """
    config = network.config
    if config.modulation == "film":
        return style_code(network, style.clip)
    if style.style not in config.styles:
        raise BadInput(
            f"the model knows the styles {', '.join(config.styles)}, got {style.style!r}",
            where="style",
            cause="it tells styles by label, and this one was not trained",
        )
    return style_code(network, None, {style.style: 1.0})


def predict(network: MasonNetwork, code: Tensor, past: Clip, path_xz_m: FloatArray) -> Clip:
    """The frame after ``past``, on the bones that the predicted positions have.

    Parameters
    ----------
    past : at any frame rate; the model runs at 60 fps, in as many steps as lie between two frames.
    path_xz_m : ``[n, 2]`` of the root at the frame rate of ``past``, the predicted frame first.
    """
    rollout = Rollout(network, code, resample(past, FPS))
    places = np.vstack([rollout.xz_m[None], path_xz_m])
    times = np.arange(len(places)) * (FPS / past.fps)
    facing = rollout.yaw + _turns(places, past.fps)
    pose = None
    for step in range(max(1, round(FPS / past.fps))):
        at = step + AHEAD_FRAMES
        ahead = np.stack([np.interp(at, times, places[:, axis]) for axis in (0, 1)], axis=-1)
        rollout.ahead = None
        pose = rollout.step(ahead, np.interp(at, times, facing))
    if pose is None:  # unreachable: there is at least one step; here for type checkers
        raise ValueError("no step was made")
    skeleton = _fitting_skeleton(pose, past.skeleton)
    return Clip(skeleton, local_rotations(pose.rotations_wxyz)[None], pose.positions_m[:1], past.fps)


class FollowingStream:
    """One pose of a source in, one pose of the model out; the source's path is the user's wish.

    What the source will do is not known: its path goes on at its present velocity, its facing stays.

    Parameters
    ----------
    skeleton, fps : of the poses that come in.
    """

    def __init__(self, network: MasonNetwork, code: Tensor, skeleton: Skeleton, fps: float) -> None:
        self.network, self.code, self.skeleton, self.fps = network, code, skeleton, fps
        self.rollout: Rollout | None = None
        self.path: list[FloatArray] = []

    def step(self, rotations_wxyz: FloatArray, root_xyz_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Answer one frame: ``[21, 4]`` and ``[3]`` in, the same out; the first frame is the source's own."""
        frame = Clip(self.skeleton, rotations_wxyz[None], root_xyz_m[None], FPS)
        now = root_xyz_m[[0, 2]]
        back = round(VELOCITY_S * self.fps)
        self.path = [*self.path[-back:], now]
        if self.rollout is None:
            self.rollout = Rollout(self.network, self.code, frame)
            return rotations_wxyz, root_xyz_m
        velocity = (now - self.path[0]) / (len(self.path) - 1) * self.fps
        yaw = float(facing_yaw(world_positions(frame))[0])
        n_steps = max(1, round(FPS / self.fps))
        for step in range(n_steps):
            seconds = (AHEAD_FRAMES + 1 + step - n_steps) / FPS
            pose = self.rollout.step(now + seconds[:, None] * velocity, np.full(len(seconds), yaw))
        return local_rotations(pose.rotations_wxyz), pose.positions_m[0]


def _turns(path_xz_m: FloatArray, fps: float) -> FloatArray:
    """How far the direction of a path ``[n, 2]`` has turned since its start, ``[n]`` radians; held where it stands."""
    steps = np.diff(path_xz_m, axis=0)
    walks = np.linalg.norm(steps, axis=1) * fps > WALKS_M_S
    if not walks.any():
        return np.zeros(len(path_xz_m))
    direction = np.unwrap(np.arctan2(steps[walks, 0], steps[walks, 1]))
    turns = np.interp(np.arange(len(steps)), np.flatnonzero(walks), direction - direction[0])
    return np.concatenate([[0.0], turns])


def _fitting_skeleton(pose: Pose, like: Skeleton) -> Skeleton:
    """The skeleton with which the pose's rotations lead to its positions."""
    parents = list(CANONICAL_PARENTS[1:])
    bones = pose.positions_m[1:] - pose.positions_m[parents]
    offsets = np.zeros((len(CANONICAL_PARENTS), 3))
    offsets[1:] = quat.rotate(quat.conjugate(pose.rotations_wxyz[parents]), bones)
    return Skeleton(like.names, like.parents, offsets, like.virtual)
