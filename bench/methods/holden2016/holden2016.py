"""Holden, Saito and Komura 2016, "A Deep Learning Framework for Character Motion Synthesis and Editing".

Style transfer: an autoencoder is trained once, without labels; a transfer then looks for hidden units
whose values are those of the content and whose Gram matrix is that of the style (after Gatys et al. 2015), and for
hidden units near them that obey the constraints. Every transfer is an optimisation of its own.

Differences from the paper and the released code: docs/methods/holden2016.md.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from bench.arrays import FloatArray
from bench.methods.holden2016.constraints import constraints, path_velocities
from bench.methods.holden2016.network import MotionAutoencoder, reconstruction_loss, sparsity_loss
from bench.methods.layers import gram, held_to
from bench.methods.training import Curves, FitRequest, Losses, Stateful, Trainable, seeded, train
from bench.methods.windows import FPS, Windows, at_training_rate, cut_windows, to_tensor
from bench.motion.clip import Clip
from bench.motion.edit import resample
from bench.motion.holden_features import (
    HOLDEN_SLICES,
    UNITS_PER_STATURE,
    HoldenStart,
    clip_from_holden,
    holden_features,
)

ADAM_BETAS = (0.9, 0.999)
ADAM_EPSILON = 1e-5


@dataclass(frozen=True)
class Holden2016Config:
    """Network, training and transfer. The defaults are the paper's."""

    width: int = 256
    """hidden units"""
    kernel: int = 25
    """frames of a filter"""
    dropout: float = 0.25
    """share of inputs and of hidden units zeroed in training"""
    sparsity: float = 0.01
    """weight of the mean absolute filter weight"""
    window_frames: int = 120
    """length of a training window: the paper's 4 s at 30 fps"""
    window_stride: int = 60
    """from window to window"""
    batch_size: int = 1
    """windows a step"""
    learning_rate: float = 1e-5
    """of Adam, in training"""
    n_steps: int = 200_000
    """training steps"""
    style_weight: float = 0.1
    """s of the transfer, before both weights are divided by their sum"""
    content_weight: float = 1.0
    """c of the transfer"""
    transfer_steps: int = 250
    """steps towards content and style"""
    constraint_steps: int = 100
    """steps towards the constraints"""
    transfer_rate: float = 0.01
    """of Adam, on hidden units"""


CONFIGS: Mapping[str, Holden2016Config] = {
    "smoke": Holden2016Config(
        width=8, window_frames=64, window_stride=64, batch_size=4, learning_rate=1e-3, n_steps=20,
        transfer_steps=25, constraint_steps=5,
    ),
    "small": Holden2016Config(
        width=64, window_frames=64, window_stride=32, batch_size=16, learning_rate=1e-3, n_steps=2500,
    ),
    "paper": Holden2016Config(),
}  # fmt: skip


def build(config: Holden2016Config) -> MotionAutoencoder:
    """The network with initial weights."""
    return MotionAutoencoder(config.width, config.kernel, config.dropout)


class AutoencoderTraining(Trainable):
    """One step denoises one batch of windows."""

    def __init__(
        self, network: MotionAutoencoder, windows: Windows, config: Holden2016Config, generator: torch.Generator
    ) -> None:
        self.network, self.config, self.generator = network, config, generator
        self.motions = network.standardise(windows.features).transpose(1, 2).contiguous()  # [n, 73, T]
        self.optimiser = torch.optim.Adam(network.parameters(), lr=config.learning_rate)

    def parts(self) -> Mapping[str, Stateful]:
        return {"network": self.network, "optimiser": self.optimiser}

    def step(self, index: int) -> Losses:
        rows = torch.randint(len(self.motions), (self.config.batch_size,), generator=self.generator)
        motion = self.motions[rows]
        losses = {
            "reconstruction": reconstruction_loss(self.network(motion, self.generator), motion),
            "sparsity": self.config.sparsity * sparsity_loss(self.network),
        }
        self.optimiser.zero_grad(set_to_none=True)
        torch.stack(list(losses.values())).sum().backward()  # type: ignore[no-untyped-call]
        self.optimiser.step()
        return losses


def train_holden(config: Holden2016Config, request: FitRequest) -> tuple[Holden2016Config, MotionAutoencoder, Curves]:
    """Train the autoencoder on all windows of the takes; their labels are not looked at."""
    with seeded(request.seed, request.device) as generator:
        windows = cut_windows(
            request.takes,
            lambda clip: holden_features(clip)[0],
            n_frames=config.window_frames,
            stride=config.window_stride,
        )
        network = build(config)
        network.fit_standardise(windows.features)
        network.to(request.device).train()
        training = AutoencoderTraining(network, windows.to(request.device), config, generator)
        curves = train(
            training, config.n_steps, progress=request.progress, name="holden2016", checkpoints=request.checkpoints
        )
    return config, network.eval(), curves


@torch.no_grad()
def transfer(
    network: MotionAutoencoder, config: Holden2016Config, content: Clip, style: Clip, rng: np.random.Generator
) -> Clip:
    """The content in the style, on the content's bones and clock; the network sees both at its training's rate."""
    style_hidden = network.encode(_standardised(network, holden_features(resample(style, FPS))[0]))
    return at_training_rate(content, lambda clip: _transferred(network, config, clip, style_hidden, rng))


def _transferred(
    network: MotionAutoencoder,
    config: Holden2016Config,
    content: Clip,
    style_hidden: Tensor,
    rng: np.random.Generator,
) -> Clip:
    """Content and Gram matrix, then the path's speed, then the constraints; ``style_hidden`` ``[1, width, T' / 2]``."""
    features, start = holden_features(content)
    motion = _standardised(network, features)
    hidden = network.encode(motion)  # [1, width, T / 2]
    style_gram = gram(style_hidden) * (hidden.shape[2] / style_hidden.shape[2])
    bound = (6.0 / (motion.shape[1] + motion.shape[2])) ** 0.5
    noise = torch.from_numpy(rng.uniform(-bound, bound, motion.shape).astype(np.float32))
    styled = match_style(network.encode(noise), hidden, style_gram, config)
    content_motion = network.standardise.inverse(motion.transpose(1, 2))[0].T  # [73, T]
    path = scaled_path(_decoded(network, styled), content_motion)
    projected = network.encode(network.decode(styled))
    bound_motion = obey_constraints(network, projected, content_motion, path, content, config)
    bound_motion[HOLDEN_SLICES["velocity_xz"].start : HOLDEN_SLICES["yaw_velocity"].stop] = path
    return _to_clip(bound_motion[:, : content.n_frames], start, content)


def match_style(start: Tensor, content: Tensor, style_gram: Tensor, config: Holden2016Config) -> Tensor:
    """Hidden units ``[1, width, T / 2]`` that minimise :func:`style_loss`, by Adam from ``start``."""
    total = config.style_weight + config.content_weight
    s, c = config.style_weight / total, config.content_weight / total
    return descend(
        start,
        lambda hidden: style_gradient(hidden, content, style_gram, s, c),
        config.transfer_steps,
        config.transfer_rate,
    )


def style_loss(hidden: Tensor, content: Tensor, style_gram: Tensor, s: float, c: float) -> Tensor:
    """``s mean((Gram(H) - Gram(S))^2) + c mean((H - Phi(C))^2)``."""
    return s * (gram(hidden) - style_gram).square().mean() + c * (hidden - content).square().mean()


def style_gradient(hidden: Tensor, content: Tensor, style_gram: Tensor, s: float, c: float) -> Tensor:
    """The gradient of :func:`style_loss` by ``hidden``, written out because it is asked for hundreds of times."""
    towards_style = (gram(hidden) - style_gram) @ hidden
    return (4.0 * s / style_gram.numel()) * towards_style + (2.0 * c / hidden.numel()) * (hidden - content)


def scaled_path(motion: Tensor, content: Tensor) -> Tensor:
    """Path velocities ``[3, T]``: the content's, its ground speed scaled to the mean ground speed of ``motion``."""
    wanted = path_velocities(content).clone()
    speed, content_speed = (path_velocities(each)[:2].norm(dim=0).mean() for each in (motion, content))
    wanted[:2] *= speed / content_speed.clamp_min(1e-6)
    return wanted


def obey_constraints(
    network: MotionAutoencoder, start: Tensor, content: Tensor, path: Tensor, like: Clip, config: Holden2016Config
) -> Tensor:
    """A motion ``[73, T]`` near that of the hidden units ``start`` that obeys the constraints, by Adam."""
    lengths = torch.tensor(like.skeleton.bone_lengths_m[1:] * UNITS_PER_STATURE / like.skeleton.stature_m).float()
    contacts = (content[HOLDEN_SLICES["contacts"]] > 0.5).float()

    def gradient(hidden: Tensor) -> Tensor:
        with torch.enable_grad():
            hidden = hidden.detach().requires_grad_()
            cost = constraints(_decoded(network, hidden), contacts, lengths, like.skeleton.parents, path)
            return torch.autograd.grad(cost, hidden)[0]

    return _decoded(network, descend(start, gradient, config.constraint_steps, config.transfer_rate))


def descend(start: Tensor, gradient: Callable[[Tensor], Tensor], n_steps: int, rate: float) -> Tensor:
    """Adam (Kingma and Ba 2015) from ``start`` along ``gradient``."""
    x, mean, square = start.clone(), torch.zeros_like(start), torch.zeros_like(start)
    for step in range(1, n_steps + 1):
        slope = gradient(x)
        mean.lerp_(slope, 1.0 - ADAM_BETAS[0])
        square.mul_(ADAM_BETAS[1]).addcmul_(slope, slope, value=1.0 - ADAM_BETAS[1])
        scale = (square / (1.0 - ADAM_BETAS[1] ** step)).sqrt_().add_(ADAM_EPSILON)
        x.addcdiv_(mean, scale, value=-rate / (1.0 - ADAM_BETAS[0] ** step))
    return x


def _standardised(network: MotionAutoencoder, features: FloatArray) -> Tensor:
    """``[T, 73] -> [1, 73, T]``, the last frame held once more where T is odd."""
    motion: Tensor = network.standardise(to_tensor(features)).transpose(1, 2)
    return held_to(motion, motion.shape[2] + motion.shape[2] % 2)


def _decoded(network: MotionAutoencoder, hidden: Tensor) -> Tensor:
    """``[1, width, T / 2] -> [73, T]`` in units."""
    motion: Tensor = network.standardise.inverse(network.decode(hidden)[0].T).T
    return motion


def _to_clip(motion: Tensor, start: HoldenStart, like: Clip) -> Clip:
    return clip_from_holden(motion.T.double().numpy(), start, like)
