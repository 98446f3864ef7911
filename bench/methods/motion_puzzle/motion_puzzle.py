"""Motion Puzzle's training and transfer (Jang et al. 2022, sections 3.1 and 5, appendix A.2)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor, nn

from bench.methods.layers import Average
from bench.methods.motion_puzzle.features import N_CHANNELS, N_JOINT_CHANNELS, clip_from_puzzle, puzzle_features
from bench.methods.motion_puzzle.graphs import PART_NAMES
from bench.methods.motion_puzzle.losses import drawn_parts, losses_of, weights_of
from bench.methods.motion_puzzle.network import PartStyles, PuzzleNetwork, Shape, StyleFeatures, he_start
from bench.methods.training import Curves, FitRequest, Stateful, Trainable, seeded, train
from bench.methods.windows import FPS, Draws, Standardise, at_training_rate, cut_windows, padded_frames
from bench.motion.clip import Clip
from bench.motion.edit import resample
from bench.motion.skeleton import N_JOINTS

LEAST_FRAMES, MULTIPLE = 12, 4

Styles = Sequence[tuple[Clip, float]]
"""Target motions of one part with weights that sum to 1."""


@dataclass(frozen=True)
class PuzzleConfig:
    """What is built and trained; the defaults are the paper's.

    Attributes
    ----------
    channels, style_channels : width of the network, see :class:`Shape`.
    attention, by_part, real_time : the ablations of figure 17 and the variant of section 7.3.
    faithful_to_code : what the released code does differently: 12 channels, shared pooling, no root loss, ...
    he_start : convolutions start with He's deviations; False for PyTorch's start, about a third of them.
    by_joint : normalised with a mean of each joint, so that what tells joints apart in every motion is not learned.
    n_frames, stride : of training windows; 2 s at our 30 fps for the paper's 120 and 60 frames at 60 fps.
    steps, batch : optimiser steps and windows a step; 10 epochs of 120,000 windows in the paper.
    rate, betas : of RAdam.
    average : decay of the moving average of the weights that is used at test.
    mixing : probability of mixing styles by part; not stated in the paper, 0.4 in the released code.
    cropping : share of windows that are sped up or slowed down (temporal random cropping).
    """

    channels: int = 64
    style_channels: int = 128
    attention: bool = True
    by_part: bool = True
    real_time: bool = False
    faithful_to_code: bool = False
    he_start: bool = True
    by_joint: bool = False
    n_frames: int = 64
    stride: int = 32
    steps: int = 37_500
    batch: int = 32
    rate: float = 1e-4
    betas: tuple[float, float] = (0.0, 0.99)
    average: float = 0.999
    mixing: float = 0.4
    cropping: float = 0.2

    def at(self, budget: str) -> PuzzleConfig:
        """The same variant with less training and a narrower network."""
        if budget == "smoke":
            return replace(self, channels=4, style_channels=8, steps=4, batch=4, rate=1e-3, average=0.5)
        if budget == "small":
            return replace(
                self, channels=16, style_channels=32, he_start=False, by_joint=True, n_frames=32, stride=16,
                steps=1500, batch=4, rate=4e-3, betas=(0.9, 0.99), average=0.99,
            )  # fmt: skip
        return self

    @property
    def shape(self) -> Shape:
        return Shape(
            in_channels=N_JOINT_CHANNELS if self.faithful_to_code else N_CHANNELS,
            channels=self.channels,
            style_channels=self.style_channels,
            attention=self.attention,
            by_part=self.by_part,
            real_time=self.real_time,
            faithful_to_code=self.faithful_to_code,
        )


class MotionPuzzle(nn.Module):
    """The network between a normalisation and its inverse."""

    def __init__(self, config: PuzzleConfig) -> None:
        super().__init__()
        self.config = config
        self.standardise = Standardise(*((N_JOINTS,) if config.by_joint else ()), config.shape.in_channels)
        self.network = PuzzleNetwork(config.shape)
        if config.he_start:
            self.network.apply(he_start)

    @torch.inference_mode()
    def transfer(self, content: Clip, styles: Mapping[str, Styles]) -> Clip:
        """The content with a mixture of styles in each named part; other parts keep the content's own style.

        The ablation without parts gives the style of the first named part to the whole body.
        """
        encoded: dict[int, StyleFeatures] = {}

        def features(clip: Clip) -> StyleFeatures:
            if id(clip) not in encoded:
                encoded[id(clip)] = self.network.style(self._motion(clip))
            return encoded[id(clip)]

        own: Styles = [(content, 1.0)] if self.config.by_part else next(iter(styles.values()))
        part_styles: PartStyles = [
            [(features(clip), weight) for clip, weight in styles.get(part, own)] for part in PART_NAMES
        ]

        def answer(clip: Clip) -> Clip:
            decoded = self.network.decode(self.network.content(self._motion(clip)), part_styles)
            features = self.standardise.inverse(decoded[0].permute(1, 2, 0))[: clip.n_frames]
            return clip_from_puzzle(features.numpy().astype(np.float64), clip)

        return at_training_rate(content, answer)

    def _motion(self, clip: Clip) -> Tensor:
        """``[1, C, T, 21]``, normalised; mirrored in time at the end up to a length that the graphs can halve twice."""
        features, _ = puzzle_features(resample(clip, FPS))
        wanted = padded_frames(len(features), MULTIPLE, LEAST_FRAMES)
        while len(features) < wanted:
            features = np.concatenate([features, features[::-1]])[:wanted]
        used = torch.from_numpy(features[..., : self.config.shape.in_channels].astype(np.float32))
        standard: Tensor = self.standardise(used)
        return standard.permute(2, 0, 1)[None].contiguous()


def train_puzzle(config: PuzzleConfig, request: FitRequest) -> tuple[PuzzleConfig, MotionPuzzle, Curves]:
    """Train on takes whose labels are not looked at.

    Raises
    ------
    BadData : no takes, or takes without labels (all methods get the same fit part).
    """
    windows = cut_windows(
        request.takes,
        lambda clip: puzzle_features(clip)[0],
        n_frames=config.n_frames,
        stride=config.stride,
        mirrored=True,
    )
    motions = windows.features[..., : config.shape.in_channels].to(request.device)
    with seeded(request.seed, request.device) as generator:
        model = MotionPuzzle(config).to(request.device)
        _fit_scale(model.standardise, motions)
        training = _PuzzleTraining(model, motions, Draws(windows), generator)
        curves = train(training, config.steps, progress=request.progress, checkpoints=request.checkpoints)
        model.network.load_state_dict(training.average.state_dict())
    return config, model, curves


def _fit_scale(standardise: Standardise, motions: Tensor) -> None:
    """Mean of each channel; one deviation from it for each triple of coordinates, for the root's velocity and turn."""
    standardise.fit(motions)
    deviation = (motions - standardise.mean).flatten(0, 2).std(dim=0, correction=0)
    groups = [slice(start, start + 3) for start in range(0, 12, 3)] + [slice(12, 14)]
    for group in groups[: len(groups) if motions.shape[-1] == N_CHANNELS else 4]:
        deviation[group] = deviation[group].mean()
    standardise.deviation.copy_(deviation.expand_as(standardise.deviation))


class _PuzzleTraining(Trainable):
    """Random pairs of source and target windows."""

    def __init__(self, model: MotionPuzzle, motions: Tensor, draws: Draws, generator: torch.Generator) -> None:
        self.config = model.config
        self.standardise = model.standardise
        self.network = model.network
        self.motions = motions
        self.draws = draws
        self.generator = generator
        decay = 1e-4 if self.config.faithful_to_code else 0.0
        self.optimiser = torch.optim.RAdam(
            self.network.parameters(), lr=self.config.rate, betas=self.config.betas, weight_decay=decay
        )
        self.average = Average(self.network, self.config.average)

    def step(self, index: int) -> Mapping[str, Tensor]:
        faithful = self.config.faithful_to_code
        source, target = self._batch(), self._batch()
        parts = drawn_parts(self.config.mixing, self.generator, faithful_to_code=faithful)
        losses = losses_of(self.network, source, target, parts, faithful_to_code=faithful)
        weights = weights_of(faithful_to_code=faithful)
        total = torch.stack([weights[name] * loss for name, loss in losses.items()]).sum()
        self.optimiser.zero_grad(set_to_none=True)
        total.backward()  # type: ignore[no-untyped-call]
        nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
        self.optimiser.step()
        self.average.update(self.network)
        return losses

    def parts(self) -> Mapping[str, Stateful]:
        return {"network": self.network, "optimiser": self.optimiser, "average": self.average}

    def _batch(self) -> Tensor:
        """``[B, C, T, 21]`` normalised."""
        motions = self.motions[self.draws.rows(self.config.batch, self.generator)]
        cropped = torch.rand(len(motions), generator=self.generator) < self.config.cropping
        for row in torch.nonzero(cropped)[:, 0].tolist():
            motions[row] = random_crop(motions[row], self.generator)
        standard: Tensor = self.standardise(motions)
        return standard.permute(0, 3, 1, 2).contiguous()


def random_crop(motion: Tensor, generator: torch.Generator) -> Tensor:
    """Temporal random cropping of one window ``[T, 21, C]`` (section 3.1): a piece of it, slower or faster.

    A piece shorter than 3/4 of the window lasts up to twice as long, a longer one down to half as long; then it is cut,
    or its last pose held without velocity.
    """
    n_frames = len(motion)
    length = int(torch.randint(n_frames // 2, n_frames + 1, (1,), generator=generator))
    start = int(torch.randint(0, n_frames - length + 1, (1,), generator=generator))
    share = float(torch.rand(1, generator=generator))
    stretch = 1.0 + share if length < 0.75 * n_frames else 0.5 + 0.5 * share
    wanted = max(2, round(length * stretch))
    places = torch.linspace(0.0, length - 1.0, wanted, device=motion.device)
    before = places.floor().long().clamp_max(length - 2)
    piece = motion[start : start + length]
    weight = (places - before)[:, None, None]
    scaled = torch.lerp(piece[before], piece[before + 1], weight)[:n_frames]
    scaled[..., 9:] *= (length - 1) / max(wanted - 1, 1)
    held = scaled[-1:].repeat(n_frames - len(scaled), 1, 1)
    held[..., 9:] = 0.0
    return torch.cat([scaled, held])
