"""Frame after frame along a ground path that a user gives (Mason 2022, section 4.4), each fed with the one before."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from bench.arrays import FloatArray
from bench.methods.mason2022.examples import (
    LEFT_TOE_PLACE,
    axes_of,
    local_phases,
    style_clip,
    toe_phase,
)
from bench.methods.mason2022.features import (
    FPS,
    N_AHEAD,
    PER_JOINT,
    SAMPLES_S,
    Body,
    body_of,
    clip_features,
    gate_velocities,
    local_joints,
    local_rotations,
    path_features,
    pose_features,
    pose_of,
)
from bench.methods.mason2022.mason2022 import MasonNetwork
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.edit import resample

AHEAD_FRAMES = np.rint(SAMPLES_S[-N_AHEAD:] * FPS).astype(np.int64)
"""0, 10, ..., 50: the path is sampled now and at five later moments."""
USER_WEIGHTS = np.linspace(0.0, 1.0, N_AHEAD)
"""Share of the user's wish in each sample ahead; the rest is the network's own prediction."""
HISTORY_FRAMES = 61


@dataclass(frozen=True, eq=False)
class Pose:
    """A body in world space: positions ``[21, 3]`` m, rotations ``[21, 4]`` of joints in world axes."""

    positions_m: FloatArray
    rotations_wxyz: FloatArray


@torch.no_grad()
def style_code(network: MasonNetwork, clip: Clip | None, weights: dict[str, float] | None = None) -> Tensor:
    """The code ``[1, ...]`` of a style: FiLM parameters of a clip, or weights of known styles.

    Raises
    ------
    KeyError : a style that was not seen in training.
    """
    config = network.config
    known: Tensor | None = None
    if config.modulation != "film":
        known = torch.zeros(1, len(config.styles))
        for style, weight in (weights or {}).items():
            if style not in config.styles:
                raise KeyError(style)
            known[0, config.styles.index(style)] = weight
    clips = torch.zeros(1, config.clip_frames, config.layout.n_pose)
    if clip is not None and known is None:
        features = style_clip(clip_features(body_of(resample(clip, FPS))), config.clip_frames)
        clips = torch.from_numpy(features.astype(np.float32)[None])
    return network.code(clips, known)


class Rollout:
    """A body that walks; a copy of the object goes on by itself.

    Parameters
    ----------
    past : at 60 fps; its last frame is where the body is now.
    code : of the style, which may be exchanged at any frame.
    """

    def __init__(self, network: MasonNetwork, code: Tensor, past: Clip) -> None:
        self.network = network
        self.code = code
        body = body_of(past)
        last = slice(body.n_frames - 1, body.n_frames)
        self.xz_m, self.yaw = body.path_xz_m[-1].copy(), float(body.yaw_rad[-1])
        self.floor_m = float(past.root_xyz_m[-1, 1] - body.positions_m[-1, 0, 1])
        self.pose = pose_features(*local_joints(body, last, last))[0]
        places = np.maximum(np.arange(body.n_frames - HISTORY_FRAMES, body.n_frames), 0)
        self.history = deque(
            zip(body.path_xz_m[places], body.yaw_rad[places].tolist(), strict=True), maxlen=HISTORY_FRAMES
        )
        self.gate = _first_gate(network, body)
        self.ahead: tuple[FloatArray, FloatArray] | None = None

    def __copy__(self) -> Rollout:
        twin = object.__new__(Rollout)
        twin.__dict__.update(self.__dict__)
        twin.history = self.history.copy()
        return twin

    @torch.no_grad()
    def step(self, ahead_xz_m: FloatArray, ahead_yaw: FloatArray) -> Pose:
        """The next frame.

        Parameters
        ----------
        ahead_xz_m, ahead_yaw : ``[6, 2]``, ``[6]`` where the user wants the body to be 0, 10, ..., 50 frames from now
            and how to face, in world space.
        """
        network, layout = self.network, self.network.config.layout
        if self.ahead is not None:
            weight = USER_WEIGHTS
            ahead_xz_m = weight[:, None] * ahead_xz_m + (1.0 - weight[:, None]) * self.ahead[0]
            ahead_yaw = self.ahead[1] + weight * _short_way(ahead_yaw - self.ahead[1])
        inputs = np.concatenate([self._path(ahead_xz_m, ahead_yaw), self.pose])
        gate = self.gate if network.config.backbone != "mann" else gate_velocities(self.pose)
        output = network(_batch(inputs), _batch(gate), self.code)[0].numpy().astype(np.float64)
        self._advance_gate(output[layout.phases])
        return self._move(output[: layout.pose.start].reshape(4, N_AHEAD), output[layout.pose])

    def _path(self, ahead_xz_m: FloatArray, ahead_yaw: FloatArray) -> FloatArray:
        before = [self.history[-1 - frames] for frames in range(60, 0, -10)]
        path = np.stack([*(xz for xz, _ in before), self.xz_m, *ahead_xz_m[1:]])
        yaw = np.array([*(yaw for _, yaw in before), self.yaw, *ahead_yaw[1:]])
        return path_features(path[None], yaw[None], self.xz_m[None], np.array([self.yaw])).reshape(-1)

    def _advance_gate(self, predicted: FloatArray) -> None:
        backbone = self.network.config.backbone
        if backbone == "lpn":
            phases, updates = np.split(predicted, 2)
            self.gate = 0.5 * (phases + self.gate + updates)
        elif backbone == "pfnn":
            self.gate = (self.gate + np.maximum(predicted, 0.0)) % 1.0

    def _move(self, path: FloatArray, pose: FloatArray) -> Pose:
        """Put predicted joints into the world and make the body's new frame the current one."""
        x, z, sine, cosine = path
        turn = quat.about_y(self.yaw)
        origin = np.array([self.xz_m[0], 0.0, self.xz_m[1]])
        positions, rotations = pose_of(pose)
        world = Pose(
            quat.rotate(turn, positions) + origin + np.array([0.0, self.floor_m, 0.0]),
            quat.multiply(np.broadcast_to(turn, rotations.shape), rotations),
        )
        ahead = quat.rotate(turn, np.stack([x, np.zeros_like(x), z], axis=-1)) + origin
        self.ahead = ahead[:, [0, 2]], self.yaw + np.arctan2(sine, cosine)
        joints = pose.reshape(-1, PER_JOINT).copy()
        joints[:, [0, 2]] -= path[:2, 0]
        back = quat.about_y(-np.arctan2(sine[0], cosine[0]))
        self.pose = quat.rotate(back, joints.reshape(-1, 4, 3)).reshape(-1)
        self.xz_m, self.yaw = self.ahead[0][0], float(self.ahead[1][0])
        self.history.append((self.xz_m, self.yaw))
        return world


def along(rollout: Rollout, path_xz_m: FloatArray, path_yaw: FloatArray, like: Clip) -> Clip:
    """Follow a path given at 60 fps, a frame a row: ``[n, 2]``, ``[n]``; the clip has the bones of ``like``."""
    last = len(path_xz_m) - 1
    poses = []
    for frame in range(len(path_xz_m)):
        ahead = np.minimum(frame + AHEAD_FRAMES, last)
        beyond = (frame + AHEAD_FRAMES - ahead)[:, None]
        wanted = path_xz_m[ahead] + beyond * (path_xz_m[last] - path_xz_m[last - 1])
        poses.append(rollout.step(wanted, path_yaw[ahead]))
    rotations = local_rotations(np.stack([pose.rotations_wxyz for pose in poses]))
    return Clip(like.skeleton, rotations, np.stack([pose.positions_m[0] for pose in poses]), FPS)


def _first_gate(network: MasonNetwork, body: Body) -> FloatArray:
    """What gates the experts at the end of a past: read off the middle of its last second and carried on to its end."""
    config = network.config
    if config.backbone == "mann" or body.n_frames < 4:
        return np.zeros(config.size.n_gate)
    axes = axes_of([body])
    middle = max(body.n_frames - 1 - HISTORY_FRAMES // 2, 0)
    toe = toe_phase(body, axes[LEFT_TOE_PLACE])
    if config.backbone == "pfnn":
        advance = toe.frequency_hz[middle] * (body.n_frames - 1 - middle) / FPS
        return np.array([(toe.phase[middle] + advance + config.phase_shift) % 1.0])
    return local_phases(body, axes, as_released=config.as_released)[-1:].reshape(-1)


def _short_way(turn: FloatArray) -> FloatArray:
    return np.asarray((turn + np.pi) % (2.0 * np.pi) - np.pi)


def _batch(row: FloatArray) -> Tensor:
    return torch.from_numpy(row.astype(np.float32)[None])
