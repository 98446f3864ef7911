"""Conv1D+AdaIN, the baseline of Jang et al. 2022 (Motion Puzzle, section 7 and Table 2).

The paper says that it has the one-dimensional convolutions and the AdaIN of Aberman et al. 2020 and the losses of
Motion Puzzle: no labels, no discriminator, no parts of the body. Sizes, features and schedule are not stated and there
is no code; those declared here are Aberman's released channels on Motion Puzzle's features, trained as Motion Puzzle
is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from bench.methods.aberman2020.network import LEAST_FRAMES, Generator, NetworkSize
from bench.methods.layers import Average
from bench.methods.motion_puzzle.features import N_CHANNELS, N_JOINT_CHANNELS, clip_from_puzzle, puzzle_features
from bench.methods.motion_puzzle.losses import smoothness
from bench.methods.motion_puzzle.motion_puzzle import random_crop
from bench.methods.training import Curves, FitRequest, Losses, Stateful, Trainable, seeded, train
from bench.methods.windows import (
    FPS,
    Draws,
    Standardise,
    at_training_rate,
    cut_windows,
    hold,
    padded_frames,
    to_tensor,
)
from bench.motion.clip import Clip
from bench.motion.edit import resample
from bench.motion.skeleton import N_JOINTS

N_ROOT = N_CHANNELS - N_JOINT_CHANNELS
N_POSE = N_JOINTS * N_JOINT_CHANNELS + N_ROOT
"""255 numbers a frame: 12 of each joint, and the root's ground and turning velocities once."""
GRADIENT_CLIP = 1.0


@dataclass(frozen=True)
class ConvAdainConfig:
    """Everything that decides a training.

    Attributes
    ----------
    width : factor on all inner channels of Aberman's generator.
    n_frames, stride : of the training windows; takes are also used with left and right exchanged.
    n_steps, batch, rate : of RAdam; Motion Puzzle's 10 epochs.
    average : decay of the moving average of the weights that is used at test.
    cropping : share of windows that are sped up or slowed down.
    reconstruction, cycle, root, smooth : weights of losses, all 1 in equation 20.
    """

    width: float = 1.0
    n_frames: int = 64
    stride: int = 32
    n_steps: int = 37_500
    batch: int = 32
    rate: float = 1e-4
    average: float = 0.999
    cropping: float = 0.2
    reconstruction: float = 1.0
    cycle: float = 1.0
    root: float = 1.0
    smooth: float = 1.0

    @property
    def size(self) -> NetworkSize:
        return NetworkSize(N_POSE, N_POSE, 0, N_POSE, linear=True).narrowed(self.width)


CONFIGS = {
    "smoke": ConvAdainConfig(width=0.1, n_steps=3, batch=4, rate=1e-3, average=0.5),
    "small": ConvAdainConfig(width=0.5, n_steps=2600, batch=16, rate=1e-3, average=0.995),
    "paper": ConvAdainConfig(),
}


class ConvAdainNetwork(nn.Module):
    """The generator between a normalisation and its inverse."""

    def __init__(self, config: ConvAdainConfig) -> None:
        super().__init__()
        self.standardise = Standardise(N_POSE)
        self.generator = Generator(config.size)

    def motion(self, features: Tensor) -> Tensor:
        """Features ``[B, T, 21, 15]`` of Motion Puzzle to normalised channels ``[B, 255, T]``."""
        standard: Tensor = self.standardise(flat(features))
        return standard.transpose(1, 2)

    def features(self, motion: Tensor) -> Tensor:
        """Inverse of :meth:`motion`."""
        plain = self.standardise.inverse(motion.transpose(1, 2))
        joints = plain[..., :-N_ROOT].reshape(*plain.shape[:2], N_JOINTS, N_JOINT_CHANNELS)
        root = plain[:, :, None, -N_ROOT:].expand(-1, -1, N_JOINTS, -1)
        return torch.cat([joints, root], dim=-1)

    @torch.no_grad()
    def fit_standardise(self, features: Tensor) -> None:
        """A mean for each number; one deviation for the numbers of a kind (positions, axes, velocities, root, turn)."""
        self.standardise.fit(flat(features))
        kinds = torch.tensor([*[channel // 3 for channel in range(N_JOINT_CHANNELS)] * N_JOINTS, 4, 4, 5])
        for kind in range(6):
            deviation = self.standardise.deviation[kinds == kind]
            self.standardise.deviation[kinds == kind] = deviation.square().mean().sqrt()


def flat(features: Tensor) -> Tensor:
    """``[B, T, 21, 15]`` to ``[B, T, 255]``: the root's three numbers, which every joint repeats, are kept once."""
    joints, root = features[..., :N_JOINT_CHANNELS], features[..., 0, N_JOINT_CHANNELS:]
    return torch.cat([joints.flatten(2), root], dim=-1)


def losses_of(generator: Generator, source: Tensor, target: Tensor) -> dict[str, Tensor]:
    """Equations 15 to 18 of Motion Puzzle for normalised motions ``[B, 255, T]`` of source and target style."""
    content, other_content = generator.content_encoder(source), generator.content_encoder(target)
    style, other_style = generator.style_encoder(source), generator.style_encoder(target)
    rebuilt, other_rebuilt = generator.decode(content, style), generator.decode(other_content, other_style)
    transferred = generator.decode(content, other_style)
    cycle = generator.decode(generator.content_encoder(transferred), style)
    other_cycle = generator.decode(other_content, generator.style_encoder(transferred))
    pairs = ((rebuilt, source), (other_rebuilt, target), (cycle, source), (other_cycle, target))
    return {
        "reconstruction": functional.l1_loss(rebuilt, source) + functional.l1_loss(other_rebuilt, target),
        "cycle": functional.l1_loss(cycle, source) + functional.l1_loss(other_cycle, target),
        "root": functional.l1_loss(transferred[:, -N_ROOT:], source[:, -N_ROOT:]),
        "smooth": torch.stack([smoothness(*pair) for pair in pairs]).sum(),
    }


class ConvAdainTraining(Trainable):
    """Random pairs of source and target windows."""

    def __init__(
        self, config: ConvAdainConfig, network: ConvAdainNetwork, motions: Tensor, draws: Draws,
        generator: torch.Generator,
    ) -> None:  # fmt: skip
        self.config, self.network, self.motions, self.draws = config, network, motions, draws
        self.generator = generator
        self.optimiser = torch.optim.RAdam(network.parameters(), lr=config.rate, betas=(0.0, 0.99))
        self.average = Average(network, config.average)

    def parts(self) -> Mapping[str, Stateful]:
        return {"network": self.network, "optimiser": self.optimiser, "average": self.average}

    def step(self, index: int) -> Losses:
        losses = losses_of(self.network.generator, self._batch(), self._batch())
        total = torch.stack([getattr(self.config, name) * loss for name, loss in losses.items()]).sum()
        self.optimiser.zero_grad(set_to_none=True)
        total.backward()  # type: ignore[no-untyped-call]
        nn.utils.clip_grad_norm_(self.network.parameters(), GRADIENT_CLIP)
        self.optimiser.step()
        self.average.update(self.network)
        return losses

    def _batch(self) -> Tensor:
        """Windows ``[B, 255, T]``, some of them sped up or slowed down."""
        motions = self.motions[self.draws.rows(self.config.batch, self.generator)]
        cropped = torch.rand(len(motions), generator=self.generator) < self.config.cropping
        for row in torch.nonzero(cropped)[:, 0].tolist():
            motions[row] = random_crop(motions[row], self.generator)
        return self.network.motion(motions)


def train_conv_adain(config: ConvAdainConfig, request: FitRequest) -> tuple[ConvAdainConfig, ConvAdainNetwork, Curves]:
    """Train on takes whose labels are not looked at; the averaged weights are the result."""
    windows = cut_windows(
        request.takes,
        lambda clip: puzzle_features(clip)[0],
        n_frames=config.n_frames,
        stride=config.stride,
        mirrored=True,
    )
    with seeded(request.seed, request.device) as generator:
        network = ConvAdainNetwork(config)
        network.fit_standardise(windows.features)
        network.to(request.device)
        motions = windows.features.to(request.device)
        training = ConvAdainTraining(config, network, motions, Draws(windows), generator)
        curves = train(training, config.n_steps, progress=request.progress, checkpoints=request.checkpoints)
    return config, training.average.network, curves


@torch.inference_mode()
def transfer(network: ConvAdainNetwork, content: Clip, styles: Sequence[tuple[Clip, float]]) -> Clip:
    """The content's motion in a mixture of styles (a weighted mean of style codes)."""
    code = sum((weight * style_code(network, clip) for clip, weight in styles), torch.zeros(()))
    return at_training_rate(content, lambda clip: _decoded(network, clip, code))


def style_code(network: ConvAdainNetwork, clip: Clip) -> Tensor:
    """``[1, hidden]`` of a whole motion."""
    code: Tensor = network.generator.style_encoder(_motion(network, hold(resample(clip, FPS), LEAST_FRAMES)))
    return code


def _decoded(network: ConvAdainNetwork, clip: Clip, code: Tensor) -> Clip:
    held = hold(clip, padded_frames(clip.n_frames, 2, LEAST_FRAMES))
    decoded = network.generator.decode(network.generator.content_encoder(_motion(network, held)), code)
    features = network.features(decoded)[0, : clip.n_frames]
    return clip_from_puzzle(features.numpy().astype(np.float64), clip)


def _motion(network: ConvAdainNetwork, clip: Clip) -> Tensor:
    return network.motion(to_tensor(puzzle_features(clip)[0]))
