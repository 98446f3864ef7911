"""Aberman et al. 2020, Unpaired Motion Style Transfer from Video to Animation (ACM TOG 39, 4).

A content encoder whose instance norm takes the style out, a style encoder for motion in space and one for projected
(video) motion that share their space, and a decoder that AdaIN gives the style. Style labels, no content labels.
Lengths are in the unit of the paper's data, because the weights of its losses belong to that unit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from bench.arrays import FloatArray
from bench.methods import rotations
from bench.methods.aberman2020.losses import feature_distance, quaternion_norm, twist, with_differences
from bench.methods.aberman2020.network import LEAST_FRAMES, Discriminator, Generator, NetworkSize
from bench.methods.layers import gradient_penalty, hinge_discriminator
from bench.methods.training import Curves, FitRequest, Losses, Stateful, Trainable, seeded, train
from bench.methods.windows import (
    FPS,
    Draws,
    Standardise,
    Windows,
    at_training_rate,
    cut_windows,
    hold,
    padded_frames,
    to_tensor,
)
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.edit import resample
from bench.motion.kinematics import facing_yaw, forward_kinematics, smooth_yaw, world_positions, yaw_aligned
from bench.motion.skeleton import N_JOINTS

UNIT_M = 0.056444
"""The paper's unit of length (CMU skeletons), metres."""
SMOOTHING_FRAMES = 20.0
"""Deviation of the Gaussian over the facing direction, frames at 30 fps."""
ROTATIONS, POSITIONS, ROOT = slice(0, 84), slice(84, 144), slice(144, 148)
"""Of the 148 numbers of a pose: local quaternions, positions of joints 1 to 20, the root's place and heading."""


@dataclass(frozen=True)
class AbermanConfig:
    """Everything that decides a training; the defaults are the paper's and its code's.

    Attributes
    ----------
    width : factor on all inner channels.
    video : build and train the encoder of projected motion, in every second step.
    n_frames, stride : of the training windows.
    transfer_share : of a loss that applies to transferred and to rebuilt motion alike, the transferred one's share.
    penalty_of_mean : as the released code: the gradient penalty is taken of the mean score of a batch, which divides
        it by the square of the batch.
    scaled_output : not in the paper: the decoder's output is in deviations from the mean rotation of the fit part.
    """

    width: float = 1.0
    video: bool = True
    n_frames: int = 32
    stride: int = 8
    n_steps: int = 300_000
    batch: int = 128
    rate: float = 1e-4
    weight_decay: float = 1e-4
    adversarial: float = 1.0
    reconstruction: float = 1.0
    rotation: float = 1.0
    feature: float = 0.5
    quaternion: float = 0.1
    twist: float = 1.0
    twist_limit_deg: float = 100.0
    triplet: float = 0.3
    triplet_margin: float = 5.0
    joint: float = 0.3
    penalty: float = 10.0
    transfer_share: float = 0.5
    penalty_of_mean: bool = False
    scaled_output: bool = False

    @property
    def size(self) -> NetworkSize:
        full = NetworkSize(4 * N_JOINTS + 4, 3 * N_JOINTS + 1, 2 * N_JOINTS if self.video else 0, 4 * N_JOINTS)
        return full.narrowed(self.width)


CONFIGS = {
    "smoke": AbermanConfig(width=0.1, n_steps=3, batch=4, stride=16),
    "small": AbermanConfig(width=0.5, n_steps=2400, batch=16, rate=5e-4, scaled_output=True),
    "paper": AbermanConfig(),
}


class AbermanNetwork(nn.Module):
    """The generator with the normalisation of its inputs."""

    def __init__(self, config: AbermanConfig) -> None:
        super().__init__()
        size = config.size
        self.generator = Generator(size)
        self.content_scale = Standardise(size.content)
        self.style_scale = Standardise(size.style)
        self.video_scale = Standardise(max(size.video, 1))
        self.output_scale = Standardise(size.output) if config.scaled_output else None

    def content_code(self, poses: Tensor) -> Tensor:
        """Poses ``[B, T, 148]`` to ``[B, hidden, T / 2]``."""
        known = torch.cat([poses[..., ROTATIONS], poses[..., ROOT]], dim=2)
        code: Tensor = self.generator.content_encoder(self.content_scale(known).transpose(1, 2))
        return code

    def style_code(self, poses: Tensor) -> Tensor:
        """Poses ``[B, T, 148]`` to ``[B, hidden]``, from positions."""
        code: Tensor = self.generator.style_encoder(self.style_scale(style_input(poses)).transpose(1, 2))
        return code

    def video_code(self, projected: Tensor) -> Tensor:
        """Projected motion ``[B, T, 42]`` to ``[B, hidden]``."""
        if self.generator.video_encoder is None:
            raise RuntimeError("the encoder of projected motion was not built")
        code: Tensor = self.generator.video_encoder(self.video_scale(projected).transpose(1, 2))
        return code

    def decode(self, content_code: Tensor, style_code: Tensor) -> Tensor:
        """Raw rotations ``[B, T, 21, 4]``, not of unit length."""
        raw = self.generator.decode(content_code, style_code).transpose(1, 2)
        if self.output_scale is not None:
            raw = self.output_scale.inverse(raw)
        return raw.reshape(*raw.shape[:2], N_JOINTS, 4)


def encode(clip: Clip) -> FloatArray:
    """Poses ``[T, 148]`` at 30 fps in the paper's unit.

    The heading is taken out of rotations and positions frame by frame; the root's place and heading, about those of
    the first frame, are kept beside them.
    """
    yaw = heading(clip)
    wxyz, _ = yaw_aligned(clip.rotations_wxyz, clip.root_xyz_m, yaw)
    wxyz = quat.continuous(np.concatenate([quat.same_hemisphere(wxyz[:1], quat.IDENTITY), wxyz[1:]]))
    local, _ = forward_kinematics(wxyz, np.zeros_like(clip.root_xyz_m), clip.skeleton)
    path = clip.root_xyz_m - clip.root_xyz_m[0] * np.array([1.0, 0.0, 1.0])
    path = quat.rotate(quat.about_y(-yaw[0]), path)
    n = clip.n_frames
    lengths = np.concatenate([local[:, 1:].reshape(n, -1), path], axis=1) / UNIT_M
    return np.concatenate([wxyz.reshape(n, -1), lengths, (yaw - yaw[0])[:, None]], axis=1)


def heading(clip: Clip) -> FloatArray:
    """Facing direction, unwrapped and smoothed, ``[T]`` radians."""
    return smooth_yaw(facing_yaw(world_positions(clip)), SMOOTHING_FRAMES)


def style_input(poses: Tensor) -> Tensor:
    """Positions, root and heading ``[B, T, 64]``: what the style encoder and the discriminator read."""
    return torch.cat([poses[..., POSITIONS], poses[..., ROOT]], dim=-1)


def project(poses: Tensor, view_rad: Tensor, scale: Tensor) -> Tensor:
    """Motion as a camera far away sees it, ``[B, T, 148] -> [B, T, 42]``: x and y of joints 1 to 20 and of the root.

    Parameters
    ----------
    view_rad, scale : ``[B]``, the camera's angle from the side of the mean heading, and the zoom.
    """
    headings = poses[..., -1]
    turn = rotations.about_y(headings - headings.mean(dim=1, keepdim=True) - view_rad[:, None])
    joints = poses[..., POSITIONS].reshape(*poses.shape[:2], N_JOINTS - 1, 3)
    path = rotations.rotate(
        rotations.about_y(-headings.mean(dim=1, keepdim=True) - view_rad[:, None]), poses[..., ROOT][..., :3]
    )
    placed = torch.cat([rotations.rotate(turn[:, :, None], joints), path[:, :, None]], dim=2)
    return (placed[..., :2] * scale[:, None, None, None]).flatten(2)


class AbermanTraining(Trainable):
    """One step: the discriminator, then the generator, on the same motion."""

    def __init__(
        self, config: AbermanConfig, windows: Windows, generator: torch.Generator, device: str = "cpu"
    ) -> None:
        self.config, self.generator, self.device = config, generator, device
        self.styles = windows.styles
        self.n_styles = len(windows.style_labels)
        self.network = AbermanNetwork(config)
        size = config.size
        self.discriminator = Discriminator(size.style, self.n_styles, (size.style_hidden, size.hidden))
        poses = windows.features
        self.network.content_scale.fit(torch.cat([poses[..., ROTATIONS], poses[..., ROOT]], dim=2), floor=1e-3)
        self.network.style_scale.fit(style_input(poses), floor=1e-3)
        if self.network.output_scale is not None:
            self.network.output_scale.fit(poses[..., ROTATIONS], floor=1e-2)
        if config.video:
            self.network.video_scale.fit(self._projected(poses), floor=1e-3)
        self.poses, self.offsets = poses.to(device), (windows.offsets_m / UNIT_M).to(device)
        self.draws = Draws(windows)
        self.network.to(device)
        self.discriminator.to(device)
        self.generator_optimiser = self._optimiser(self.network)
        self.discriminator_optimiser = self._optimiser(self.discriminator)

    def _optimiser(self, network: nn.Module) -> torch.optim.Optimizer:
        config = self.config
        return torch.optim.RMSprop(network.parameters(), lr=config.rate, weight_decay=config.weight_decay, eps=1e-4)

    def parts(self) -> Mapping[str, Stateful]:
        return {
            "network": self.network,
            "discriminator": self.discriminator,
            "generator_optimiser": self.generator_optimiser,
            "discriminator_optimiser": self.discriminator_optimiser,
        }

    def step(self, index: int) -> Losses:
        config = self.config
        a, b = (self.draws.rows(config.batch, self.generator) for _ in range(2))
        own, other = self.styles[a], self.styles[b]
        same = self.draws.with_styles(own, self.generator)
        different = (own + torch.randint(1, self.n_styles, own.shape, generator=self.generator)) % self.n_styles
        unlike = self.draws.with_styles(different, self.generator)
        labels = torch.cat([other, own, own]).to(self.device)

        from_video = config.video and index % 2 == 1
        code_a, code_b, code_same, code_unlike = self._codes([a, b, same, unlike], from_video=from_video)
        content = self.network.content_code(self.poses[a])
        raw = self.network.decode(content.repeat(3, 1, 1), torch.cat([code_b, code_a, code_same]))
        unit = rotations.normalise(raw)
        made = self._positions(unit, a.repeat(3))
        shown = with_differences(torch.cat([made, self.poses[a][..., ROOT].repeat(3, 1, 1)], dim=2).transpose(1, 2))
        truth = with_differences(style_input(self.poses[torch.cat([b, a])]).transpose(1, 2))

        losses = self._discriminate(truth[: config.batch], shown.detach()[: 2 * config.batch], labels)

        self.discriminator.requires_grad_(False)
        scores, features = self.discriminator(shown, labels)
        _, wanted = self.discriminator(truth, labels[: 2 * config.batch])
        self.discriminator.requires_grad_(True)
        wanted_b, wanted_a = wanted.chunk(2)
        losses |= {
            "adversarial": self._shared([-part.mean() for part in scores.chunk(3)]),
            "reconstruction": self._rebuilt(made, self.poses[a][..., POSITIONS]),
            "rotation": self._rebuilt(raw.flatten(2), self.poses[a][..., ROTATIONS]),
            "feature": self._shared(
                [
                    feature_distance(*pair)
                    for pair in zip(features.chunk(3), (wanted_b, wanted_a, wanted_a), strict=True)
                ]
            ),
            "quaternion": self._shared([quaternion_norm(part) for part in raw.chunk(3)]),
            "twist": self._shared([twist(part, math.radians(config.twist_limit_deg)) for part in unit.chunk(3)]),
            "triplet": functional.triplet_margin_loss(code_a, code_same, code_unlike, margin=config.triplet_margin),
        }
        if config.video:
            [across] = self._codes([a], from_video=not from_video)
            losses["joint"] = functional.mse_loss(across, code_a)
        weights = {name: float(getattr(config, name)) for name in losses if name not in ("discriminator", "penalty")}
        total = sum((weight * losses[name] for name, weight in weights.items()), torch.zeros((), device=self.device))
        self.generator_optimiser.zero_grad(set_to_none=True)
        total.backward()  # type: ignore[no-untyped-call]
        self.generator_optimiser.step()
        return losses

    def _discriminate(self, real: Tensor, fake: Tensor, labels: Tensor) -> dict[str, Tensor]:
        """Hinge loss on real motion of the target style and on transferred and rebuilt motion; penalty on the real."""
        config = self.config
        real = real.detach().requires_grad_()
        real_scores, _ = self.discriminator(real, labels[: config.batch])
        fake_scores, _ = self.discriminator(fake, labels[: 2 * config.batch])
        adversarial = hinge_discriminator(real_scores, fake_scores)
        penalty = gradient_penalty(real_scores.mean(dim=1), real)
        if config.penalty_of_mean:
            penalty = penalty / config.batch**2
        self.discriminator_optimiser.zero_grad(set_to_none=True)
        (adversarial + config.penalty * penalty).backward()  # type: ignore[no-untyped-call]
        self.discriminator_optimiser.step()
        return {"discriminator": adversarial, "penalty": penalty}

    def _codes(self, rows: Sequence[Tensor], *, from_video: bool) -> tuple[Tensor, ...]:
        poses = self.poses[torch.cat(list(rows))]
        if from_video:
            return self.network.video_code(self._projected(poses)).chunk(len(rows))
        return self.network.style_code(poses).chunk(len(rows))

    def _projected(self, poses: Tensor) -> Tensor:
        """Through cameras within 90 degrees and 20 % of zoom."""
        draws = torch.rand(2, len(poses), generator=self.generator).to(poses.device)
        return project(poses, (draws[0] - 0.5) * math.pi, 0.8 + 0.4 * draws[1])

    def _positions(self, unit: Tensor, rows: Tensor) -> Tensor:
        """Positions of joints 1 to 20 on the bones of some windows, ``[B, T, 60]``."""
        placed = rotations.forward_kinematics(unit, torch.zeros_like(unit[..., 0, :3]), self.offsets[rows, None])
        return placed[..., 1:, :].flatten(2)

    def _shared(self, parts: Sequence[Tensor]) -> Tensor:
        """Of transferred, rebuilt and rebuilt from another motion of the style."""
        transferred, rebuilt, rebuilt_from_same = parts
        share = self.config.transfer_share
        return share * transferred + (1.0 - share) * (rebuilt + rebuilt_from_same) / 2.0

    def _rebuilt(self, made: Tensor, wanted: Tensor) -> Tensor:
        _, rebuilt, from_same = made.chunk(3)
        return ((rebuilt - wanted).abs().mean() + (from_same - wanted).abs().mean()) / 2.0


def train_aberman(config: AbermanConfig, request: FitRequest) -> tuple[AbermanConfig, AbermanNetwork, Curves]:
    """Train on takes with style labels."""
    windows = cut_windows(request.takes, encode, n_frames=config.n_frames, stride=config.stride)
    with seeded(request.seed, request.device) as generator:
        training = AbermanTraining(config, windows, generator, request.device)
        curves = train(training, config.n_steps, progress=request.progress, checkpoints=request.checkpoints)
    return config, training.network, curves


@torch.inference_mode()
def transfer(network: AbermanNetwork, content: Clip, styles: Sequence[tuple[Clip, float]]) -> Clip:
    """The content's motion in a mixture of styles (a weighted mean of style codes); its root path stays."""
    code = sum((weight * _style_of(network, clip) for clip, weight in styles), torch.zeros(()))
    return at_training_rate(content, lambda clip: _decoded(network, clip, code))


def _style_of(network: AbermanNetwork, clip: Clip) -> Tensor:
    return network.style_code(to_tensor(encode(hold(resample(clip, FPS), LEAST_FRAMES))))


def _decoded(network: AbermanNetwork, clip: Clip, code: Tensor) -> Clip:
    held = hold(clip, padded_frames(clip.n_frames, 2, LEAST_FRAMES))
    raw = network.decode(network.content_code(to_tensor(encode(held))), code)[0, : clip.n_frames]
    wxyz = quat.normalise(raw.double().numpy())
    turned, _ = yaw_aligned(wxyz, clip.root_xyz_m, -heading(held)[: clip.n_frames])
    return clip.with_motion(turned, clip.root_xyz_m)
